"""Random and absurd command lines: no traceback, no hang, no status that is not documented."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")
def test_no_command_line_ends_in_a_traceback():
    path = os.pathsep.join([str(HERE), str(HERE.parents[1])])
    # threads of BLAS that live when a process forks can leave a lock in the child for ever
    alone = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, str(HERE / "fuzzing.py"), "30", "1"],
        env={**os.environ, **alone, "PYTHONPATH": path},
        capture_output=True, timeout=1200, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout.decode() + done.stderr.decode()
