"""Signals that a detailed program keeps while it runs are those computed from its states."""

import dataclasses

import jax
import numpy as np
import pytest

from jaxsat.simulation.engine.fixed import NOISE_BLOCK, SampledStepper
from jaxsat.simulation.engine.native import NativeEngine, kernel
from jaxsat.simulation.engine.program import program_of
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.simulation.trajectory import Outcome
from simulation.engine.examples import estimated_example, sampled_example

KICKS = np.array([[0.0, 0.0, 0.0], [0.02, 0.01, -0.02]])
LIMIT = np.hypot(1.0, 0.168)
"""Of a unit quaternion and a rate (rad/s): the second case passes it after some seconds."""


def observed(engine, example, seconds, every):
    """Outputs and signals, of a program that is not detailed and of one that is."""
    cases = example().case_factory
    plain = dataclasses.replace(program_of(cases, cases.loop, seconds), state_limit=LIMIT)
    instants = plain.instants(every)
    detailed = dataclasses.replace(plain, detailed=True)
    return [engine.observed(one, KICKS, None, instants) for one in (plain, detailed)]


def check(plain, detailed):
    outcomes = [Outcome.SUCCESS, Outcome.STATE_LIMIT]
    assert plain[0].code.tolist() == detailed[0].code.tolist() == outcomes
    np.testing.assert_array_equal(plain[0].ended_at, detailed[0].ended_at)
    np.testing.assert_allclose(plain[0].omega, detailed[0].omega, rtol=0, atol=1e-13)
    leaves = [jax.tree_util.tree_leaves_with_path(signals) for _, signals in (plain, detailed)]
    assert len(leaves[0]) == len(leaves[1]) > 10
    for (path, expected), (_, found) in zip(*leaves, strict=True):
        where = jax.tree_util.keystr(path)
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-11, err_msg=where)
    ended = np.isnan(detailed[1].omega[1]).all(axis=1)
    assert not ended[:3].any()
    assert ended[-1]


@pytest.mark.slow
@pytest.mark.parametrize(("example", "every"), [(sampled_example, 7), (estimated_example, 1)])
def test_machine_code_keeps_the_signals(example, every, monkeypatch):
    monkeypatch.setattr(kernel, "WATCHED", 50)  # of which the histories have several
    check(*observed(NativeEngine(SampledStepper(), simd_lanes=1), example, 20.0, every))


@pytest.mark.slow
def test_scans_keep_the_signals_of_noise_drawn_in_blocks():
    check(*observed(ScanEngine(SampledStepper(), 2), sampled_example, 9.6, NOISE_BLOCK))
