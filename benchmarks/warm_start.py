"""How long a study of a scenario seen before takes from the command line, all included.

    python benchmarks/warm_start.py [--scenario benchmark-three-axis] [--cases 1000] [--rounds 5]

Wall and processor time of whole processes, the least of several interleaved rounds: first with an
empty cache, then with a full one, with machine code alone kept (JAXSAT_KEPT_KERNELS=0), and, to
compare machines and hours by, `import jax`.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

BASE = "import jax"


def measured(command: list[str], flags: dict[str, str]) -> tuple[float, float]:
    """Wall and processor seconds of a process that finds its byte code, as after `pip install`."""
    kept = {name: text for name, text in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    before, begin = os.times(), time.perf_counter()
    subprocess.run(command, env=kept | flags, check=True, stdout=subprocess.DEVNULL)
    wall, after = time.perf_counter() - begin, os.times()
    used = after.children_user - before.children_user
    return wall, used + after.children_system - before.children_system


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenario", default="benchmark-three-axis")
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        cache, number = {"JAXSAT_CACHE_DIR": f"{folder}/cache"}, 0

        def study(kept: str) -> tuple[float, float]:
            nonlocal number
            number += 1
            command = [sys.executable, "-m", "jaxsat", "montecarlo", options.scenario]
            command += ["-n", str(options.cases), "--out", str(Path(folder) / f"{number}.zarr")]
            return measured([*command, "--quiet"], cache | {"JAXSAT_KEPT_KERNELS": kept})

        def imported() -> tuple[float, float]:
            return measured([sys.executable, "-c", BASE], {})

        imported()
        found = {"empty cache": [study("1")]}
        turns = {
            "machine code kept": lambda: study("0"),
            "kernel kept": lambda: study("1"),
            BASE: imported,
        }
        for _ in range(options.rounds):
            for name, turn in turns.items():
                found.setdefault(name, []).append(turn())
    least = {
        name: [min(times) for times in zip(*rows, strict=True)] for name, rows in found.items()
    }
    print(f"{options.cases} cases of {options.scenario}, whole processes")
    print(f"{'':20} wall s  processor s  wall, in parts of `{BASE}`")
    for name, (wall, used) in least.items():
        print(f"{name:20} {wall:6.2f} {used:12.2f} {wall / least[BASE][0]:10.2f}")


if __name__ == "__main__":
    main()
