"""How many processor seconds a single run takes from the command line, all included.

    python benchmarks/interactive.py [--only simulate controllability] [--scenarios NAME ...]
        [--rounds 3] [--json FILE] [--list]

User and system time of whole processes: once with empty caches of jaxsat, then warm, the least of
several rounds, each beside `import jax`, by which machines and hours are compared. Byte code is
there, as `pip install` leaves it. Every command runs once before anything is measured.
Basilisk flies a 12U CubeSat beside it where it is installed (extra `basilisk`).
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
import sys, time, jax, jaxsat
jax.config.update("jax_enable_x64", True)
from jaxsat.scenario.build.load import load
for overrides in ([], [], ["control.{gain}={value}"]):
    begin = time.process_time()
    jaxsat.build(load("{name}", overrides)).simulate()
    print(time.process_time() - begin)
"""


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
    yield Task("design", design, 180, statuses=(0, 1))
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
    measured(task, flags | {"JAXSAT_CACHE_DIR": str(folder / "first")})
    with tempfile.TemporaryDirectory(dir=folder) as cache:
        own = flags | {"JAXSAT_CACHE_DIR": cache}
        cold = measured(task, own)
        turns = [(measured(None, own), measured(task, own)) for _ in range(rounds)]
    base, warm = (min(times) for times in zip(*turns, strict=True))
    return Row(task.name, cold, warm, base, task.target, task.cold_target)


def in_python(flags: dict[str, str]) -> list[float]:
    """Processor seconds of `build(...).simulate()`: first, again, with a changed gain."""
    text = IN_PYTHON.format(name="paper-three-axis", gain="k3", value=0.06)
    command = [sys.executable, "-c", text]
    done = subprocess.run(command, env=flags, capture_output=True, text=True, check=True)
    return [float(line) for line in done.stdout.split()]


def basilisk_task() -> Task | None:
    """Basilisk's flight of a 12U CubeSat by its own modules, if it is installed."""
    if importlib.util.find_spec("Basilisk") is None:
        return None
    script = Path(__file__).with_name("contenders") / "basilisk_12u.py"
    return Task("Basilisk: 12U slew of 900 s", [sys.executable, str(script)], 2.5)


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
        if flags.keys() != os.environ.keys():
            flags["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")
        peer = basilisk_task()
        chosen = [
            task
            for task in (*tasks(folder, names), *([] if peer is None else [peer]))
            if not options.only or task.name.startswith(tuple(options.only))
        ]
        if options.list:
            print("\n".join(task.name for task in chosen))
            return
        print(HEAD)
        rows = []
        for task in chosen:
            rows.append(row(task, folder, flags, options.rounds))
            print(rows[-1].line, flush=True)
        found = {"rows": [dataclasses.asdict(one) for one in rows], "reference": REFERENCE}
        if not options.only or "python" in options.only:
            found["in_python"] = in_python(flags)
            first, again, gain = found["in_python"]
            print(f"in Python: {first:.2f} s, again {again:.3f} s, changed gain {gain:.3f} s")
        if peer is None:
            print("Basilisk is not installed.")
    if options.json is not None:
        options.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
