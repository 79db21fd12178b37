"""How many processors there are to use."""

import os
import subprocess
import sys
import threading

import pytest

from jaxsat.core import process as counting
from jaxsat.core.process import all_processors, processors, share_of


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="processes cannot be bound here")
def test_a_process_bound_to_one_processor_has_one():
    program = "import os; os.sched_setaffinity(0, [min(os.sched_getaffinity(0))]); "
    program += "from jaxsat.core.process import processors; print(processors())"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout == "1\n"


@pytest.mark.parametrize(
    ("told", "count"),
    [
        ("max 100000\n", 8),
        ("250000 100000\n", 3),
        ("20000 100000\n", 1),
        ("6400000 100000\n", 8),
        ("nonsense", 8),
        (None, 8),
    ],
)
def test_the_quota_of_a_container_counts(tmp_path, monkeypatch, told, count):
    if told is not None:
        (tmp_path / "cpu.max").write_text(told)
    monkeypatch.setattr(counting, "QUOTA", tmp_path / "cpu.max")
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(8)), raising=False)
    assert all_processors() == count


def test_a_share_is_for_what_is_called_inside():
    whole = all_processors()
    with share_of(5):
        assert processors() == 5
        with share_of(2):
            assert processors() == 2
        assert processors() == 5
        assert all_processors() == whole
        seen = []
        other = threading.Thread(target=lambda: seen.append(processors()))
        other.start()
        other.join()
        assert seen == [whole]
    assert processors() == whole
    with pytest.raises(ValueError, match="`count` must be at least 1, but got 0"), share_of(0):
        pass
