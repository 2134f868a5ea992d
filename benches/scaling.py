#!/usr/bin/env python3
"""How the time of a step grows with ranks and threads, and a model of it.

  scaling.py measure [options]   runs the scenes; writes results/scaling.csv after each run
  scaling.py model               results/scaling.csv to scaling_model.csv and scaling.svg

  --workers 1,2,4    numbers of ranks or threads (else powers of two up to the cores, at most 16)
  --repeats N        turns (else 3). Each begins with what matters most: one core and ranks, then threads, then copies and weak scaling
  --shorter F        ends each scene at the F-th part of its time; F,F,F,F: of cavity, piping, spheres and scour
  --minutes M        starts no run later than this
  --quick            small scenes, one turn, into target/peers/quick: a test of this script
  --busy-ok          goes on where other work runs

A scene has a size in units of the work of one slab: size 1 on one rank, size 2 on two ranks, and so on (weak scaling), and size 2 on
any number of ranks or threads (strong scaling). Three more runs give the numbers of the model, none of which comes from a run on
several ranks that it is compared with: the scene of size 1 and of size 2 on one core, and as many independent runs of size 1 as there
are cores, at the same time: what they lose to each other is what the machine takes, not what messages cost. `messages` (peers/messages.c) measures
messages between two ranks. README.md has the equations.

Environment: SOLVER, PIPING_SAMPLE (else target/peers/piping/sample.csv, which `beside_peers.sh P-2` makes), CORES (else all, one thread of each core
before the second ones); MESSAGES (else made by mpicc), BANDWIDTH (peers/bandwidth.c, else target/peers/bandwidth if it is there), COMMIT (else git's).
"""
import csv
import glob
import json
import math
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(HERE)
TARGET = os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target"))
SOLVER = os.environ.get("SOLVER", os.path.join(TARGET, "release", "solver"))
PEERS = os.path.join(TARGET, "peers")
RESULTS = os.path.join(HERE, "results")
COLUMNS = ["scene", "kind", "size", "ranks", "threads", "steps", "seconds a step", "least", "most", "cells", "grain steps a step",
           "messages a rank and step", "bytes a rank and step", "reductions a step", "imbalance", "waiting share", "runs", "state_hash"]


# --- The scenes: (case, arguments, cells of size 1) ---

def cavity(size, work, quick):
    edge = 48 if quick else 200
    half = edge // 2
    dx = 1e-5
    return os.path.join(HERE, "cases", "cavity_3d.json"), [
        "--set", f"domain.size=[{edge * dx:g}, {edge * dx:g}, {half * size * dx:g}]", "--set", "domain.split=z"]


def piping(size, work, quick):
    if size > 2:
        return None
    sample = os.environ.get("PIPING_SAMPLE", os.path.join(PEERS, "piping", "sample.csv"))
    if not os.path.exists(sample):
        sys.exit(f"scaling: no {sample}; `bash benches/beside_peers.sh P-2` makes it, or name one in PIPING_SAMPLE")
    length, height = 0.0168, 0.008
    arguments = ["--set", "grains.save=null", "--set", "fluid.lattice_boltzmann.boundaries[0].condition.pressure.ramp=null",
                 "--set", "time.solid_steps_per_fluid_step=18", "--set", "output={}", "--set", "probes=[]", "--set", "analysis={}",
                 "--set", "regions=[]", "--set", "domain.split=x"]
    if size == 1:
        # The half with the inlet; the sample and the hole end in the middle.
        path = os.path.join(work, "half.csv")
        with open(sample) as f, open(path, "w") as out:
            lines = csv.reader(f)
            head = next(lines)
            x, radius = head.index("x"), head.index("radius")
            out.write(",".join(head) + "\n")
            for line in lines:
                if float(line[x]) + float(line[radius]) <= length / 2:
                    out.write(",".join(line) + "\n")
        sample = path
        cut = [{"name": "inlet chamber", "box": {"from": [0, 0], "to": [0.0024, height]}},
               {"name": "hole", "box": {"from": [0.0024, 0.0032], "to": [length / 2, 0.0048]}}]
        arguments += ["--set", f"domain.size=[{length / 2:g}, {height:g}]", "--set", "grains.cut=" + json.dumps(cut)]
    arguments += ["--set", "grains.initial=" + json.dumps({"file": {"path": sample}})]
    return os.path.join(ROOT, "jobs", "piping_erosion", "case.json"), arguments


def spheres(size, work, quick):
    sample = os.path.join(PEERS, "box_packed.sample.csv")
    if not os.path.exists(sample):
        subprocess.run([sys.executable, os.path.join(HERE, "peers", "states.py"), "sample", "box_packed", sample], check=True)
    # The box is periodic along x: as many of them as the size says, end to end.
    path = os.path.join(work, f"spheres_{size}.csv")
    if not os.path.exists(path):
        with open(sample) as f:
            head, *lines = f.read().splitlines()
        with open(path, "w") as out:
            out.write(head + "\n")
            for copy in range(size):
                for line in lines:
                    x, rest = line.split(",", 1)
                    out.write(f"{float(x) + 0.2 * copy:.12g},{rest}\n")
    return os.path.join(HERE, "cases", "spheres.json"), [
        "--set", f"domain.size=[{0.2 * size:g}, 0.2, 0.06]", "--set", f"grains.initial.file.path={path}"]


def scour(size, work, quick):
    with open(os.path.join(ROOT, "jobs", "rock_scour", "incline.json")) as f:
        case = json.load(f)
    length = 0.3 if quick else 0.9
    case["domain"]["size"][0] = length * size
    case["domain"]["split"] = "x"
    blocks = []
    for copy in range(size):
        for body in case["bodies"]:
            x, *rest = body["position"]
            blocks.append(dict(body, name=f"{body['name']} {copy}", position=[length * (copy + 0.5), *rest]))
    case["bodies"] = blocks
    case["time"] = {}
    case["probes"], case["output"] = [], {}
    path = os.path.join(work, f"scour_{size}.json")
    with open(path, "w") as f:
        json.dump(case, f)
    return path, []


SCENES = {"cavity": cavity, "piping": piping, "spheres": spheres, "scour": scour}
# Time at the end [s]: whole, quick.
ENDS = {"cavity": (6e-4, 1e-4), "piping": (0.096, 0.0016), "spheres": (4e-3, 3e-4), "scour": (0.02, 0.0025)}
WORDS = {"cavity": "cavity of 200 x 200 x 100 cells a size, D3Q27", "piping": "piping, 420 x 400 cells a size, 18 solid steps",
         "spheres": "100,000 packed spheres a size", "scour": "two blocks in a turbulent stream, 180 x 60 x 30 cells a size"}


def content(path):
    """Text of a file of the system; nothing where there is none."""
    try:
        with open(path) as f:
            return f.read().strip()
    except OSError:
        return ""


def numbers(words):
    """0-2,8 as 0, 1, 2, 8."""
    ends = [[int(end) for end in word.split("-")] for word in words.split(",") if word]
    return [n for end in ends for n in range(end[0], end[-1] + 1)]


def threads_of(cpu):
    return numbers(content(f"/sys/devices/system/cpu/cpu{cpu}/topology/thread_siblings_list")) or [cpu]


def cores():
    named = os.environ.get("CORES")
    if named:
        return [int(word) for word in named.split(",")]
    return sorted(os.sched_getaffinity(0), key=lambda cpu: (threads_of(cpu).index(cpu), cpu))


def command(scene, size, ranks, threads, on, folder, work, quick, shorter):
    made = SCENES[scene](size, work, quick)
    if made is None:
        return None
    case, arguments = made
    launch = ["taskset", "-c", ",".join(map(str, on))]
    if ranks > 1:
        launch += ["mpirun", "--oversubscribe", "--bind-to", "none", "-n", str(ranks)]
    return [*launch, SOLVER, case, "--threads", str(threads), "--output", folder, "--no-final-checkpoint", "--set", "checkpoint.every_wall_seconds=0",
            "--set", f"time.end={ENDS[scene][quick] / shorter[scene]:g}", *arguments]


def finish(process, log):
    if process.wait(timeout=3600) != 0:
        with open(log) as f:
            sys.exit("scaling: the solver failed:\n" + f.read()[-800:])


def start(words, log):
    with open(log, "w") as f:
        return subprocess.Popen(words, stdout=f, stderr=subprocess.STDOUT)


def summary(folder):
    with open(os.path.join(folder, "summary.json")) as f:
        run = json.load(f)
    steps, ranks = run["steps_of_this_run"], run["ranks"]
    traffic = run["traffic"]
    return {"steps": steps, "seconds a step": run["loop_seconds"] / steps, "cells": run["mlups"] * 1e6 * run["loop_seconds"] / steps,
            "grain steps a step": run["particle_steps_per_second"] * run["loop_seconds"] / steps,
            "messages a rank and step": traffic["messages"] / ranks / steps, "bytes a rank and step": traffic["bytes"] / ranks / steps,
            "reductions a step": traffic["collectives"] / steps, "imbalance": run["imbalance"],
            "waiting share": run["waiting_seconds"]["total"]["mean"] / run["loop_seconds"], "state_hash": run["state_hash"]}


def idle():
    def read():
        with open("/proc/stat") as f:
            return [int(word) for word in f.readline().split()[1:9]]
    before = read()
    time.sleep(2)
    spent = [b - a for a, b in zip(before, read())]
    return (spent[3] + spent[4]) / max(sum(spent), 1)


def machine():
    cpu = {}
    for line in content("/proc/cpuinfo").split("\n\n")[0].splitlines():
        name, _, value = line.partition(":")
        cpu[name.strip()] = value.strip()
    caches = []
    for at in sorted(glob.glob("/sys/devices/system/cpu/cpu0/cache/index*")):
        level, kind, size, shared = (content(f"{at}/{name}") for name in ("level", "type", "size", "shared_cpu_list"))
        if kind != "Instruction":
            caches.append(f"L{level} {size} for {len(numbers(shared)) or '?'}")
    nodes = len(glob.glob("/sys/devices/system/node/node[0-9]*"))
    return ", ".join([cpu.get("model name") or platform.processor() or platform.machine(), f"{os.cpu_count()} cores", f"{len(threads_of(0))} threads to a core",
                      "AVX-512" if "avx512f" in cpu.get("flags", "").split() else "no AVX-512", *caches, f"{nodes or '?'} NUMA nodes", f"Linux {platform.release()}"])


def messages(on, work):
    binary = os.environ.get("MESSAGES")
    if not binary:
        binary = os.path.join(work, "messages")
        subprocess.run(["mpicc", "-O3", os.path.join(HERE, "peers", "messages.c"), "-o", binary], check=True)
    return subprocess.run(["taskset", "-c", ",".join(map(str, on[:2])), "mpirun", "--oversubscribe", "--bind-to", "none", "-n", "2", binary],
                          check=True, capture_output=True, text=True).stdout.strip()


def bandwidth(on, workers):
    """Lines of peers/bandwidth.c, over threads."""
    binary = os.environ.get("BANDWIDTH", os.path.join(PEERS, "bandwidth"))
    if not os.path.exists(binary):
        return "not measured"
    lines = [subprocess.run(["taskset", "-c", ",".join(map(str, on[:n])), binary, "1024", "3"], check=True, capture_output=True, text=True,
                            env={**os.environ, "OMP_NUM_THREADS": str(n)}).stdout.strip() for n in workers if n <= len(on)]
    return f"[{', '.join(lines)}]"


def plan(workers, work, quick):
    """(scene, kind, size, ranks, threads) of a turn, in the order of their weight where the time ends before the turn does."""
    many = [n for n in workers if n > 1]
    groups = [[("one core", 1, 1, 1), ("one core", 2, 1, 1)] + [("ranks", 2, n, 1) for n in many],
              [("threads", 2, 1, n) for n in many],
              [one for n in many for one in (("copies", 1, n, 1), ("weak", n, n, 1)) if one[:2] != ("weak", 2)]]
    return [(scene, *one) for group in groups for scene in SCENES for one in group if SCENES[scene](one[1], work, quick) is not None]


def write(path, head, seen):
    """The table of the runs so far."""
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path + ".part", "w", newline="") as f:
        f.writelines(f"# {line}\n" for line in head)
        table = csv.DictWriter(f, COLUMNS, lineterminator="\n", extrasaction="ignore")
        table.writeheader()
        for (scene, kind, size, ranks, threads), runs in seen.items():
            if not runs:
                continue
            # Copies: their mean.
            times = [statistics.mean(one["seconds a step"] for one in run) for run in runs]
            row = {**runs[0][0], "scene": scene, "kind": kind, "size": size, "ranks": ranks, "threads": threads, "seconds a step": statistics.median(times),
                   "least": min(times), "most": max(times), "imbalance": statistics.median(one["imbalance"] for run in runs for one in run),
                   "waiting share": statistics.median(one["waiting share"] for run in runs for one in run), "runs": len(runs)}
            table.writerow({name: f"{value:.5g}" if isinstance(value, float) else value for name, value in row.items()})
    os.replace(path + ".part", path)


def measure(workers, repeats, quick, busy_ok, shorter, minutes):
    on, began = cores(), time.monotonic()
    if max(workers) > len(on):
        print(f"scaling: {len(on)} cores; more workers share them and say nothing of scaling", file=sys.stderr)
    results = os.path.join(PEERS, "quick") if quick else RESULTS
    path = os.path.join(results, "scaling.csv")
    commit = os.environ.get("COMMIT") or subprocess.run(["git", "-C", ROOT, "rev-parse", "--short=12", "HEAD"], capture_output=True, text=True).stdout.strip()
    program = subprocess.run([SOLVER, "-V"], capture_output=True, text=True).stdout.strip()
    quiet, states, done = [], {}, 0
    with tempfile.TemporaryDirectory(dir=os.environ.get("TMPDIR")) as work:
        wanted = plan(workers, work, quick)
        # Rows by scene, whatever the order of the runs.
        seen = {one: [] for one in sorted(wanted, key=lambda one: list(SCENES).index(one[0]))}
        about = [f"commit: {commit}", f"solver: {program}", f"date: {time.strftime('%Y-%m-%dT%H:%M:%SZ', time.gmtime())}", f"machine: {machine()}",
                     f"command: python3 benches/scaling.py {' '.join(sys.argv[1:])}", f"messages: {messages(on, work)}", f"bandwidth [GB/s]: {bandwidth(on, workers)}"]
        # By turns, so that a drift of the machine meets all kinds alike.
        for count, one in enumerate(wanted * repeats):
            scene, kind, size, ranks, threads = one
            if count % len(wanted) == 0:
                quiet.append(idle())
                if quiet[-1] < 0.95 and not busy_ok:
                    sys.exit(f"scaling: the machine is busy (only {quiet[-1]:.2f} of its time was idle over 2 s): end the other work, or --busy-ok")
            if time.monotonic() - began > 60 * minutes:
                print(f"scaling: {minutes:g} minutes are over: {done} of {len(wanted) * repeats} runs")
                break
            folders = [os.path.join(work, f"run_{k}") for k in range(ranks if kind == "copies" else 1)]
            for folder in folders:
                subprocess.run(["rm", "-rf", folder], check=True)
            if kind == "copies":
                jobs = [(command(scene, size, 1, 1, [on[k % len(on)]], folder, work, quick, shorter), folder + ".log") for k, folder in enumerate(folders)]
            else:
                jobs = [(command(scene, size, ranks, threads, on[:ranks * threads], folders[0], work, quick, shorter), folders[0] + ".log")]
            running = [(start(words, log), log) for words, log in jobs]
            for process, log in running:
                finish(process, log)
            last = [summary(folder) for folder in folders]
            states.setdefault((scene, size), set()).update(run["state_hash"] for run in last)
            if len(states[scene, size]) > 1:
                sys.exit(f"scaling: the state of {scene}, size {size}, differs between runs or depends on the number of workers "
                         f"({kind}, {ranks} x {threads}): {states[scene, size]}")
            seen[one].append(last)
            done += 1
            step = max(run["seconds a step"] for run in last)
            print(f"  {time.monotonic() - began:4.0f} s  {scene} {count // len(wanted) + 1}: {kind}, size {size}, {ranks} x {threads}: {step:.4g} s a step", flush=True)
            write(path, about + [f"repeats: {repeats}, by turns, {done} of {len(wanted) * repeats} runs; idle share before each turn {min(quiet):.3f} to {max(quiet):.3f}"]
                  + (["BUSY"] if min(quiet) < 0.95 else []) + (["QUICK"] if quick else []), seen)
    print(f"wrote {path}")
    model(results)


# --- The model ---

def load(results):
    with open(os.path.join(results, "scaling.csv"), newline="") as f:
        lines = list(f)
    told = next(json.loads(line.split("messages:", 1)[1]) for line in lines if line.startswith("# messages:"))
    rows = []
    for row in csv.DictReader(line for line in lines if not line.startswith("#")):
        rows.append({name: value if name in ("scene", "kind", "state_hash") else float(value) for name, value in row.items()})
    return lines, told, rows


class Model:
    """Seconds of a step of a scene on slabs: compute, sharing of the machine, messages."""

    def __init__(self, rows, told):
        one = {row["size"]: row["seconds a step"] for row in rows if row["kind"] == "one core"}
        self.one = one[1.0], one[2.0]
        # Where half the size takes less than half the time (caches), there is no fixed part.
        self.fixed = max(2 * one[1.0] - one[2.0], 0.0)
        self.sharing = {1.0: 1.0}
        for row in rows:
            if row["kind"] == "copies":
                self.sharing[row["ranks"]] = row["seconds a step"] / one[1.0]
        # What a rank sends depends on the section of a slab only.
        ranks = next(row for row in rows if row["kind"] == "ranks" and row["ranks"] == 2)
        self.messages, self.bytes, self.reductions = (ranks[name] for name in ("messages a rank and step", "bytes a rank and step", "reductions a step"))
        self.latency, self.reduction = told["latency"], told["reduction"]
        self.bandwidth = told["bytes"][-1] / told["exchange"][-1]
        self.cells, self.grains = (next(row[name] for row in rows if row["size"] == 1) for name in ("cells", "grain steps a step"))

    def alone(self, size):
        """Seconds of a step on one core with no other beside it: through the two measured sizes, to the fixed part below and in proportion above."""
        half, whole = self.one
        if size <= 1:
            return self.fixed + (half - self.fixed) * size
        return half + (whole - half) * (size - 1) if size <= 2 else whole * size / 2

    def talk(self, ranks, latency=None, bandwidth=None):
        """Messages of one rank: latency and bytes, filled and emptied once more at the same rate; reductions in a tree of ranks."""
        if ranks == 1:
            return 0.0
        latency, bandwidth = latency or self.latency, bandwidth or self.bandwidth
        levels = math.log2(ranks)
        return self.messages * latency + 3 * self.bytes / bandwidth + self.reductions * self.reduction * latency / self.latency * levels

    def step(self, size, ranks, sharing=None, **network):
        """Seconds of a step: `size` in units of the scene, over `ranks`."""
        shared = self.sharing[float(ranks)] if sharing is None else sharing
        return self.alone(size / ranks) * shared + self.talk(ranks, **network)


# A cluster for the curves: nodes of 64 cores, one message a slab in 32 crosses the network; numbers of a common fabric.
NODE = 64
NETWORK = {"latency": 2e-6, "bandwidth": 12.5e9}


def model(results=RESULTS):
    lines, told, rows = load(results)
    models, table = {}, []
    for scene in SCENES:
        mine = [row for row in rows if row["scene"] == scene]
        have = {(row["kind"], row["size"], row["ranks"]) for row in mine}
        # A measurement that ended early.
        if not have >= {("one core", 1, 1), ("one core", 2, 1), ("ranks", 2, 2)}:
            continue
        models[scene] = m = Model(mine, told)
        base = next(row["seconds a step"] for row in mine if row["kind"] == "one core" and row["size"] == 2)
        single = next(row["seconds a step"] for row in mine if row["kind"] == "one core" and row["size"] == 1)
        for row in mine:
            if row["kind"] not in ("ranks", "weak") or row["ranks"] not in m.sharing:
                continue
            predicted = m.step(row["size"], int(row["ranks"]))
            compute = m.alone(row["size"] / row["ranks"]) * m.sharing[row["ranks"]]
            kinds = ["strong", "weak"] if row["kind"] == "ranks" and row["ranks"] == row["size"] else ["strong" if row["kind"] == "ranks" else "weak"]
            for kind in kinds:
                gain = (base if kind == "strong" else single) / row["seconds a step"]
                table.append([scene, kind, int(row["ranks"]), f'{row["seconds a step"]:.5g}', f"{predicted:.5g}", f"{100 * (predicted / row['seconds a step'] - 1):+.1f}",
                              f"{gain:.3f}", f"{compute:.4g}", f"{m.sharing[row['ranks']]:.3f}", f"{m.talk(int(row['ranks'])):.3g}"])
        for row in mine:
            if row["kind"] == "threads":
                table.append([scene, "threads", int(row["threads"]), f'{row["seconds a step"]:.5g}', "", "", f"{base / row['seconds a step']:.3f}", "", "", ""])
    head = ["scene", "kind", "workers", "measured [s]", "model [s]", "error [%]", "speed-up or efficiency", "compute [s]", "sharing", "messages [s]"]
    path = os.path.join(results, "scaling_model.csv")
    with open(path + ".part", "w", newline="") as f:
        f.writelines(line for line in lines if line.startswith("#"))
        out = csv.writer(f, lineterminator="\n")
        out.writerow(head)
        out.writerows(table)
    os.replace(path + ".part", path)
    width = [max(len(str(line[k])) for line in [head, *table]) for k in range(len(head))]
    for line in [head, *table]:
        print("  ".join(str(word).ljust(w) for word, w in zip(line, width)))
    draw(results, rows, models)
    for scene, m in models.items():
        print(f"{scene}: " + thickness(m))


def thickness(m):
    """The slab at which messages, and these with the fixed part of a slab, take a tenth of the step on the network, in units of the scene."""
    talk = m.talk(4096, **NETWORK)
    size = next(n / 1000 for n in range(1, 10**7) if m.alone(n / 1000) >= 9 * talk)
    whole = next(n / 1000 for n in range(1, 10**7) if m.alone(n / 1000) - m.fixed >= 9 * (talk + m.fixed))
    return f"on 4,096 ranks messages take a tenth of a step with slabs of {size:.3g} of size 1, with the fixed part of a slab at {whole:.3g}"


def text(x, y, words, anchor="start", size=12, fill="#222", weight="normal"):
    words = words.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}" fill="{fill}" font-weight="{weight}">{words}</text>'


COLOURS = {"cavity": "#0072b2", "piping": "#d55e00", "spheres": "#009e73", "scour": "#cc79a7"}


def draw(results, rows, models):
    """Parallel efficiency over ranks: weak; strong as measured; strong on a cluster. Points are measured, lines the model."""
    panel, high, left, gap, top = 270, 260, 50, 50, 60
    most = 4096
    measured = max(int(ranks) for m in models.values() for ranks in m.sharing)
    # (words, size on so many ranks, most ranks)
    panels = [("weak: size 1 on each rank", lambda ranks: ranks, most), ("strong: size 2 in all", lambda ranks: 2, max(measured, 2)),
              (f"strong: size {NODE} in all", lambda ranks: NODE, most)]
    highest = 1.4
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + 3 * panel + 2 * gap + 30}" height="{top + high + 150}" font-family="sans-serif">',
             '<rect width="100%" height="100%" fill="white"/>', text(14, 24, "Efficiency over ranks: measured (points) and modelled (lines)", size=15, weight="bold")]
    for k, (words, sized, last) in enumerate(panels):
        x0 = left + k * (panel + gap)

        def place(ranks, efficiency):
            return x0 + panel * math.log2(ranks) / math.log2(last), top + high * (1 - min(max(efficiency, 0), highest) / highest)

        parts.append(text(x0, top - 8, words, size=12))
        for tick in (0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4):
            y = place(1, tick)[1]
            parts.append(f'<line x1="{x0}" y1="{y:.1f}" x2="{x0 + panel}" y2="{y:.1f}" stroke="#ddd"/>')
            parts.append(text(x0 - 6, y + 4, f"{tick:g}", "end", 11))
        powers = range(int(math.log2(last)) + 1)
        for tick in (2**power for power in powers[::2 if last > 64 else 1]):
            x = place(tick, 0)[0]
            parts.append(f'<line x1="{x:.1f}" y1="{top}" x2="{x:.1f}" y2="{top + high}" stroke="#eee"/>')
            parts.append(text(x, top + high + 16, str(tick), "middle", 11))
        parts.append(text(x0 + panel / 2, top + high + 34, "ranks", "middle"))
        for at, (scene, m) in enumerate(models.items()):
            full = max(m.sharing.values())
            points = []
            for ranks in (2**power for power in powers):
                network = {} if ranks <= NODE else NETWORK
                step = m.step(sized(ranks), ranks, sharing=m.sharing.get(float(ranks), full), **network)
                points.append("{:.1f},{:.1f}".format(*place(ranks, m.alone(sized(1)) * sized(ranks) / sized(1) / ranks / step)))
            parts.append(f'<polyline points="{" ".join(points)}" fill="none" stroke="{COLOURS[scene]}" stroke-width="2"/>')
            for row in rows:
                if row["scene"] != scene or row["kind"] not in ("ranks", "weak") or row["size"] != sized(row["ranks"]) or row["ranks"] > last:
                    continue
                x, y = place(row["ranks"], m.alone(sized(1)) * sized(row["ranks"]) / sized(1) / row["ranks"] / row["seconds a step"])
                # Beside each other, so that equal ones are seen.
                parts.append(f'<circle cx="{x + 4 * (at - (len(models) - 1) / 2):.1f}" cy="{y:.1f}" r="4" fill="white" stroke="{COLOURS[scene]}" stroke-width="2"/>')
    y = top + high + 58
    for k, scene in enumerate(models):
        parts.append(f'<line x1="14" y1="{y + 18 * k - 4}" x2="40" y2="{y + 18 * k - 4}" stroke="{COLOURS[scene]}" stroke-width="3"/>')
        parts.append(text(48, y + 18 * k, WORDS[scene], size=12))
    parts.append(text(14, y + 18 * len(models) + 4, f"lines: sharing as measured up to {measured} ranks, the largest beyond; {NODE} ranks a node, a network of 2 us and 12.5 GB/s between nodes", size=11, fill="#555"))
    parts.append("</svg>")
    path = os.path.join(results, "scaling.svg")
    with open(path + ".part", "w") as f:
        f.write("\n".join(parts) + "\n")
    os.replace(path + ".part", path)


def main():
    words = sys.argv[1:]
    if words[:1] == ["model"] and len(words) == 1:
        model()
        return
    if words[:1] != ["measure"]:
        sys.exit(__doc__)
    workers, repeats, quick, busy_ok = [n for n in (1, 2, 4, 8, 16) if n <= len(cores())], 3, False, False
    shorter, minutes = dict.fromkeys(SCENES, 1.0), math.inf
    rest = words[1:]
    while rest:
        word = rest.pop(0)
        if word == "--quick":
            quick, repeats = True, 1
        elif word == "--busy-ok":
            busy_ok = True
        elif word in ("--workers", "--repeats", "--shorter", "--minutes") and rest:
            value = rest.pop(0)
            if word == "--workers":
                workers = sorted({int(n) for n in value.split(",")} | {1})
            elif word == "--shorter":
                parts = [float(part) for part in value.split(",")]
                if len(parts) not in (1, len(SCENES)) or min(parts) <= 0:
                    sys.exit(f"scaling: --shorter has one number above zero or {len(SCENES)} of them")
                shorter = dict(zip(SCENES, parts * len(SCENES)))
            elif word == "--minutes":
                minutes = float(value)
            else:
                repeats = int(value)
        else:
            sys.exit(__doc__)
    measure(workers, repeats, quick, busy_ok, shorter, minutes)


if __name__ == "__main__":
    main()
