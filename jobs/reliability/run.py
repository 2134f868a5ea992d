#!/usr/bin/env python3
"""Runs are killed, checkpoints damaged, disks filled, folders taken away: nothing may be lost but the last interval.

    python3 jobs/reliability/run.py [--solver FILE] [--seed N] [--kills 100] [--damages 100] [--disks 27] [--csv FILE]

Each scenario ends in a run that goes on to its end and must have the state hash and the tables of a run that nothing disturbed.
The case is the hole-erosion example: it grows a sample, bonds and settles it, warms the water up, runs, and writes every kind of
file. Needs Python 3.9, mpirun, and for the small disks the right to mount a tmpfs (they are left out without it). Ends with 1 if any
scenario failed.
"""

import argparse
import csv
import json
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
# A job that takes longer hangs [s].
LIMIT = 600
# A job of which a process was killed is gone after this [s].
LINGER = 15
SETTINGS = [
    "time.end=0.012",
    'time.warm_up={"fluid_only": {"relative_change": 1e-5, "at_most": 0.01}}',
    "fluid.lattice_boltzmann.boundaries[0].condition.pressure.value=0.5",
    "fluid.lattice_boltzmann.boundaries[0].condition.pressure.ramp.duration=0.05",
    "checkpoint.every=0.0005",
    "checkpoint.every_wall_seconds=0.5",
    "output.fluid.every=0.001",
    "output.grains.every=0.001",
    "output.contacts.every=0.002",
    "probes[0].every=0.0002",
    "analysis.erosion_law.every=0.0002",
]
TABLES = ["erosion.csv", "removed.csv", "bonds.csv", "probe_hole.csv"]
ENVIRONMENT = {
    **os.environ,
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
    "PMIX_MCA_psec": "native",
}


class Failure(Exception):
    """What a scenario should not have done."""


class Job:
    """The solver on some ranks, its output in a file."""

    def __init__(self, solver, ranks, arguments, log):
        words = [str(solver), *map(str, arguments), "--threads", "1"]
        if ranks > 1:
            words = ["mpirun", "--oversubscribe", "-n", str(ranks), *words]
        self.log = open(log, "ab")
        self.begun = time.monotonic()
        self.process = subprocess.Popen(
            words, stdout=self.log, stderr=subprocess.STDOUT, env=ENVIRONMENT, start_new_session=True
        )
        self.ranks = ranks

    def wait(self, limit=LIMIT):
        try:
            code = self.process.wait(limit)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
            raise Failure(f"hangs: no end within {limit} s") from None
        finally:
            self.log.close()
        return code

    def processes(self):
        """The ranks."""
        if self.ranks == 1:
            return [self.process.pid]
        path = f"/proc/{self.process.pid}/task/{self.process.pid}/children"
        try:
            return [int(word) for word in pathlib.Path(path).read_text().split()]
        except OSError:
            return []

    def kill(self, chance):
        """Kills one rank, or mpirun."""
        victims = self.processes()
        if self.ranks > 1 and chance.random() < 0.2:
            victims = [self.process.pid]
        if not victims:
            return
        try:
            os.kill(chance.choice(victims), signal.SIGKILL)
        except ProcessLookupError:
            pass


class Bench:
    def __init__(self, options):
        self.solver = options.solver
        self.work = pathlib.Path(tempfile.mkdtemp(prefix="reliability-"))
        self.case = self.work / "piping.json"
        text = subprocess.run(
            [self.solver, "example", "piping"], check=True, capture_output=True, text=True
        ).stdout
        self.case.write_text(text)
        self.options = [word for setting in SETTINGS for word in ("--set", setting)]
        self.chance = random.Random(options.seed)
        self.rows = []

    def start(self, folder, ranks, *more):
        return Job(
            self.solver, ranks, [self.case, "--output", folder, *self.options, *more], f"{folder}.log"
        )

    def restart(self, folder, ranks):
        return Job(self.solver, ranks, ["restart", folder], f"{folder}.log")

    def straight(self):
        folder = self.work / "straight"
        begun = time.monotonic()
        expect(self.start(folder, 1).wait(), 0, "the undisturbed run")
        self.seconds = time.monotonic() - begun
        self.hash = state(folder)
        self.tables = tables(folder)
        print(f"undisturbed: {self.seconds:.1f} s, state {self.hash}", flush=True)

    def equals(self, folder):
        if state(folder) != self.hash:
            raise Failure(f"the state is {state(folder)}")
        for name, text in tables(folder).items():
            if text != self.tables[name]:
                raise Failure(f"{name} differs")
        for file in sorted(folder.glob("*.vtkhdf")):
            done = subprocess.run([self.solver, "info", file], capture_output=True, check=False)
            if done.returncode != 0:
                raise Failure(f"{file.name} cannot be read")

    def go_on(self, folder, ranks):
        """A restart where there is something to go on from, else from the beginning."""
        saved = list(folder.glob("checkpoints/*.json")) + list(folder.glob("preparation/*.json"))
        if saved:
            return self.restart(folder, ranks), "restart"
        return self.start(folder, ranks, "--overwrite"), "anew"

    def scenario(self, kind, number, work):
        begun = time.monotonic()
        folder = self.work / f"{kind}_{number}"
        try:
            told, passed = work(folder), True
        except (Failure, OSError, subprocess.SubprocessError) as failure:
            told, passed = str(failure), False
        seconds = time.monotonic() - begun
        self.rows.append([kind, number, "ok" if passed else "FAILED", told, f"{seconds:.1f}"])
        if not passed or number % 10 == 0:
            print(f"{'ok     ' if passed else 'FAILED '} {kind} {number}: {told} ({seconds:.1f} s)", flush=True)
        if passed:
            shutil.rmtree(folder, ignore_errors=True)

    def killed(self, folder):
        """Killed up to three times, on changing numbers of ranks, then left alone."""
        story = []
        for attempt in range(4):
            ranks = self.chance.choice([1, 2, 3])
            if attempt == 0:
                job, how = self.start(folder, ranks), "start"
            else:
                job, how = self.go_on(folder, ranks)
            if attempt == 3 or attempt > 0 and self.chance.random() < 0.3:
                expect(job.wait(), 0, how)
                story.append(f"{how} on {ranks}")
                break
            moment = self.chance.uniform(0.1, 1.1 * self.seconds * (1 if ranks == 1 else 1.5))
            while time.monotonic() - job.begun < moment and job.process.poll() is None:
                time.sleep(0.01)
            alive = job.process.poll() is None
            ranks_there = job.processes()
            job.kill(self.chance)
            killed = time.monotonic()
            code = job.wait()
            # Ranks whose mpirun was killed live until they miss it, and keep the folder until then.
            while any(map(lives, ranks_there)) and time.monotonic() - killed < LINGER:
                time.sleep(0.01)
            if time.monotonic() - killed > LINGER:
                raise Failure(f"ended {time.monotonic() - killed:.1f} s after a kill")
            story.append(f"{how} on {ranks}, {'killed' if alive else 'ended'} at {moment:.1f} s")
            if not alive or code == 0:
                expect(code, 0, how)
                break
        self.equals(folder)
        return "; ".join(story)

    def stopped(self, folder):
        """Asked to stop again and again, in every phase; each time the answer comes soon and is 75."""
        stops, slowest, attempt = 0, 0.0, 0
        while True:
            ranks = 1 + attempt % 3
            job = self.start(folder, ranks) if attempt == 0 else self.go_on(folder, ranks)[0]
            attempt += 1
            moment = self.chance.uniform(0.2, 0.5 * self.seconds)
            while time.monotonic() - job.begun < moment and job.process.poll() is None:
                time.sleep(0.01)
            while not folder.exists() and job.process.poll() is None:
                time.sleep(0.01)
            asked = time.monotonic()
            if job.process.poll() is None:
                (folder / "STOP").touch()
            code = job.wait()
            if code == 0:
                break
            expect(code, 75, "a stop")
            stops, slowest = stops + 1, max(slowest, time.monotonic() - asked)
        (folder / "STOP").unlink(missing_ok=True)
        if slowest > 5:
            raise Failure(f"a stop took {slowest:.1f} s")
        self.equals(folder)
        return f"{stops} stops, the slowest {slowest:.1f} s"

    def damaged(self, folder):
        """One bit, one page or the end of a file of the newest checkpoint is damaged: the one before is taken."""
        shutil.copytree(self.work / "straight", folder)
        newest = max((folder / "checkpoints").glob("*.json"), key=lambda path: path.name)
        file = self.chance.choice([newest, newest.with_suffix(".h5")])
        data = bytearray(file.read_bytes())
        place = self.chance.randrange(len(data))
        how = self.chance.choice(["bit", "cut", "page", "gone"])
        if how == "bit":
            data[place] ^= 1 << self.chance.randrange(8)
        elif how == "cut":
            del data[place:]
        elif how == "page":
            end = min(place + 4096, len(data))
            data[place:end] = bytes(end - place)
        if how == "gone":
            file.unlink()
        else:
            file.write_bytes(data)
        told = f"{how} of {file.suffix} at {place}"
        expect(self.restart(folder, self.chance.choice([1, 2])).wait(), 0, told)
        self.equals(folder)
        return told

    def full(self, folder, share):
        """A disk of a share of what the run needs: an end with 0 or 5, and a larger disk goes on to the same end."""
        needed = sum(file.stat().st_size for file in (self.work / "straight").rglob("*") if file.is_file())
        size = max(int(1.3 * needed * share), 65536)
        folder.mkdir()
        if not mounted(folder, f"size={size}"):
            return "left out: no right to mount"
        try:
            run = folder / "run"
            log = self.work / f"{folder.name}.run.log"
            ranks = self.chance.choice([1, 2])
            job = Job(self.solver, ranks, [self.case, "--output", run, *self.options], log)
            code = job.wait()
            if code not in (0, 5):
                raise Failure(f"ended with {code} on a disk of {size} bytes")
            subprocess.run(["mount", "-o", f"remount,size={8 * needed}", folder], check=True)
            if code == 5:
                saved = list(run.glob("checkpoints/*.json")) + list(run.glob("preparation/*.json"))
                words = ["restart", run] if saved else [self.case, "--output", run, "--overwrite", *self.options]
                expect(Job(self.solver, ranks, words, log).wait(), 0, "on the larger disk")
            self.equals(run)
            return f"{size} bytes: {code}"
        finally:
            subprocess.run(["umount", "-l", folder], check=False)

    def twice(self, folder):
        """Two runs at once in one folder: the second is refused, the first does not notice."""
        first = self.start(folder, 2)
        while not (folder / "run.lock").exists():
            time.sleep(0.01)
        time.sleep(1)
        second = Job(self.solver, 1, [self.case, "--output", folder, *self.options], f"{folder}.second.log")
        expect(second.wait(), 2, "the second run")
        third = Job(self.solver, 2, ["restart", folder], f"{folder}.second.log")
        expect(third.wait(), 2, "a restart beside it")
        expect(first.wait(), 0, "the first run")
        self.equals(folder)
        return "refused"

    def removed(self, folder):
        """The folder is taken away under the run: an end with 5."""
        job = self.start(folder, self.chance.choice([1, 2]))
        while not (folder / "probe_hole.csv").exists():
            time.sleep(0.05)
            if job.process.poll() is not None:
                raise Failure("ended before its first row")
        # Files come and go while it is taken away.
        while folder.exists():
            shutil.rmtree(folder, ignore_errors=True)
        code = job.wait(120)
        if code != 5:
            raise Failure(f"ended with {code}")
        return "5"

    def read_only(self, folder):
        """A folder that cannot be written to, from the start or from the middle on: an end with 5."""
        folder.mkdir()
        if not mounted(folder, "size=200m"):
            return "left out: no right to mount"
        try:
            run = folder / "run"
            log = self.work / f"{folder.name}.run.log"
            job = Job(self.solver, 2, [self.case, "--output", run, *self.options], log)
            while not (run / "probe_hole.csv").exists():
                time.sleep(0.05)
            # What is open for writing keeps the disk from being made read-only: it is made full instead.
            while job.process.poll() is None:
                disk = os.statvfs(folder)
                used = (disk.f_blocks - disk.f_bfree) * disk.f_frsize
                # Refused where the run has written more in between.
                if remounted(folder, f"size={used + 65536}"):
                    break
            code = job.wait()
            if code not in (0, 5):
                raise Failure(f"ended with {code}")
            subprocess.run(["mount", "-o", "remount,ro,size=200m", folder], check=True)
            again = Job(self.solver, 2, ["restart", run], log).wait()
            expect(again, 5, "a restart in a folder that cannot be written to")
            subprocess.run(["mount", "-o", "remount,rw", folder], check=True)
            expect(Job(self.solver, 1, ["restart", run], log).wait(), 0, "once it can be")
            self.equals(run)
            return "5"
        finally:
            subprocess.run(["umount", "-l", folder], check=False)


def lives(process):
    try:
        text = pathlib.Path(f"/proc/{process}/stat").read_text()
    except OSError:
        return False
    return text.rpartition(")")[2].split()[0] != "Z"


def mounted(folder, options):
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "tmpfs", folder], capture_output=True, check=False
    )
    return done.returncode == 0


def remounted(folder, options):
    words = ["mount", "-o", f"remount,{options}", folder]
    return subprocess.run(words, capture_output=True, check=False).returncode == 0


def state(folder):
    try:
        summary = json.loads((folder / "summary.json").read_text())
    except (OSError, ValueError) as error:
        raise Failure(f"no summary: {error}") from None
    if summary.get("outcome") != "done":
        raise Failure(f"the summary says {summary.get('outcome')}")
    return summary["state_hash"]


def tables(folder):
    return {name: (folder / name).read_text() for name in TABLES if (folder / name).exists()}


def expect(code, wanted, what):
    if code != wanted:
        raise Failure(f"{what} ended with {code}, not {wanted}")


def machine():
    models = [line for line in open("/proc/cpuinfo") if line.startswith("model name")]
    name = models[0].split(":")[1].strip() if models else "unknown"
    return f"{name}, {os.cpu_count()} cores"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    target = os.environ.get("CARGO_TARGET_DIR", ROOT / "target")
    parser.add_argument("--solver", default=pathlib.Path(target) / "release" / "solver")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--stops", type=int, default=5)
    parser.add_argument("--damages", type=int, default=100)
    parser.add_argument("--disks", type=int, default=27)
    parser.add_argument("--others", type=int, default=3, help="of two at once, folder removed, folder read-only")
    parser.add_argument("--csv", type=pathlib.Path)
    options = parser.parse_args()
    bench = Bench(options)
    bench.straight()
    for n in range(options.stops):
        bench.scenario("stop", n, bench.stopped)
    for n in range(options.others):
        bench.scenario("two at once", n, bench.twice)
        bench.scenario("removed", n, bench.removed)
        bench.scenario("read-only", n, bench.read_only)
    for n in range(options.damages):
        bench.scenario("damage", n, bench.damaged)
    for n in range(options.disks):
        bench.scenario("disk", n, lambda folder, n=n: bench.full(folder, (n + 1) / (options.disks + 1)))
    for n in range(options.kills):
        bench.scenario("kill", n, bench.killed)
    if options.csv:
        with open(options.csv, "w", newline="") as file:
            version = subprocess.run([options.solver, "--version"], capture_output=True, text=True).stdout
            print(f"# solver: {'; '.join(version.splitlines())}", file=file)
            print(f"# machine: {machine()}", file=file)
            print(f"# command: python3 jobs/reliability/run.py {' '.join(sys.argv[1:])}", file=file)
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["scenario", "number", "outcome", "what", "seconds"])
            writer.writerows(bench.rows)
    failed = [row for row in bench.rows if row[2] != "ok"]
    print(f"{len(bench.rows) - len(failed)} passed, {len(failed)} failed")
    if failed:
        print(f"what they left is in {bench.work}")
        return 1
    shutil.rmtree(bench.work)
    return 0


if __name__ == "__main__":
    sys.exit(main())
