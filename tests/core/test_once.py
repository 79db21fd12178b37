"""Twenty threads that want one thing that is not there yet: it is made once."""

import copy
import itertools
import pickle
import subprocess
import sys
import threading
import time

import equinox as eqx
import numpy as np
import pytest

from helpers.threads import COUNT, at_once, one
from jaxsat.core.once import Locks, _locks, latest, once, once_property

MADE = []


def slowly(*what):
    """Something new, made so slowly that all the others come meanwhile."""
    MADE.append(what)
    time.sleep(0.02)
    return object()


@pytest.fixture(autouse=True)
def made():
    MADE.clear()
    return MADE


class Plain:
    @once_property
    def value(self):
        """What there is."""
        return slowly(id(self))


class Frozen(eqx.Module):
    numbers: np.ndarray

    @once_property
    def value(self):
        return slowly(id(self))


def test_a_function_is_called_once_for_each_argument(made):
    function, numbers = once(slowly), itertools.count()
    found = at_once(lambda: function(next(numbers) % 2))
    assert sorted(made) == [(0,), (1,)]
    assert len(set(found)) == 2
    function.cache_clear()
    assert one(at_once(lambda: function(0))) not in found


def test_of_the_latest_alone_there_is_memory(made):
    function = latest(2)(slowly)
    found = [one(at_once(lambda n=n: function(n))) for n in (0, 1, 2, 1, 0)]
    assert made == [(0,), (1,), (2,), (0,)]
    assert found[1] is found[3]


def test_a_function_may_call_itself_and_fail(made):
    @once
    def lower(n):
        slowly(n)
        if n == 3:
            raise ValueError(n)
        return lower(n - 1) if n else []

    one(at_once(lambda: lower(2)))
    assert sorted(made) == [(0,), (1,), (2,)]
    for _ in range(2):
        with pytest.raises(ValueError, match="3"):
            lower(3)
    assert made.count((3,)) == 2


@pytest.mark.parametrize("make", [Plain, lambda: Frozen(np.zeros(3))])
def test_a_property_is_made_once_for_each_object(make, made):
    for _ in range(3):
        thing = make()
        assert one(at_once(lambda thing=thing: thing.value)) is thing.value
        assert made.count((id(thing),)) == 1
        made.clear()
    assert not _locks._known
    assert Plain.value.__doc__ == "What there is."


@pytest.mark.parametrize("make", [Plain, lambda: Frozen(np.zeros(3))])
def test_an_object_with_such_a_property_is_copied_and_pickled(make, made):
    thing = make()
    for other in (copy.deepcopy(thing), pickle.loads(pickle.dumps(thing))):
        assert other.value is not thing.value
    for other in (copy.copy(thing), copy.deepcopy(thing), pickle.loads(pickle.dumps(thing))):
        assert vars(other).keys() == vars(thing).keys()
        made.clear()
        assert other.value is other.value
        assert not made


def test_different_keys_do_not_wait_for_one_another():
    locks, numbers, together = Locks(), itertools.count(), threading.Barrier(COUNT)

    def hold():
        with locks(key := next(numbers)), locks(key):
            together.wait(60)  # each holds its own
        assert key not in locks._known

    at_once(hold)


def test_of_one_key_one_holds_the_lock():
    locks, inside, most = Locks(), [], []

    def hold():
        with locks("key"):
            inside.append(None)
            most.append(len(inside))
            time.sleep(1e-3)
            inside.pop()

    at_once(hold)
    assert most == [1] * COUNT
    assert not locks._known


def told(program):
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)


@pytest.mark.slow
def test_names_for_users_may_be_wanted_by_threads_at_once():
    """Each comes in by another module of a package whose modules import one another."""
    program = """
import threading, jaxsat
barrier, failed = threading.Barrier(20), []
def want(name):
    barrier.wait()
    try:
        getattr(jaxsat, name)
    except Exception as error:
        failed.append((name, error))
names = [name for name in dir(jaxsat) if name != "__version__"][20:40]
threads = [threading.Thread(target=want, args=[name]) for name in names]
for thread in threads: thread.start()
for thread in threads: thread.join()
assert len(names) == 20 and not failed, failed
"""
    done = told(program)
    assert done.returncode == 0, done.stderr


def test_a_python_without_its_lock_is_refused():
    done = told("import sys; sys._is_gil_enabled = lambda: False; import jaxsat")
    assert done.returncode == 1
    assert "ImportError: jaxsat must have a Python with its global interpreter lock" in done.stderr
