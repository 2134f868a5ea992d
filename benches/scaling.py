#!/usr/bin/env python3
"""How the time of a step grows with ranks and threads, and a model of it.

  scaling.py measure [--workers 1,2,4] [--repeats N] [--quick] [--busy-ok]   runs the scenes; writes results/scaling.csv
  scaling.py model                                                           results/scaling.csv to scaling_model.csv and scaling.svg

A scene has a size in units of the work of one slab: size 1 on one rank, size 2 on two ranks, and so on (weak scaling), and size 2 on
any number of ranks or threads (strong scaling). Three more runs give the numbers of the model, none of which comes from a run on
several ranks that it is compared with: the scene of size 1 and of size 2 on one core, and as many independent runs of size 1 as there
are cores, at the same time: what they lose to each other is what the machine takes, not what messages cost. `messages` (peers/messages.c) measures
messages between two ranks. README.md has the equations.

Environment: SOLVER, PIPING_SAMPLE (else target/peers/piping/sample.csv, which `beside_peers.sh P-2` makes), CORES (else all).
"""
import csv
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
           "messages a rank and step", "bytes a rank and step", "reductions a step", "imbalance", "waiting share", "state_hash"]


# --- The scenes: (case, arguments, cells of size 1) ---

def cavity(size, work, quick):
    edge = 48 if quick else 200
    half = edge // 2
    dx = 1e-5
    return os.path.join(HERE, "cases", "cavity_3d.json"), [
        "--set", f"domain.size=[{edge * dx:g}, {edge * dx:g}, {half * size * dx:g}]", "--set", "domain.split=z",
        "--set", f"time.end={1e-4 if quick else 6e-4}"]


def piping(size, work, quick):
    if size > 2:
        return None
    sample = os.environ.get("PIPING_SAMPLE", os.path.join(PEERS, "piping", "sample.csv"))
    if not os.path.exists(sample):
        sys.exit(f"scaling: no {sample}; `bash benches/beside_peers.sh P-2` makes it, or name one in PIPING_SAMPLE")
    length, height = 0.0168, 0.008
    arguments = ["--set", "grains.save=null", "--set", "fluid.lattice_boltzmann.boundaries[0].condition.pressure.ramp=null",
                 "--set", "time.solid_steps_per_fluid_step=18", "--set", f"time.end={(20 if quick else 1200) * 8e-5:g}", "--set", "output={}",
                 "--set", "probes=[]", "--set", "analysis={}", "--set", "regions=[]", "--set", "domain.split=x"]
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
        "--set", f"domain.size=[{0.2 * size:g}, 0.2, 0.06]", "--set", f"grains.initial.file.path={path}",
        "--set", f"time.end={3e-4 if quick else 4e-3}"]


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
    case["time"] = {"end": 0.0025 if quick else 0.02}
    case["probes"], case["output"] = [], {}
    path = os.path.join(work, f"scour_{size}.json")
    with open(path, "w") as f:
        json.dump(case, f)
    return path, []


SCENES = {"cavity": cavity, "piping": piping, "spheres": spheres, "scour": scour}
WORDS = {"cavity": "cavity of 200 x 200 x 100 cells a size, D3Q27", "piping": "piping, 420 x 400 cells a size, 18 solid steps",
         "spheres": "100,000 packed spheres a size", "scour": "two blocks in a turbulent stream, 180 x 60 x 30 cells a size"}


def cores():
    named = os.environ.get("CORES")
    return [int(word) for word in named.split(",")] if named else sorted(os.sched_getaffinity(0))


def command(scene, size, ranks, threads, on, folder, work, quick):
    made = SCENES[scene](size, work, quick)
    if made is None:
        return None
    case, arguments = made
    launch = ["taskset", "-c", ",".join(map(str, on))]
    if ranks > 1:
        launch += ["mpirun", "--oversubscribe", "--bind-to", "none", "-n", str(ranks)]
    return [*launch, SOLVER, case, "--threads", str(threads), "--output", folder, "--no-final-checkpoint", "--set", "checkpoint.every_wall_seconds=0", *arguments]


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
    name = platform.processor() or platform.machine()
    with open("/proc/cpuinfo") as f:
        for line in f:
            if line.startswith("model name"):
                name = line.split(":", 1)[1].strip()
                break
    return f"{name}, {os.cpu_count()} cores, Linux {platform.release()}"


def measure(workers, repeats, quick, busy_ok):
    on = cores()
    if max(workers) > len(on):
        print(f"scaling: {len(on)} cores; more workers share them and say nothing of scaling", file=sys.stderr)
    rows, quiet = [], []
    with tempfile.TemporaryDirectory(dir=os.environ.get("TMPDIR")) as work:
        for scene in SCENES:
            # (kind, size, ranks, threads)
            wanted = [("one core", 1, 1, 1), ("one core", 2, 1, 1)]
            for n in workers:
                if n > 1:
                    wanted += [("copies", 1, n, 1), ("ranks", 2, n, 1), ("threads", 2, 1, n)]
                    if n != 2:
                        wanted.append(("weak", n, n, 1))
            wanted = [one for one in wanted if SCENES[scene](one[1], work, quick) is not None]
            seen = {one: [] for one in wanted}
            # By turns, so that a drift of the machine meets all kinds alike.
            for turn in range(repeats):
                share = idle()
                quiet.append(share)
                if share < 0.95 and not busy_ok:
                    sys.exit(f"scaling: the machine is busy (only {share:.2f} of its time was idle over 2 s): end the other work, or --busy-ok")
                for kind, size, ranks, threads in wanted:
                    folders = [os.path.join(work, f"run_{k}") for k in range(ranks if kind == "copies" else 1)]
                    for folder in folders:
                        subprocess.run(["rm", "-rf", folder], check=True)
                    if kind == "copies":
                        jobs = [(command(scene, size, 1, 1, [on[k % len(on)]], folder, work, quick), folder + ".log") for k, folder in enumerate(folders)]
                    else:
                        jobs = [(command(scene, size, ranks, threads, on[:ranks * threads], folders[0], work, quick), folders[0] + ".log")]
                    running = [(start(words, log), log) for words, log in jobs]
                    for process, log in running:
                        finish(process, log)
                    seen[kind, size, ranks, threads].append([summary(folder) for folder in folders])
                    last = seen[kind, size, ranks, threads][-1]
                    print(f"  {scene} {turn + 1}: {kind}, size {size}, {ranks} x {threads}: {max(one['seconds a step'] for one in last):.4g} s a step", flush=True)
            for (kind, size, ranks, threads), runs in seen.items():
                # Copies: their mean.
                times = [statistics.mean(one["seconds a step"] for one in run) for run in runs]
                first = runs[0][0]
                hashes = {one["state_hash"] for run in runs for one in run}
                if len(hashes) > 1:
                    sys.exit(f"scaling: runs of {scene} differ: {hashes}")
                rows.append({**first, "scene": scene, "kind": kind, "size": size, "ranks": ranks, "threads": threads, "seconds a step": statistics.median(times),
                             "least": min(times), "most": max(times), "imbalance": statistics.median(one["imbalance"] for run in runs for one in run),
                             "waiting share": statistics.median(one["waiting share"] for run in runs for one in run)})
        binary = os.path.join(work, "messages")
        subprocess.run(["mpicc", "-O3", os.path.join(HERE, "peers", "messages.c"), "-o", binary], check=True)
        told = subprocess.run(["taskset", "-c", ",".join(map(str, on[:2])), "mpirun", "--oversubscribe", "--bind-to", "none", "-n", "2", binary],
                              check=True, capture_output=True, text=True).stdout
    for scene in SCENES:
        hashes = {row["state_hash"] for row in rows if row["scene"] == scene and row["size"] == 2}
        if len(hashes) > 1:
            sys.exit(f"scaling: the state of {scene} depends on the number of workers: {hashes}")
    commit = subprocess.run(["git", "-C", ROOT, "rev-parse", "--short=12", "HEAD"], capture_output=True, text=True).stdout.strip()
    program = subprocess.run([SOLVER, "-V"], capture_output=True, text=True).stdout.strip()
    head = [f"commit: {commit}", f"solver: {program}", f"date: {time.strftime('%Y-%m-%dT%H:%M:%SZ', time.gmtime())}", f"machine: {machine()}",
            f"command: python3 benches/scaling.py {' '.join(sys.argv[1:])}", f"repeats: {repeats}, by turns; idle share before each turn {min(quiet):.3f} to {max(quiet):.3f}",
            f"messages: {told.strip()}"] + (["BUSY"] if min(quiet) < 0.95 else []) + (["QUICK"] if quick else [])
    results = os.path.join(PEERS, "quick") if quick else RESULTS
    os.makedirs(results, exist_ok=True)
    path = os.path.join(results, "scaling.csv")
    with open(path + ".part", "w", newline="") as f:
        f.writelines(f"# {line}\n" for line in head)
        table = csv.DictWriter(f, COLUMNS, lineterminator="\n", extrasaction="ignore")
        table.writeheader()
        for row in rows:
            table.writerow({name: f"{value:.5g}" if isinstance(value, float) else value for name, value in row.items()})
    os.replace(path + ".part", path)
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
        if not mine:
            continue
        models[scene] = m = Model(mine, told)
        base = next(row["seconds a step"] for row in mine if row["kind"] == "one core" and row["size"] == 2)
        single = next(row["seconds a step"] for row in mine if row["kind"] == "one core" and row["size"] == 1)
        for row in mine:
            if row["kind"] not in ("ranks", "weak"):
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
    """Parallel efficiency over ranks: weak to the left, strong to the right; points are measured, lines the model on a cluster."""
    panel, high, left, gap, top = 330, 260, 60, 70, 60
    most = 4096
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + 2 * panel + gap + 30}" height="{top + high + 150}" font-family="sans-serif">',
             '<rect width="100%" height="100%" fill="white"/>', text(14, 24, "Efficiency over ranks: measured (points) and modelled (lines)", size=15, weight="bold")]
    for k, kind in enumerate(("weak", "strong")):
        x0 = left + k * (panel + gap)

        def place(ranks, efficiency):
            return x0 + panel * math.log2(ranks) / math.log2(most), top + high * (1 - min(max(efficiency, 0), 1.2) / 1.2)

        parts.append(text(x0, top - 8, "a slab of size 1 for each rank" if kind == "weak" else "64 slabs of size 1 in all", size=12))
        for tick in (0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2):
            y = place(1, tick)[1]
            parts.append(f'<line x1="{x0}" y1="{y:.1f}" x2="{x0 + panel}" y2="{y:.1f}" stroke="#ddd"/>')
            parts.append(text(x0 - 6, y + 4, f"{tick:g}", "end", 11))
        for tick in (1, 4, 16, 64, 256, 1024, 4096):
            x = place(tick, 0)[0]
            parts.append(f'<line x1="{x:.1f}" y1="{top}" x2="{x:.1f}" y2="{top + high}" stroke="#eee"/>')
            parts.append(text(x, top + high + 16, str(tick), "middle", 11))
        parts.append(text(x0 + panel / 2, top + high + 34, "ranks", "middle"))
        for scene, m in models.items():
            full = max(m.sharing.values())
            points = []
            for power in range(0, 13):
                ranks = 2 ** power
                sharing = 1.0 if ranks == 1 else full
                network = {} if ranks <= NODE else NETWORK
                size = ranks if kind == "weak" else 64
                alone = m.alone(1) if kind == "weak" else m.alone(64) / ranks
                points.append("{:.1f},{:.1f}".format(*place(ranks, alone / m.step(size, ranks, sharing=sharing, **network))))
            parts.append(f'<polyline points="{" ".join(points)}" fill="none" stroke="{COLOURS[scene]}" stroke-width="2"/>')
            one = {row["size"]: row["seconds a step"] for row in rows if row["scene"] == scene and row["kind"] == "one core"}
            for row in rows:
                if row["scene"] != scene or row["kind"] not in ("ranks", "weak"):
                    continue
                if kind == "weak" and row["size"] == row["ranks"]:
                    x, y = place(row["ranks"], one[1.0] / row["seconds a step"])
                elif kind == "strong" and row["kind"] == "ranks":
                    x, y = place(row["ranks"], one[2.0] / row["seconds a step"] / row["ranks"])
                else:
                    continue
                parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="white" stroke="{COLOURS[scene]}" stroke-width="2"/>')
    y = top + high + 58
    for k, scene in enumerate(models):
        parts.append(f'<line x1="14" y1="{y + 18 * k - 4}" x2="40" y2="{y + 18 * k - 4}" stroke="{COLOURS[scene]}" stroke-width="3"/>')
        parts.append(text(48, y + 18 * k, WORDS[scene], size=12))
    parts.append(text(14, y + 18 * len(models) + 4, f"cluster of the lines: sharing as measured with all cores of this machine, {NODE} ranks a node, 2 us and 12.5 GB/s beyond it", size=11, fill="#555"))
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
    rest = words[1:]
    while rest:
        word = rest.pop(0)
        if word == "--quick":
            quick, repeats = True, 1
        elif word == "--busy-ok":
            busy_ok = True
        elif word in ("--workers", "--repeats") and rest:
            value = rest.pop(0)
            if word == "--workers":
                workers = sorted({int(n) for n in value.split(",")} | {1})
            else:
                repeats = int(value)
        else:
            sys.exit(__doc__)
    measure(workers, repeats, quick, busy_ok)


if __name__ == "__main__":
    main()
