"""Twenty threads that want machine code that is not there yet: it is made once, and stays."""

import gc
import itertools
import time
import warnings
import weakref

import jax.numpy as jnp
import numpy as np
import pytest

from helpers.threads import COUNT, at_once, made_once, one
from jaxsat.compiler import Mapped
from jaxsat.compiler.llvm import cache, target
from jaxsat.compiler.llvm.drivers import RUN
from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.native import NativeEngine, engine
from simulation.engine.examples import KICKS, continuous_example, program, same_bits

LINKERS = []
"""Those in which other tests may have code."""

X, HOST = np.linspace(0.0, 1.0, 37), target.host()


def sines(x, factor):
    return jnp.sin(x) * factor


def forget_llvm():
    LINKERS.append(target._jit())
    for made in (target.host, target._machine, target._jit):
        made.cache_clear()


@pytest.mark.parametrize(
    ("made", "given"), [(target.host, []), (target._machine, [HOST]), (target._jit, [])]
)
def test_threads_share_one_processor_and_one_linker(made, given):
    for _ in range(3):
        forget_llvm()
        made_once(lambda: made(*given), made)


def test_a_function_is_compiled_once_by_the_threads_that_call_it_first():
    expected = Mapped(sines, 0.0, 0.0).interpreted(X, 3.0)
    for _ in range(3):
        forget_llvm()
        mapped = Mapped(sines, 0.0, 0.0)
        found = at_once(lambda mapped=mapped: (mapped._run, mapped(X, 3.0), mapped._module))
        one([run for run, _, _ in found])
        one([module for _, _, module in found])
        for _, values, _ in found:
            np.testing.assert_allclose(values, expected, rtol=1e-15)


@pytest.mark.slow
def test_code_stays_while_one_of_its_functions_does():
    code = target.object_code(Mapped(sines, 0.0, 0.0).text)
    found = target.loaded(code, {"run": RUN, "one": RUN})
    library = weakref.ref(found["run"].library)
    run = found.pop("one")
    del found
    gc.collect()
    assert library() is not None
    del run
    gc.collect()
    assert library() is None


@pytest.mark.slow
def test_a_kernel_is_made_once_by_the_threads_that_run_it_first(monkeypatch):
    made = NativeEngine(FixedStepper(substeps=1), simd_lanes=1)
    prog, lowered, loaded, found = program(continuous_example(), 1.0), [], [], []
    load = target.loaded
    whole = made.kernel(prog, KICKS).trajectory

    def lowers(*of):
        lowered.append(of)
        time.sleep(0.02)
        return whole

    monkeypatch.setattr(engine, "lower_trajectory", lowers)
    monkeypatch.setattr(target, "loaded", lambda *of: loaded.append(of) or load(*of))
    for _ in range(3):
        monkeypatch.setattr(engine, "_kernels", {})
        lowered.clear()
        loaded.clear()
        found += at_once(lambda: made.observed(prog, KICKS, None, np.array([0, prog.intervals])))
        assert len(engine._kernels) == len(lowered) == 1
        assert len(loaded) == 2  # the kernel, and what a replay needs
    for other in found[1:]:
        same_bits(other, found[0])


def test_threads_share_one_key_and_one_warning(tmp_path, monkeypatch):
    numbers = itertools.count()
    for turn in range(3):
        monkeypatch.setenv("JAXSAT_CACHE_DIR", str(tmp_path / str(turn)))
        at_once(lambda: cache.keep(f"{next(numbers)}.o", b"code"))
    assert [cache.content_of(f"{number}.o") for number in range(2 * COUNT, 3 * COUNT)] == [
        b"code"
    ] * COUNT
    monkeypatch.setenv("JAXSAT_CACHE_DIR", "nowhere")
    monkeypatch.setattr(cache, "_told", cache.threading.Event())
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        at_once(lambda: cache.content_of("0.o"))
    assert len(told) == 1
