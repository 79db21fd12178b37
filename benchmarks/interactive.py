"""How many processor seconds a single run takes from the command line, all included.

    python benchmarks/interactive.py [--only simulate controllability] [--scenarios NAME ...]
        [--rounds 3] [--json FILE] [--list]

User and system time of whole processes: once with empty caches of jaxsat, then warm, the least of
several rounds, each beside `import jax`, by which machines and hours are compared. Byte code is
there, as `pip install` leaves it: every kind of command runs once before it is measured. Rows "in
Python" are of `jaxsat.build(...).simulate()` in a session, and of a cell of a notebook that changes
a gain and plots, imports and the first `load` aside. Basilisk flies a 12U CubeSat beside it where
it is installed (extra `basilisk`).
"""

import argparse
import dataclasses
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from jaxsat.scenario import library

BASE = [sys.executable, "-c", "import jax"]
REFERENCE = 0.51
"""Processor seconds of `import jax` on the machine that the targets are given for."""

IN_PYTHON = """
import io, sys, time, jax, jaxsat
import matplotlib.pyplot as plt
jax.config.update("jax_enable_x64", True)
jaxsat.build  # imports
name, change = sys.argv[1:]

def cell():
    trajectory = jaxsat.build(jaxsat.load(name, [change])).simulate()
    figure, axes = plt.subplots(3, 1, figsize=(7, 6), sharex=True, layout="constrained")
    for panel, values in zip(axes, trajectory.signals.omega.T):
        panel.plot(trajectory.times, values)
    figure.savefig(io.BytesIO(), format="png")
    plt.close(figure)

scenario, changed = jaxsat.load(name), jaxsat.load(name, [change])
first, again = (lambda one=one: jaxsat.build(one).simulate() for one in (scenario, changed))
for work in (first, again, cell, cell):
    begin = time.process_time()
    work()
    print(time.process_time() - begin)
"""

IN_PYTHON_NAMES = ("first run of a session", "with a changed gain", "first plot", "cell")
IN_PYTHON_TARGETS = (0.3, 0.3, 1.0, 1.0)
CHANGES = {
    "two-torque-free": "initial.w=[0.2, -0.1]",
    "paper-three-axis": "control.k3=0.06",
    "cubesat-3w3m": "control.damping=0.9",
    "hybrid-wheels": "control.damping=0.9",
}

BARE = """
[spacecraft]
inertia_kg_m2 = [0.035, 0.033, 0.008]
thruster_torque_axes = [[1, 0, 0], [0, 1, 0]]
torque_limit_N_m = 0.001

[orbit]
altitude_km = 500
"""
"""A 3U CubeSat that has two torques of 1 mN m left, as `jaxsat design` takes it."""


@dataclasses.dataclass(frozen=True)
class Task:
    """A command, and the processor seconds that it may take on the reference machine."""

    name: str
    command: list[str]
    target: float
    cold_target: float | None = None
    statuses: tuple[int, ...] = (0,)
    until: str | None = None
    """Beginning of a line on standard error with which the measurement ends."""

    rounds: int | None = None
    """Of warm runs, where they take long."""

    before: list[str] | None = None
    """A command that makes what this one reads; it is not measured."""


@dataclasses.dataclass
class Row:
    """Processor seconds with empty caches and warm, and the latter over those of `import jax`."""

    command: str
    cold: float
    warm: float
    base: float
    target: float
    cold_target: float | None

    @property
    def line(self) -> str:
        """The row of a table."""
        cold = "" if self.cold_target is None else f"{self.cold_target / REFERENCE:.1f}"
        ratios = f"{self.cold / self.base:.1f} | {cold} | {self.warm / self.base:.1f}"
        return (
            f"| {self.command} | {self.cold:.2f} | {self.warm:.2f} | {ratios} "
            f"| {self.target / REFERENCE:.1f} |"
        )


HEAD = (
    "| command | cold s | warm s | cold, of `import jax` | target | warm, of `import jax` "
    "| target |\n| --- | --- | --- | --- | --- | --- | --- |"
)


def tasks(folder: Path, scenarios: list[str]) -> Iterator[Task]:
    """All commands; what they write goes to the folder."""
    jaxsat = [sys.executable, "-m", "jaxsat"]
    out, number = ["--overwrite", "--quiet", "--out"], 0

    def at() -> str:
        nonlocal number
        number += 1
        return str(folder / f"out-{number}")

    for name in scenarios:
        yield Task(f"simulate {name}", [*jaxsat, "simulate", name, *out, at()], 2.5, 10)
    changed = ["simulate", "two-torque-free", "--set", "initial.omega_rad_s=[0.01, 0.02, -0.01]"]
    yield Task("simulate two-torque-free --set", [*jaxsat, *changed, *out, at()], 2.5)
    paged = [*jaxsat, "simulate", "two-torque-free", "--report"]
    yield Task("simulate two-torque-free --report", [*paged, *out, at()], 4.5)
    study = [*jaxsat, "montecarlo", "failures-12u", "-n", "8"]
    yield Task("montecarlo failures-12u -n 8", [*study, "--quiet"], 3)
    yield Task("montecarlo failures-12u --case 3", [*study, "--case", "3", *out, at()], 3)
    store = str(folder / "cases")
    many = [*jaxsat, "montecarlo", "benchmark-three-axis", "-n", "100000", "--quiet"]
    pages = [*jaxsat, "report", store, *out, f"{at()}.html"]
    yield Task("report of 100,000 cases", pages, 5, before=[*many, "--out", store])
    reach = [*jaxsat, "controllability", "thruster-dies"]
    yield Task("controllability thruster-dies", reach, 2)
    yield Task("controllability thruster-dies --out", [*reach, *out, at()], 5)
    check = [*jaxsat, "scenarios", "check", "thruster-dies"]
    yield Task("scenarios check thruster-dies", check, 1.5)
    yield Task("scenarios check, mistyped", [*check, "--set", "contrl.law=1"], 0.7, statuses=(2,))
    bare = folder / "bare.toml"
    bare.write_text(BARE, encoding="utf-8")
    design = [*jaxsat, "design", str(bare)]  # into the folder it runs in
    yield Task("design, first answer", design, 20, until="first answer")
    yield Task("design", design, 180, statuses=(0, 1), rounds=1)
    for name, target in (("two-torque-free", 8), ("thruster-dies", 20)):
        yield Task(f"export {name}", [*jaxsat, "export", name, *out, at()], target)


def measured(task: Task | None, flags: dict[str, str]) -> float:
    """Processor seconds of a command and its children; of `import jax` for none.

    It runs in an empty folder, so that a study is not resumed.
    """
    task = task or Task("import jax", BASE, 0)
    with tempfile.TemporaryDirectory() as place, tempfile.TemporaryFile("w+") as output:
        before = os.times()
        piped = {"stdout": output, "stderr": subprocess.PIPE, "text": True}
        with subprocess.Popen(task.command, cwd=place, env=flags, **piped) as process:
            lines = _read(process, task.until)
    if task.until is None and process.returncode not in task.statuses:
        raise SystemExit(f"{' '.join(task.command)} ended with {process.returncode}: {lines}")
    after = os.times()
    used = after.children_user - before.children_user
    return used + after.children_system - before.children_system


def _read(process: subprocess.Popen[str], until: str | None) -> str:
    """What a process writes to standard error; it is killed at the line `until`."""
    lines = []
    for line in process.stderr or ():
        lines.append(line)
        if until is not None and line.startswith(until):
            process.kill()
            return "".join(lines)
    if until is not None:
        raise SystemExit(f"no line began with {until}: {''.join(lines)}")
    return "".join(lines)


def row(task: Task, folder: Path, flags: dict[str, str], rounds: int) -> Row:
    """One command measured."""
    if task.before is not None:
        subprocess.run(task.before, cwd=folder, env=flags, check=True)
    with tempfile.TemporaryDirectory(dir=folder) as cache:
        own = flags | {"JAXSAT_CACHE_DIR": cache}
        cold = measured(task, own)
        turns = [(measured(None, own), measured(task, own)) for _ in range(task.rounds or rounds)]
    base, warm = (min(times) for times in zip(*turns, strict=True))
    return Row(task.name, cold, warm, base, task.target, task.cold_target)


def in_python(
    name: str, change: str, folder: Path, flags: dict[str, str], rounds: int
) -> list[Row]:
    """What takes how long in a session of Python: with empty caches, then with full ones."""
    with tempfile.TemporaryDirectory(dir=folder) as cache:
        own = flags | {"JAXSAT_CACHE_DIR": cache, "MPLBACKEND": "agg"}

        def session() -> list[float]:
            command = [sys.executable, "-c", IN_PYTHON, name, change]
            done = subprocess.run(command, env=own, capture_output=True, text=True, check=True)
            return [float(line) for line in done.stdout.split()]

        cold = session()
        base = min(measured(None, own) for _ in range(rounds))
        warm = [min(times) for times in zip(*(session() for _ in range(rounds)), strict=True)]
    found = zip(IN_PYTHON_NAMES, cold, warm, IN_PYTHON_TARGETS, strict=True)
    return [
        Row(f"in Python, {name}: {what}", empty, full, base, target, None)
        for what, empty, full, target in found
    ]


def basilisk_tasks() -> list[Task]:
    """Basilisk's flight of a 12U CubeSat by its own modules, if it is installed."""
    if importlib.util.find_spec("Basilisk") is None:
        return []
    script = Path(__file__).with_name("contenders") / "basilisk_12u.py"
    return [Task("Basilisk: 12U slew of 900 s", [sys.executable, str(script)], 2.5)]


def main() -> None:
    parser = argparse.ArgumentParser(description="Processor seconds of single commands.")
    parser.add_argument("--only", nargs="*", default=[], help="beginnings of commands")
    parser.add_argument("--scenarios", nargs="*", help="of `simulate`; by default the library")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", type=Path, help="file for the results")
    parser.add_argument("--list", action="store_true", help="only name the commands")
    options = parser.parse_args()
    names = sorted(library()) if options.scenarios is None else options.scenarios
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        flags = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        if flags.keys() != os.environ.keys() and "PYTHONPYCACHEPREFIX" not in flags:
            flags["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")
        chosen = [
            task
            for task in (*tasks(folder, names), *basilisk_tasks())
            if not options.only or task.name.startswith(tuple(options.only))
        ]
        sessions = [
            name
            for name in CHANGES
            if not options.only or f"in Python, {name}".startswith(tuple(options.only))
        ]
        if options.list:
            print("\n".join(task.name for task in chosen))
            return
        print(HEAD)
        rows = []
        for one in _rows(chosen, sessions, folder, flags, options.rounds):
            rows.append(one)
            print(one.line, flush=True)
    if options.json is not None:
        found = {"rows": [dataclasses.asdict(one) for one in rows], "reference": REFERENCE}
        options.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


def _rows(
    chosen: list[Task], sessions: list[str], folder: Path, flags: dict[str, str], rounds: int
) -> Iterator[Row]:
    """Those of commands, each kind of which runs once before, then those of sessions of Python."""
    first, kinds = flags | {"JAXSAT_CACHE_DIR": str(folder / "first")}, set()
    for task in chosen:
        kind = task.name.split()[0]
        if kind not in kinds and task.before is None:
            measured(task, first)
            kinds.add(kind)
        yield row(task, folder, flags, rounds)
    for name in sessions:
        yield from in_python(name, CHANGES[name], folder, flags, rounds)


if __name__ == "__main__":
    main()
