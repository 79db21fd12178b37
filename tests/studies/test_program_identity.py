"""A store belongs to the program that made it."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import pytest

from jaxsat.control.controller import Coast
from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.store import store
from jaxsat.store.files import OutputError
from jaxsat.studies.ensemble import Study
from jaxsat.studies.executors import AbstractExecutor
from jaxsat.studies.run import _ChunkWork, run_study
from studies.studies import tumbling

LAW = """
class Damping(Coast):
    gain: object

    def __call__(self, t, state, memory):
        torque = -self.gain * state.omega[:2]
        return torque, memory
"""

REWRITTEN = '''
# The law of the first draft, tidied.
class RateDamping(Coast):
    """Damps."""

    gain: object

    def __call__(self, time, plant, nothing):
        damping = -self.gain  # N m s
        return damping * plant.omega[:2], nothing
'''

FLIPPED = LAW.replace("-self", "self")
DOUBLED = LAW.replace("-self", "-2.0 * self")

SCAN = ScanEngine(FixedStepper(substeps=2), batch_size=8)
ENGINES = [
    SCAN,
    pytest.param(NativeEngine(FixedStepper(substeps=2), batch_size=8), marks=pytest.mark.slow),
    pytest.param(ReferenceEngine(batch_size=8), marks=pytest.mark.slow),
]


class Nobody(AbstractExecutor):
    """Computes nothing, so nothing need be compiled to see whether a store is refused."""

    def run(self, work, chunks):
        return iter(())


NOBODY = {"executor": Nobody()}


def law(source, gain=30.0):
    """A law as a module of the user's would define it."""
    names = {"Coast": Coast, "jnp": jnp, "__name__": "mine"}
    exec(source, names)
    (made,) = (one for one in names.values() if isinstance(one, type) and one is not Coast)
    return made(jnp.asarray(gain))


def study_of(source, engine=SCAN, gain=30.0, **options):
    study = tumbling(count=8, **options)
    program = eqx.tree_at(
        lambda program: program.case_factory.loop.controller,
        study.program,
        law(source, gain),
        is_leaf=lambda x: isinstance(x, Coast),
    )
    return dataclasses.replace(study, program=program, engine=engine)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_another_law_is_refused_and_a_comment_or_another_name_is_not(tmp_path, engine):
    run_study(study_of(LAW, engine), tmp_path / "s", **NOBODY)
    run_study(study_of(REWRITTEN, engine), tmp_path / "s", **NOBODY)
    flipped = study_of(FLIPPED, engine)
    for elsewhere in (False, True):
        with pytest.raises(OutputError, match=r"another study \(the program differs, as after"):
            run_study(flipped, tmp_path / "s", elsewhere=elsewhere, **NOBODY)
    with pytest.raises(OutputError, match=r"\(program\.numbers\.\d+: 30\.0 there, 31\.0 here\)"):
        run_study(study_of(LAW, engine, 31.0), tmp_path / "s", **NOBODY)


@pytest.mark.slow
def test_the_program_is_the_same_for_other_numbers_chunks_and_counts():
    first = study_of(LAW).program_identity()
    assert study_of(LAW, gain=31.0).program_identity()["operations"] == first["operations"]
    assert study_of(LAW, seed=5).program_identity()["operations"] == first["operations"]
    larger = dataclasses.replace(study_of(LAW, chunk=3), count=30)
    assert larger.program_identity() == first
    for source in (FLIPPED, DOUBLED):
        assert study_of(source).program_identity()["operations"] != first["operations"]


@pytest.mark.slow
def test_other_versions_are_told_as_a_reason(tmp_path, monkeypatch):
    run_study(study_of(LAW), tmp_path / "s", **NOBODY)
    here = store.machine()
    here["versions"] = {**here["versions"], "jax": "9.9"}
    monkeypatch.setattr(store, "machine", lambda: here)
    with pytest.raises(
        OutputError, match=r"the program differs, .*; versions\.jax: .* \"9\.9\" he"
    ):
        run_study(study_of(FLIPPED), tmp_path / "s", **NOBODY)


@pytest.mark.slow
def test_a_worker_with_another_program_computes_nothing(monkeypatch):
    """As one whose plug-in is of another version."""
    program = study_of(LAW).program_identity()
    monkeypatch.setattr(Study, "values", lambda *_: {})
    assert _ChunkWork(study_of(REWRITTEN), 8, 8, None, program)(0) == {}
    with pytest.raises(OutputError, match=r"computes another study \(the program differs"):
        _ChunkWork(study_of(FLIPPED), 8, 8, None, program)(0)


def test_a_number_that_is_not_one_is_the_same_again(tmp_path):
    study = dataclasses.replace(study_of(LAW), description={"unused": float("nan")})
    for _ in range(2):
        run_study(study, tmp_path / "s", **NOBODY)
