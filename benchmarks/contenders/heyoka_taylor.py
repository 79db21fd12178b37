"""heyoka.py, where it is installed: Taylor's method in machine code, eight cases in the lanes.

As its guide recommends for many trajectories: a batch integrator, whose cases differ in their
parameters, so that it is compiled once. Measured choices: `fast_math` (1.15 times as fast), no
`compact_mode` (3 times), and an integrator for every thread that is set to the next cases, as
`ensemble_propagate_until_batch` copies one for every eight cases (0.6 times).
"""

import copy
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from contenders.contender import TOLERANCES, Contender, Run
from contenders.work import (
    GAINS,
    J1,
    J2,
    SIZE,
    WIDTH2,
    A,
    final_state,
    is_smooth,
    reference,
    starts,
)
from jaxsat.core.process import processors
from jaxsat.studies.ensemble import Study

INSIDE, OFFSET = (6, 7), (8, 9)
"""Parameters of the law in pieces: sat is `inside` times its argument plus `offset`."""


class Equations(NamedTuple):
    """The right-hand side, state by state, and what sat bounds."""

    system: list[tuple[Any, Any]]
    steering: tuple[Any, Any]


def smooth(x, number: int, a: Any = A) -> tuple[Any, Any]:
    """a tanh(x / a) and its slope."""
    import heyoka as hy

    del number
    bounded = hy.tanh(x / a)
    return a * bounded, 1 - bounded * bounded


def selected(x, number: int) -> tuple[Any, Any]:
    """sat(x) and its slope, chosen at every evaluation."""
    import heyoka as hy

    del number
    bounded = hy.select(hy.gt(x, A), A, hy.select(hy.lt(x, -A), -A, x))
    return bounded, hy.select(hy.logical_and([hy.lt(x, A), hy.gt(x, -A)]), 1.0, 0.0)


def in_pieces(x, number: int) -> tuple[Any, Any]:
    """sat(x) and its slope on the side of its corners that parameters tell."""
    import heyoka as hy

    inside, offset = hy.par[INSIDE[number]], hy.par[OFFSET[number]]
    return inside * x + offset, inside


def equations(saturated, gains: Sequence[Any] = GAINS) -> Equations:
    """`work.rate` in heyoka's expressions; parameters are amplitude, frequency and phase.

    `gains` are k3, mu, a (that of `saturated`) and k4.
    """
    import heyoka as hy

    k3, mu, _, k4 = gains
    w1, w2, z, e1, e2, p1, p2, v1, v2, cost = hy.make_vars(
        "w1", "w2", "z", "e1", "e2", "p1", "p2", "v1", "v2", "cost"
    )
    amplitude, frequency, phase = ([hy.par[i], hy.par[i + 1]] for i in (0, 2, 4))
    square = w1 * w1 + w2 * w2
    below, whole = square + WIDTH2, 1 + square
    q = z / below
    steering = q * w2, -q * w1
    (bounded1, inside1), (bounded2, inside2) = map(saturated, steering, (0, 1))
    r1 = -k3 * w1 / whole + mu * bounded1 + e1
    r2 = -k3 * w2 / whole + mu * bounded2 + e2
    dw1 = (1 + w1 * w1 - w2 * w2) * r1 / 2 + w1 * w2 * r2
    dw2 = (1 - w1 * w1 + w2 * w2) * r2 / 2 + w1 * w2 * r1
    dz = w1 * r2 - w2 * r1
    dsquare = 2 * (w1 * dw1 + w2 * dw2)
    dq = (dz - q * dsquare) / below
    slope1 = -k3 * (dw1 - w1 * dsquare / whole) / whole + mu * inside1 * (dq * w2 + q * dw2)
    slope2 = -k3 * (dw2 - w2 * dsquare / whole) / whole - mu * inside2 * (dq * w1 + q * dw1)
    f1 = -w1 * whole + w2 * z - k4 * e1 - k4 * v1
    f2 = -w2 * whole - w1 * z - k4 * e2 - k4 * v2
    d1, d2 = (amplitude[i] * hy.sin(frequency[i] * hy.time + phase[i]) for i in range(2))
    u1, u2 = f1 + J1 * slope1, f2 + J2 * slope2
    system = [
        (w1, dw1),
        (w2, dw2),
        (z, dz),
        (e1, (f1 + d1) / J1),
        (e2, (f2 + d2) / J2),
        (p1, v1),
        (p2, v2),
        (v1, e1 - frequency[0] ** 2 * p1),
        (v2, e2 - frequency[1] ** 2 * p2),
        (cost, square + z * z + 100 * (r1 * r1 + r2 * r2) + 1e-3 * (u1 * u1 + u2 * u2)),
    ]
    return Equations(system, steering)


def steering_of(y: np.ndarray) -> np.ndarray:
    """What sat bounds (2, ...) in states (10, ...)."""
    return y[2] / (y[0] ** 2 + y[1] ** 2 + WIDTH2) * np.stack([y[1], -y[0]])


def pieces(steering: np.ndarray, beyond: np.ndarray) -> np.ndarray:
    """Parameters of sat on the side of its corners that `beyond` tells (4, ...)."""
    inside = np.where(beyond, 0.0, 1.0)
    return np.concatenate([inside, np.where(beyond, np.copysign(A, steering), 0.0)])


class Switch:
    """Changes the piece of one sat where its argument passes a corner."""

    def __init__(self, number: int):
        self.number = number

    def __call__(self, integrator, sign: int, lane: int) -> bool:
        x = steering_of(integrator.state[:3, lane])[self.number]
        integrator.pars[INSIDE[self.number], lane] = float(sign < 0)
        integrator.pars[OFFSET[self.number], lane] = np.copysign(A, x) if sign > 0 else 0.0
        return True


def prepared(saturated, *, events: bool = False):
    """How the law with this sat is prepared; with terminal `events` at its corners or without."""

    def prepare(study: Study, count: int, tolerance: float) -> Run:
        import heyoka as hy

        lanes = hy.recommended_simd_size()
        found = equations(saturated)
        options: dict[str, Any] = {"tol": tolerance, "fast_math": True, "compact_mode": False}
        if events:
            options["t_events"] = [
                hy.t_event_batch(x**2 - A**2, callback=Switch(number))
                for number, x in enumerate(found.steering)
            ]
        y, parameters = inputs(study, count)
        if events:
            steering = steering_of(y.T)
            parameters = np.hstack([parameters, pieces(steering, np.abs(steering) > A).T])
        integrator = hy.taylor_adaptive_batch(
            found.system,
            np.zeros((SIZE, lanes)),
            pars=np.zeros((parameters.shape[1], lanes)),
            **options,
        )
        ends = all_ends(integrator, y, parameters, float(study.program.duration))
        return lambda: final_state(ends(), is_smooth(study))

    return prepare


def variational(study: Study, count: int, tolerance: float) -> Run:
    """Derivatives (cases, 4) of the smooth law's cost by k3, mu, a and k4."""
    import heyoka as hy

    lanes, gains = hy.recommended_simd_size(), [hy.par[6 + i] for i in range(4)]
    found = equations(lambda x, number: smooth(x, number, gains[2]), gains)
    system = hy.var_ode_sys(found.system, args=gains, order=1)
    integrator = hy.taylor_adaptive_batch(
        system,
        np.zeros((5 * SIZE, lanes)),
        pars=np.zeros((10, lanes)),
        tol=tolerance,
        fast_math=True,
        compact_mode=False,
    )
    y, parameters = inputs(study, count)
    parameters = np.hstack([parameters, np.tile(GAINS, (count, 1))])
    # the rates where a case starts are given, so its rate errors move with the reference
    slopes = np.zeros((count, SIZE, 4))
    slopes[:, 3:5] = -np.asarray(jax.vmap(jax.jacfwd(reference, 1), (0, None))(y, jnp.array(GAINS)))
    begin = np.hstack([y, slopes.reshape(count, -1)])
    ends = all_ends(integrator, begin, parameters, float(study.program.duration))
    return lambda: ends()[:, -4:]


def all_ends(integrator, y: np.ndarray, parameters: np.ndarray, duration: float):
    """A function that integrates from all states `y` and gives those after `duration` (s)."""
    count, lanes = len(y), integrator.state.shape[1]
    blocks = -(-count // lanes)
    rows = np.minimum(np.arange(blocks * lanes), count - 1).reshape(blocks, lanes)
    workers = min(processors(), blocks)
    own = [integrator, *(copy.deepcopy(integrator) for _ in range(workers - 1))]

    def share(worker: int) -> list[np.ndarray]:
        return [end(own[worker], block) for block in range(worker, blocks, workers)]

    def end(integrator, block: int) -> np.ndarray:
        integrator.set_time(0.0)
        if integrator.with_events:
            integrator.reset_cooldowns()
        integrator.state[:] = y[rows[block]].T
        integrator.pars[:] = parameters[rows[block]].T
        integrator.propagate_until(duration)
        return integrator.state.T.copy()

    def run() -> np.ndarray:
        ends = np.empty((blocks, lanes, y.shape[1]))
        with ThreadPoolExecutor(workers) as pool:
            for worker, found in enumerate(pool.map(share, range(workers))):
                ends[worker::workers] = found
        return ends.reshape(-1, y.shape[1])[:count]

    return run


def inputs(study: Study, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Start (cases, 10), and amplitude, frequency and phase of d1 and d2 (cases, 6)."""
    y, *torque = starts(study, count)
    return np.asarray(y), np.concatenate([np.asarray(entry)[:, :2] for entry in torque], axis=1)


def contenders() -> list[Contender]:
    """Both laws, the sharp one in two ways."""
    return [
        Contender("heyoka, tanh", TOLERANCES, prepared(smooth), laws=("smooth",)),
        Contender("heyoka, select", TOLERANCES, prepared(selected), laws=("sharp",)),
        Contender("heyoka, events", TOLERANCES, prepared(in_pieces, events=True), laws=("sharp",)),
    ]
