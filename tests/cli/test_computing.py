"""What commands do around their computing: imports that are kept away, and how they end."""

import gc
import subprocess
import sys
import types

import pytest

from jaxsat.cli.computing import dask_unseen, interruptibly

LABELS_AN_ARRAY = """
import sys
from jaxsat.cli.computing import dask_unseen
with dask_unseen():
    import xarray
    assert xarray.DataArray([1.0, 2.0], dims="time").sum() == 3
print(sorted(name for name in sys.modules if name.split(".")[0] == "dask"))
"""


@pytest.fixture
def neither(monkeypatch):
    """As in a process that has imported neither dask nor xarray."""
    for name in ("dask", "xarray"):
        monkeypatch.delitem(sys.modules, name, raising=False)


@pytest.mark.usefixtures("neither")
def test_dask_cannot_be_imported_while_it_is_unseen():
    with dask_unseen(), pytest.raises(ImportError):
        import dask  # noqa: F401
    assert "dask" not in sys.modules


@pytest.mark.usefixtures("neither")
def test_dask_is_seen_again_after_an_error():
    with pytest.raises(ZeroDivisionError), dask_unseen():
        raise ZeroDivisionError
    assert "dask" not in sys.modules


@pytest.mark.usefixtures("neither")
@pytest.mark.parametrize("name", ["dask", "xarray"])
def test_dask_stays_where_a_user_has_imported_it_or_xarray(name, monkeypatch):
    monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    with dask_unseen():
        assert sys.modules.get("dask", "not hidden") is not None
    assert name in sys.modules


def test_xarray_labels_an_array_without_dask():
    pytest.importorskip("dask")
    command = [sys.executable, "-c", LABELS_AN_ARRAY]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_only_long_work_searches_for_dead_cycles(monkeypatch):
    """A single run ends before the search gains anything."""
    monkeypatch.setattr(gc, "freeze", lambda: None)
    gc.disable()
    try:
        assert not interruptibly(gc.isenabled, brief=True)
        assert interruptibly(gc.isenabled)
    finally:
        gc.enable()


ENDS = """
import atexit, gc, sys
atexit.register(lambda: print(gc.get_freeze_count() > 0))
sys.argv = ["jaxsat", "completion", "--help"]
from jaxsat.cli import main
main()
"""


def test_a_command_that_ends_does_not_search_its_objects_again():
    done = subprocess.run([sys.executable, "-c", ENDS], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "True"
