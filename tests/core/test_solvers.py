"""Solvers by name: the same as diffrax's own, and a message for another name."""

import diffrax
import numpy as np
import pytest

from jaxsat.core.solvers import SOLVERS, NamedSolver, class_name, known_class, solver_of
from jaxsat.scenario.tables import SolverName
from jaxsat.simulation.engine.adaptive import AdaptiveStepper
from jaxsat.simulation.engine.runge_kutta import tableau_of


def test_every_name_of_a_scenario_is_a_solver_of_diffrax():
    assert set(SOLVERS) == set(SolverName.__args__)
    for name in SOLVERS:
        solver = NamedSolver(name)
        assert type(solver_of(solver)) is getattr(diffrax, class_name(solver))
        rates = [1.0, *(1 - c**2 for c in tableau_of(solver).c)]  # ∫(1 - t²) to second order
        error = np.dot(tableau_of(solver).b_sol, rates) - 2 / 3
        assert abs(error) < {"euler": 0.34, "midpoint": 0.09, "heun": 0.17}.get(name, 1e-12)


@pytest.mark.parametrize("name", SOLVERS)
def test_tableaus_of_names_are_those_of_diffrax(name):
    """Bit for bit, with the order and, where diffrax has them, coefficients of the dense output."""
    found, own = (tableau_of(one) for one in (NamedSolver(name), NamedSolver(name).instance()))
    assert found.order == own.order == int(NamedSolver(name).instance().order(None))
    assert len(found.a_lower) == len(own.a_lower) == len(found.c)
    pairs = [*zip(found.a_lower, own.a_lower, strict=True), (found.c, own.c)]
    pairs += [(found.b_sol, own.b_sol), (found.b_error, own.b_error)]
    assert (found.dense is None) == (name not in ("tsit5", "dopri5", "dopri8"))
    if name in ("dopri5", "dopri8"):
        kind = NamedSolver(name).instance().interpolation_cls
        pairs.append((found.dense, kind.c_mid if name == "dopri5" else kind.eval_coeffs))
    for one, other in pairs:
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        assert one.tobytes() == other.tobytes()


def test_another_name_is_refused():
    with pytest.raises(ValueError, match=r"must be one of euler, .*, dopri8, but got rk4"):
        NamedSolver("rk4")
    with pytest.raises(ValueError, match=r"must be Tsit5, Dopri5 or Dopri8 .* got Heun"):
        AdaptiveStepper(NamedSolver("heun"))


def test_a_class_derived_from_a_solver_is_one():
    class Own(diffrax.Tsit5):
        pass

    class Tsit5(diffrax.Heun):
        """Of the same name as another one."""

    assert tableau_of(Own()).c is diffrax.Tsit5.tableau.c
    assert known_class(Own()) == "Tsit5"
    assert known_class(Tsit5()) == "Heun"
    AdaptiveStepper(Own())
    with pytest.raises(ValueError, match=r"must be Tsit5, Dopri5 or Dopri8"):
        AdaptiveStepper(Tsit5())


@pytest.mark.parametrize("solver", [diffrax.KenCarp3(), diffrax.SPaRK(), diffrax.Kvaerno3()])
def test_other_methods_are_refused_with_their_name(solver):
    with pytest.raises(ValueError, match=f"explicit Runge-Kutta .* got {type(solver).__name__}"):
        tableau_of(solver)
