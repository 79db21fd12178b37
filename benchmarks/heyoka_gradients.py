"""Gradients of the cost by four gains, beside heyoka's variational equations, at equal accuracy.

    python benchmarks/heyoka_gradients.py                                      # ten minutes
    python benchmarks/heyoka_gradients.py --within 1e-8
    python benchmarks/heyoka_gradients.py --cases 8 --truth 2 --duration 5     # to try it

The work is the smooth law of `engines.py`: what k3, mu, a and k4 change of every case's cost, its
start being given in rates. The native engine pushes its steps forward along all gains; heyoka
integrates variational equations (`var_ode_sys`). Of both the loosest tolerance takes part for which
the gradients of 95 % of the cases are within 1e-6, or what `--within` tells, of those by SciPy's
DOP853 and the variational equations in JAX. The reference is held against central differences once.
"""

import argparse
import sys
from pathlib import Path

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

sys.path.insert(0, str(Path(__file__).parent))

from contenders.contender import TOLERANCES, Contender, Run
from contenders.heyoka_taylor import variational
from contenders.work import GAINS, SIZE, rate, reference, starts
from engines import PERCENT, made_study, paces
from jaxsat.simulation.engine.adaptive import AdaptiveStepper, Tolerance
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.program import AbstractCaseFactory, Case
from jaxsat.studies.ensemble import Study

NAMES = ("k3", "mu", "a", "k4")
DIFFERENCE = 1e-4
"""Of a gain, in central differences."""


class WithGains(AbstractCaseFactory):
    """The cases of a study with gains of their own, starts unchanged."""

    study: AbstractCaseFactory

    def __call__(self, case, gains) -> Case:
        """The case with `gains` (4,) in its law."""
        made = self.study(case, None)
        where = [lambda case, name=name: getattr(case.loop.law, name) for name in NAMES]
        for find, gain in zip(where, gains, strict=True):
            made = eqx.tree_at(find, made, gain)
        return made


def native(study: Study, count: int, tolerance: float) -> Run:
    """Forward mode through the steps, all gains at once."""
    engine = NativeEngine(AdaptiveStepper(diffrax.Dopri8(), Tolerance(tolerance, tolerance)))
    cases, factory = study.cases(np.arange(count)), WithGains(study.case_factory)
    program = eqx.tree_at(lambda program: program.case_factory, study.program, factory)
    return lambda: engine.gradient(program, cases, jnp.array(GAINS)).derivatives


CONTENDERS = [
    Contender("jaxsat native, Dopri8 adaptive", TOLERANCES, native),
    Contender("heyoka, variational equations", TOLERANCES, variational),
]


def start_in_error(y, gains):
    """The start (10,) whose rate error is y's under the usual gains, with those of other gains."""
    change = reference(y, gains) - reference(y, GAINS)
    return jnp.asarray(y).at[3:5].add(-change)


@jax.jit
def variational_rate(t, flat, torque, gains):
    """The rate of a state and, after it, of its derivatives by the gains (50,)."""
    state, *along = flat.reshape(5, SIZE)

    def slope(state, gains):
        return rate(t, state, *torque, smooth=True, gains=gains)

    pushed = [
        jax.jvp(slope, (state, gains), (d, one))[1]
        for d, one in zip(along, jnp.eye(4), strict=True)
    ]
    return jnp.concatenate([slope(state, gains), *pushed])


def solution(y, torque, duration: float, tolerance: float, gains) -> np.ndarray:
    """The state and its derivatives by the gains (10, 5) at the end, by DOP853."""
    gains = jnp.array(gains)
    derivatives = jax.jacfwd(lambda gains: start_in_error(y, gains))(gains)
    begin = jnp.concatenate([start_in_error(y, gains), *derivatives.T])
    found = solve_ivp(
        lambda t, flat: np.asarray(variational_rate(t, flat, torque, gains)),
        (0.0, duration),
        np.asarray(begin),
        "DOP853",
        rtol=tolerance,
        atol=tolerance,
    )
    return found.y[:, -1].reshape(5, SIZE).T


def truth(study: Study, count: int, tolerance: float = 1e-12) -> np.ndarray:
    """Gradients (cases, 4) of the first cases."""
    y, *torque = starts(study, count)
    duration = float(study.program.duration)
    return np.stack(
        [
            solution(y[i], [part[i] for part in torque], duration, tolerance, GAINS)[9, 1:]
            for i in range(count)
        ]
    )


def by_differences(study: Study, tolerance: float = 1e-13) -> np.ndarray:
    """The gradient (4,) of the first case, by central differences."""
    y, *torque = starts(study, 1)
    duration = float(study.program.duration)
    found = []
    for number, gain in enumerate(GAINS):
        step = np.zeros(4)
        step[number] = DIFFERENCE * gain
        ends = [
            solution(y[0], [part[0] for part in torque], duration, tolerance, gains)[9, 0]
            for gains in (GAINS + step, GAINS - step)
        ]
        found.append((ends[0] - ends[1]) / (2 * step[number]))
    return np.array(found)


def errors(found: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Every case's largest error, for relative changes of the gains, in parts of the gradient."""
    weight = np.array(GAINS)
    return np.abs((found - true) * weight).max(axis=1) / np.linalg.norm(true * weight, axis=1)


def main() -> None:
    """Judge, then time."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=512)
    parser.add_argument("--truth", type=int, default=20, help="cases that accuracy is judged by")
    parser.add_argument("--duration", type=float, default=1000.0, help="s")
    parser.add_argument("--within", type=float, default=1e-6, help="accuracy of 95 %% of cases")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    study = made_study(options.cases, options.duration, "smooth")
    true = truth(study, options.truth)
    apart = errors(by_differences(study)[None], true[:1])[0]
    print(f"reference and central differences of the first case: {apart:.1e} apart")
    runs = {}
    for contender in CONTENDERS:
        for setting in contender.settings:
            found = contender.prepare(study, options.truth, setting)()
            error = float(np.percentile(errors(np.asarray(found), true), PERCENT))
            if error <= options.within:
                break
        missed = "  NOT ACCURATE ENOUGH" * (error > options.within)
        print(f"{contender.name:34} {setting:<8.2g} {error:.1e}{missed}", flush=True)
        runs[contender.name] = contender.prepare(study, options.cases, setting)
    found = paces(runs, options.cases, options.rounds)
    base = next(iter(found.values()))
    print(f"{'':34} gradients/s   ratio")
    for name, pace in found.items():
        print(f"{name:34} {pace:11.1f} {pace / base:7.2f}")


if __name__ == "__main__":
    main()
