"""Random and absurd command lines, each run in a process of its own; `python fuzzing.py N SEED`.

The parent imports everything once and forks, so that a command line takes as long as its work.
"""

import os
import random
import re
import select
import signal
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

STATUSES = {0, 1, 2}
LIMIT = 240.0
"""Seconds after which a command line counts as hanging: all work here is tiny."""

SCENARIOS = ("acceptance-mc", "paper-rate", "switching", "two-torque-free", "mine.toml")
ODD_SCENARIOS = (
    "",
    " ",
    ".",
    "/",
    "..",
    "\udcff.toml",
    "a\nb",
    "x" * 5000,
    "--",
    "/dev/null",
    "folder",
    "file.txt",
    "$k__3$",
    "-",
    "\x1b[31m",
    "mine.toml/",
    "broken.toml",
)
NUMBERS = (
    "0",
    "1",
    "2",
    "3",
    "-1",
    "1.5",
    "1e3",
    "1e9",
    "1e20",
    "1e400",
    "nan",
    "inf",
    "-inf",
    "",
    " ",
    "x",
    "9" * 5000,
    "0x10",
    "٣",
    "none",
    "null",
    "true",
    "[]",
    "1e-9",
    "\udcff",
)
PLACES = (
    "out",
    "deep/er/out",
    "",
    ".",
    "..",
    "/",
    "folder",
    "file.txt",
    "file.txt/out",
    "\udcff",
    "x" * 300,
    "/proc/self/x",
    "/dev/full",
    "/dev/null",
    "a\nb\x1b[31m",
    "link",
    "locked/x",
)
TEXTS = (
    "",
    " ",
    "x",
    "half",
    "1%",
    "200%",
    "tcp://",
    "tcp://127.0.0.1:1",
    "\x1b]0;t\x07",
    "\udcff",
)
SETS = (
    "simulation.duration_s=1",
    "simulation.duration_s=5",
    "title='$k__3$'",
    "title=''",
    "",
    "=",
    "a",
    "a=",
    "=1",
    "control.k1=nan",
    "control.k1=-1",
    "simulation.seed=-1",
    "dispersion={}",
    "x" * 2000 + "=1",
    "a.b.c.d=1",
    "simulation.duration_s=1e-9",
    "simulation.duration_s='x'",
    'title="\\u0000\\u001b"',
    "spacecraft.inertia_kg_m2=[1,1,1]",
    "initial.omega_rad_s=[0,0,0]",
    "simulation.save_every_s=0",
    "\udcff=1",
    "control={}",
    "simulation=3",
    "title=[1",
)

OPTIONS = {
    "simulate": {"--out": PLACES, "--overwrite": None, "--quiet": None},
    "montecarlo": {
        "-n": NUMBERS, "--count": NUMBERS, "--seed": NUMBERS, "--batch-size": NUMBERS,
        "--chunk": NUMBERS, "--workers": NUMBERS, "--case": NUMBERS, "--devices": NUMBERS,
        "--until-ci": (*TEXTS, *NUMBERS), "--out": PLACES, "--figures": PLACES,
        "--engine": ("native", "scan", "auto", "", "x"), "--elsewhere": None, "--quiet": None,
    },
    "tune": {
        "--batch-size": NUMBERS, "--workers": NUMBERS, "--out": PLACES, "--baselines": None,
        "--engine": ("scan", "native", "x"), "--quiet": None,
    },
    "design": {
        "--cases": NUMBERS, "--steps": NUMBERS, "--settled": NUMBERS, "--seed": NUMBERS,
        "--law": ("rate", "three-slew", "x", ""), "--attitude": ("nearest", "x"), "--out": PLACES,
        "--workers": NUMBERS, "--quiet": None,
    },
    "bound": {
        "--starts": ("0", "1", "-1", "1.5", "", "1e9"), "--longest": NUMBERS, "--seed": NUMBERS,
        "--objective": ("time", "effort", "", "x"), "--end": ("settled", "rest", "", "x"),
        "--out": PLACES, "--quiet": None,
    },
    "front": {
        "--guesses": ("0", "-1", "1.5", "", "1e9"), "--torque-limit": NUMBERS,
        "--law": ("rate", "x", ""), "--out": ("", "file.txt", "x" * 300, "/proc/x"),
    },
    "export": {
        "--out": PLACES, "--functions": ("own", "libm", "", "x"), "--float": None,
        "--plan-begin": ("-1", "nan", "0", ""), "--overwrite": None, "--quiet": None,
    },
    "controllability": {
        "--tolerance": NUMBERS, "--failures": NUMBERS, "--out": PLACES, "--overwrite": None,
        "--quiet": None,
    },
    "compare": {
        "--seed": NUMBERS, "-n": NUMBERS, "--law": ("rate", "x", ""), "--torque-limit": NUMBERS,
        "--level": ("nominal", "x"), "--workers": NUMBERS, "--bounds": NUMBERS, "--out": PLACES,
    },
    "report": {"--out": PLACES, "--overwrite": None, "--quiet": None},
    "reproduce": {"--out": ("", "file.txt", "x" * 300, "/proc/x", "folder"), "--overwrite": None},
}  # fmt: skip
SHORT = {
    "simulate": ["--set", "simulation.duration_s=1"],
    "montecarlo": ["--set", "simulation.duration_s=1", "-n", "3", "--engine", "scan"],
    "controllability": [],
    "export": [],
    "tune": ["--set", "tuning.steps=1"],
    "design": ["--cases", "2", "--steps", "0"],
    "bound": ["--starts", "1"],
}
"""What keeps a right command line short."""


def command_line(chance: random.Random) -> list[str]:
    """One of them: most are one mistake away from a right one, some are noise."""
    if chance.random() < 0.1:
        words = [*OPTIONS, "scenarios", "--help", "--version", "--", "-", *TEXTS, *SETS, *NUMBERS]
        return [chance.choice(words) for _ in range(chance.randint(0, 5))]
    if chance.random() < 0.2:
        what = chance.choice(("list", "show", "schema", "check", "check", "", "x"))
        few = [chance.choice((*SCENARIOS, *ODD_SCENARIOS)) for _ in range(chance.randint(0, 2))]
        sets = ["--set", chance.choice(SETS)] if chance.random() < 0.5 else []
        return ["scenarios", what, *few, *sets]
    command = chance.choice(list(OPTIONS))
    tokens = [command]
    if command in SHORT:
        odd = chance.random() < 0.2
        tokens.append(chance.choice(ODD_SCENARIOS if odd else SCENARIOS))
    given = chance.sample(list(OPTIONS[command]), min(len(OPTIONS[command]), chance.randint(0, 3)))
    usual = SHORT.get(command, [])
    for place in range(0, len(usual), 2):
        if usual[place] not in given and chance.random() < 0.98:
            tokens += usual[place : place + 2]
    if command not in ("reproduce", "compare", "report") and chance.random() < 0.3:
        tokens += ["--set", chance.choice(SETS)]
    if command == "compare" and "--seed" not in given and chance.random() < 0.2:
        given.append("--seed")
    if command == "reproduce" and "--out" not in given:
        given.append("--out")
    for option in given:
        values = OPTIONS[command][option]
        tokens += [option] if values is None else [option, chance.choice(values)]
    return tokens


class Found(NamedTuple):
    """What came of a command line: status (None for one that hangs), its output, the seconds."""

    status: int | None
    text: str
    seconds: float


def prepare(folder: Path) -> None:
    """What lies about in the folder where a command line runs."""
    from jaxsat.scenario import library

    mine = library()["acceptance-mc"].read_text(encoding="utf-8")
    (folder / "mine.toml").write_text(mine, encoding="utf-8")
    (folder / "broken.toml").write_text("title = \x1b[31m\n[", encoding="utf-8")
    (folder / "file.txt").write_text("mine", encoding="utf-8")
    (folder / "folder").mkdir()
    (folder / "folder" / "kept").write_text("mine", encoding="utf-8")
    (folder / "link").symlink_to("file.txt")
    (folder / "locked").mkdir(mode=0o555)


def outcome(tokens: list[str], folder: Path, limit: float = LIMIT) -> Found:
    """Run a command line in a child of this process."""
    begin = time.monotonic()
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        os.setsid()
        os.close(reading)
        os.dup2(writing, 1)
        os.dup2(writing, 2)
        os.chdir(folder)
        try:
            from jaxsat.cli import main

            sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
            sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
            main(tokens)
        except SystemExit as end:
            sys.stdout.flush()
            os._exit(end.code if isinstance(end.code, int) else 99)
        except BaseException as error:
            os.write(2, f"Traceback: {error!r}".encode(errors="replace"))
            os._exit(98)
        os._exit(97)
    os.close(writing)
    parts: list[bytes] = []
    while time.monotonic() - begin < limit:
        if select.select([reading], [], [], 0.5)[0]:
            part = os.read(reading, 65536)
            if not part:
                break
            parts.append(part)
    else:
        os.killpg(child, signal.SIGKILL)
    os.close(reading)
    _, raw = os.waitpid(child, 0)
    status = os.waitstatus_to_exitcode(raw)
    hangs = status == -signal.SIGKILL and time.monotonic() - begin >= limit
    text = b"".join(parts).decode(errors="replace")
    return Found(None if hangs else status, text, time.monotonic() - begin)


def complaint(found: Found, folder: Path) -> str:
    """What is wrong with an outcome; empty if nothing is."""
    if found.status is None:
        return "hangs"
    if found.status not in STATUSES:
        return f"status {found.status}"
    if "Traceback" in found.text or "this is a bug" in found.text:
        return "bug"
    if re.search(r"[\x00-\x08\x0b-\x1f\x7f\x80-\x9f]", found.text):
        return "control characters"
    if found.status == 2 and not found.text.strip():
        return "no message"
    if (folder / "file.txt").read_text() != "mine" or not (folder / "folder" / "kept").exists():
        return "replaced what is not its own"
    return ""


def campaign(count: int, seed: int, tell=print) -> list[str]:
    """Run so many command lines; gives a line for each that has a complaint."""
    import importlib

    for name in ("cli.app", "scenario.build.study", "studies", "store", "report.figures"):
        importlib.import_module(f"jaxsat.{name}")
    wrong, statuses = [], {}
    for number in range(count):
        tokens = command_line(random.Random(f"{seed}-{number}"))
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
            folder = Path(name)
            prepare(folder)
            found = outcome(tokens, folder)
            what = complaint(found, folder)
        statuses[found.status] = statuses.get(found.status, 0) + 1
        if what:
            wrong.append(f"{what}: {tokens!r} ({found.seconds:.0f} s): {found.text[-500:]!r}")
            tell(wrong[-1])
    tell(f"{count} command lines, statuses {statuses}, {len(wrong)} complaints")
    return wrong


if __name__ == "__main__":
    sys.exit(bool(campaign(int(sys.argv[1]), int(sys.argv[2]))))
