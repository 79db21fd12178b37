"""Machine code on disk: found again, whole or not at all, and linked wherever it comes to lie."""

import mmap

import numpy as np
import pytest

from jaxsat.engine.native import Mapped, cache, target


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("JAXSAT_CACHE_DIR", str(tmp_path))
    return tmp_path / "native"


def made(number: float) -> Mapped:
    return Mapped(lambda case, shared: number * case + shared, 0.0, 0.0)


def test_code_is_kept_and_found_again(folder, monkeypatch):
    code = cache.object_code(made(2.0).text)
    assert len(list(folder.glob("*.o"))) == 1
    monkeypatch.setattr(target, "object_code", lambda text: pytest.fail("made again"))
    assert cache.object_code(made(2.0).text) == code


def test_constants_tell_programs_apart(folder):
    for number in (2.0, 3.0):
        cache.object_code(made(number).text)
    assert len(list(folder.glob("*.o"))) == 2


def test_a_damaged_entry_is_made_again(folder):
    code = cache.object_code(made(2.0).text)
    (entry,) = folder.glob("*.o")
    entry.write_bytes(entry.read_bytes()[:-7])
    assert cache.object_code(made(2.0).text) == code
    assert len(list(folder.iterdir())) == 1


def test_libraries_may_lie_far_apart():
    mapped = made(2.0)
    code, between = target.object_code(mapped.text), []
    for _ in range(30):
        keep, addresses = target.loaded(code, ["run"])
        assert keep is not None
        assert addresses["run"]
        between.append(mmap.mmap(-1, 200 << 20))
    np.testing.assert_array_equal(mapped(np.arange(3.0), 1.0), [1.0, 3.0, 5.0])
