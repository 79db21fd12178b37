"""The structure of steppers and engines."""

import diffrax
import pytest

from helpers.switching import CASE, switching_loop
from jaxsat.simulation.engine.adaptive import AdaptiveStepper
from jaxsat.simulation.engine.fixed import FixedStepper, SampledStepper, stepper_for
from jaxsat.simulation.engine.interface import AbstractEngine
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.simulation.engine.stepper import AbstractStepper
from simulation.engine.relay import relay

KINDS = (AdaptiveStepper, FixedStepper, SampledStepper)
ENGINES = (NativeEngine, ReferenceEngine, ScanEngine)


@pytest.mark.parametrize("final", [*KINDS, *ENGINES])
def test_no_concrete_method_is_overridden(final):
    ours = [cls for cls in final.__mro__ if cls.__module__.startswith("jaxsat.")]
    for number, cls in enumerate(ours):
        for base in ours[number + 1 :]:
            for name in set(vars(cls)) & set(vars(base)):
                if not name.startswith("_"):
                    assert getattr(vars(base)[name], "__isabstractmethod__", False), name


@pytest.mark.parametrize("base", [AbstractEngine, AbstractStepper])
def test_what_engines_and_steppers_offer_is_abstract(base):
    with pytest.raises(TypeError, match="abstract"):
        base()


@pytest.mark.parametrize("kind", KINDS)
def test_a_sampled_loop_takes_steps_of_its_own_with_the_solver_given(kind):
    stepper = kind(diffrax.Dopri5())
    chosen = stepper_for(stepper, switching_loop(CASE))
    assert isinstance(chosen, SampledStepper)
    assert chosen.solver is stepper.solver
    assert stepper_for(stepper, relay()) is stepper


@pytest.mark.parametrize("kind", KINDS)
def test_steppers_refuse_solvers_that_are_not_explicit(kind):
    with pytest.raises(ValueError, match="explicit Runge-Kutta"):
        kind(diffrax.Kvaerno5())
