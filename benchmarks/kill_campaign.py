"""Kill commands of the command line at random instants, damage what they left, and resume them.

    python benchmarks/kill_campaign.py --kills 200 --seed 1

Every round starts a command in a process group of its own, waits for a random time, ends the group
by SIGKILL (now and then by SIGINT or SIGTERM), and sometimes damages a file of the result. Rounds
repeat in the same folder until the command ends by itself; the result must then equal, bit for
bit, one that was never disturbed. The table counts what happened; the exit status is 1 if anything
was lost, differed in silence or ended in a traceback.

A damaged result may be refused with a message. It is then put back as it was before the damage.
"""

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from corruption import corrupt, files_of
from fingerprints import (
    comparison_fingerprint,
    run_fingerprint,
    store_fingerprint,
    tuning_fingerprint,
)


def settings(values: Mapping[str, object]) -> tuple[str, ...]:
    """Overrides of a scenario as options."""
    return tuple(token for key, value in values.items() for token in ("--set", f"{key}={value}"))


COAST = {
    "control.law": "coast",
    "dispersion.omega_rad_s": "{distribution='uniform', low=-0.1, high=0.1}",
    "simulation.duration_s": 50,
}
STUDY = ("montecarlo", "paper-rate", *settings(COAST), "--chunk", "64", "--batch-size", "8")
COMPARISON = ("--level", "mc", "--law", "rate", "--law", "switching", "--torque-limit", "20")
TUNING = ("tune", "rate-limited", "--batch-size", "4", "--workers", "1")
SHORT = {
    "simulation.duration_s": 8,
    "tuning.steps": 40,
    "tuning.halve_at": "[20]",
    "tuning.starts": 2,
    "tuning.screened": 4,
    "tuning.cases": 4,
    "tuning.validation_cases": 4,
    "tuning.held_out_cases": 8,
}
"""What makes a tuning run one of some seconds."""

MAX_SECONDS = 600.0
"""No command of the campaign may take longer."""

PATIENCE_S = 30.0
"""How long a command that is asked to stop may take."""

STATUSES = {signal.SIGINT: 130, signal.SIGTERM: 143}


@dataclass(frozen=True)
class Target:
    """A command, what it writes, and what of it must not depend on how it came about.

    The output of one that does not resume appears at once and whole.
    """

    name: str
    command: tuple[str, ...]
    output: str
    fingerprint: Callable[[Path], dict[str, str]]
    resumes: bool = True


TARGETS = (
    Target(
        "montecarlo, native", (*STUDY, "-n", "4000", "--engine", "native"), "s", store_fingerprint
    ),
    Target("montecarlo, scan", (*STUDY, "-n", "400", "--engine", "scan"), "s", store_fingerprint),
    Target(
        "montecarlo, processes",
        (*STUDY, "-n", "400", "--engine", "scan", "--processes", "2"),
        "s",
        store_fingerprint,
    ),
    Target("tune", (*TUNING, *settings(SHORT)), "t", tuning_fingerprint),
    Target(
        "compare", ("compare", *COMPARISON, "-n", "200", "--seed", "3"), "c", comparison_fingerprint
    ),
    Target(
        "simulate",
        ("simulate", "paper-rate", "--set", "simulation.duration_s=20"),
        "r",
        run_fingerprint,
        resumes=False,
    ),
)


@dataclass
class Tally:
    """What happened to one target."""

    counts: Counter = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    def fault(self, text: str) -> None:
        """Something that must not be; told at once, as a campaign takes long."""
        self.faults.append(text)
        print(f"fault: {text}", file=sys.stderr, flush=True)


@dataclass(frozen=True)
class Ended:
    """A command that was started: how it ended, and whether by itself."""

    status: int
    told: str
    sent: signal.Signals | None
    seconds: float


def run(target: Target, folder: Path, kill_after: float | None, sent: signal.Signals) -> Ended:
    """Start a target's command in a folder; end its process group after some seconds."""
    begin = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-m", "jaxsat", *target.command, "--out", target.output],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
        start_new_session=True,
    )
    delivered = None
    try:
        told = process.communicate(timeout=MAX_SECONDS if kill_after is None else kill_after)[1]
    except subprocess.TimeoutExpired:
        if kill_after is None:
            sent = signal.SIGKILL
        delivered = sent
        os.killpg(process.pid, sent)
        try:
            told = process.communicate(timeout=PATIENCE_S)[1]
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            told = process.communicate()[1] + "\nTraceback: did not stop in time"
    return Ended(process.returncode, told, delivered, time.monotonic() - begin)


class Campaign:
    """Rounds of kills and damage over one target until a number of kills is reached."""

    def __init__(self, target: Target, work: Path, rng: np.random.Generator):
        self._target, self._work, self._rng = target, work, rng
        self.tally = Tally()
        undisturbed = self._folder("undisturbed")
        first = run(target, undisturbed, None, signal.SIGKILL)
        if first.status != 0:
            raise SystemExit(f"{target.name} fails by itself: {first.told}")
        self._expected = target.fingerprint(undisturbed / target.output)
        self._seconds = run(target, self._folder("timed"), None, signal.SIGKILL).seconds

    def until(self, kills: int) -> Tally:
        """Trials, each from an empty folder to a finished result."""
        counts = self.tally.counts
        while counts["kills"] < kills:
            counts["trials"] += 1
            self._trial(self._folder(f"trial-{counts['trials']}"), kills)
        return self.tally

    def _folder(self, name: str) -> Path:
        folder = self._work / name
        folder.mkdir()
        (folder / "mine.txt").write_text("the user's own", encoding="utf-8")
        return folder

    def _trial(self, folder: Path, kills: int) -> None:
        counts, output = self.tally.counts, folder / self._target.output
        while True:
            rest = counts["kills"] < kills
            after = float(self._rng.uniform(0, 1.1 * self._seconds)) if rest else None
            ended = run(self._target, folder, after, self._signal())
            self._judge(ended, folder)
            if ended.sent is None:
                if ended.status != 0:
                    return
                break
            counts["kills" if ended.sent is signal.SIGKILL else "interruptions"] += 1
            if not self._target.resumes and output.exists():
                break
            if output.is_dir() and files_of(output) and self._rng.random() < 0.25:
                self._damage(folder)
        self._compare(output)
        if self._target.resumes and self._rng.random() < 0.5:
            self._damage(folder)
            self._compare(output)
        shutil.rmtree(folder)

    def _signal(self) -> signal.Signals:
        kinds = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM)
        return kinds[int(self._rng.choice(3, p=(0.8, 0.1, 0.1)))]

    def _damage(self, folder: Path) -> None:
        """Damage a file, resume to the end, and see that it was repaired or refused."""
        output, aside = folder / self._target.output, folder / "aside"
        shutil.copytree(output, aside, symlinks=True)
        how = str(corrupt(output, int(self._rng.integers(2**31))))
        self.tally.counts["damaged"] += 1
        ended = run(self._target, folder, None, signal.SIGKILL)
        self._judge(ended, folder, how)
        if ended.status == 0:
            self.tally.counts["repaired or harmless"] += 1
            self._compare(output, how)
            shutil.rmtree(aside)
            return
        self.tally.counts["refused"] += 1
        if not ended.told.strip():
            self.tally.fault(f"refused without a word after {how}")
        shutil.rmtree(output)
        aside.rename(output)

    def _judge(self, ended: Ended, folder: Path, how: str = "a kill") -> None:
        fault, told = self.tally.fault, ended.told
        if "Traceback" in told or "internal error" in told:
            fault(f"traceback after {how}: {told[-2000:]}")
        if ended.sent is None and ended.status not in (0, 1, 2):
            fault(f"status {ended.status} after {how}: {told[-2000:]}")
        if ended.sent is None and ended.status != 0 and how == "a kill":
            fault(f"does not resume after {how}: {told[-2000:]}")
        if ended.sent in STATUSES and ended.status not in (STATUSES[ended.sent], -ended.sent):
            fault(f"status {ended.status} after {ended.sent.name}: {told[-2000:]}")
        if (folder / "mine.txt").read_text(encoding="utf-8") != "the user's own":
            fault(f"a file of the user was changed after {how}")

    def _compare(self, output: Path, how: str = "kills") -> None:
        found = self._target.fingerprint(output)
        if found == self._expected:
            self.tally.counts["equal"] += 1
            return
        names = sorted(
            name
            for name in found.keys() | self._expected.keys()
            if found.get(name) != self._expected.get(name)
        )
        self.tally.fault(f"differs in {names[:5]} after {how}")


COLUMNS = (
    *("trials", "kills", "interruptions", "damaged"),
    *("repaired or harmless", "refused", "equal"),
)


def table(tallies: dict[str, Tally]) -> list[str]:
    """Markdown, one row a target."""
    lines = [
        "| command | " + " | ".join(COLUMNS) + " | faults |",
        "|---" * (len(COLUMNS) + 2) + "|",
    ]
    for name, tally in tallies.items():
        counts = " | ".join(str(tally.counts[column]) for column in COLUMNS)
        lines.append(f"| {name} | {counts} | {len(tally.faults)} |")
    return lines


def main(tokens: Sequence[str] | None = None) -> int:
    """Run the campaign and print its table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=200, help="SIGKILLs, shared by the targets")
    parser.add_argument("--seed", type=int, default=1)
    names = [target.name for target in TARGETS]
    parser.add_argument("--only", nargs="+", choices=names, default=names)
    asked = parser.parse_args(tokens)
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        # As in a shell's background job: the commands would ignore Ctrl-C as well.
        signal.signal(signal.SIGINT, signal.default_int_handler)
    share = -(-asked.kills // len(asked.only))
    tallies: dict[str, Tally] = {}
    for number, target in enumerate(TARGETS):
        if target.name not in asked.only:
            continue
        with tempfile.TemporaryDirectory() as work:
            rng = np.random.default_rng([asked.seed, number])
            tallies[target.name] = Campaign(target, Path(work), rng).until(share)
        print("\n".join(table({target.name: tallies[target.name]})[2:]), flush=True)
    print("\n".join(table(tallies)))
    for name, tally in tallies.items():
        for fault in tally.faults:
            print(f"{name}: {fault}")
    return int(any(tally.faults for tally in tallies.values()))


if __name__ == "__main__":
    sys.exit(main())
