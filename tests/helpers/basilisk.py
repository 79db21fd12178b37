"""Runs of Basilisk in a process of its own, by the programs of `tests/oracle`."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

ORACLE = Path(__file__).parents[1] / "oracle"


def basilisk(program: str, name: str, given: Any) -> Any:
    """What the function `name` of a program of `tests/oracle` returns for some plain data."""
    process = subprocess.run(
        [sys.executable, "-W", "ignore", ORACLE / program, name],
        input=json.dumps(given),
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert process.returncode == 0, process.stderr
    return json.loads(process.stdout.partition("FOUND")[2].splitlines()[0])
