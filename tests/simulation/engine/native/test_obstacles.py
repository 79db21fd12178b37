"""What cannot be lowered is told with its place; what goes wrong is told as a bug."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.compiler import CannotLower, Mapped
from jaxsat.compiler.ir import NativeBug
from jaxsat.compiler.lowering import RULES
from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.native import native_obstacle
from simulation.engine.examples import EXAMPLES, KICKS, program


def test_what_cannot_be_lowered_is_named_with_its_place():
    def function(case, shared):
        return jnp.linalg.eigvalsh(jnp.outer(case, case))

    with pytest.raises(CannotLower, match=r"eigh.*test_obstacles\.py"):
        Mapped(function, np.ones(3))


@pytest.fixture
def broken_rules(monkeypatch):
    def broken(b, eqn, *arrays):
        raise IndexError("beyond the end")

    for name in ("sin", "mul"):
        monkeypatch.setitem(RULES, name, broken)


@pytest.mark.usefixtures("broken_rules")
def test_a_rule_that_breaks_down_is_told_as_a_bug():
    words = r"`sin`.*test_obstacles\.py.*beyond the end.*bug in jaxsat"
    with pytest.raises(NativeBug, match=words):
        Mapped(lambda x, _: jnp.where(x > 0, jax.jit(lambda y: jnp.sin(y))(x), x), 0.5)


@pytest.mark.usefixtures("broken_rules")
def test_a_rule_that_breaks_down_is_no_obstacle_to_fall_back_for():
    """Engine `auto` asks for the obstacle, and takes another engine where there is one."""
    one = EXAMPLES["corners"]()
    # steps that no other test has made a kernel for
    stepper = FixedStepper(one.scan.stepper.solver, 1237)
    with pytest.raises(NativeBug):
        native_obstacle(stepper, program(one), KICKS)


@pytest.mark.parametrize("part", ["merge_cold_branches", "schedule", "parameter_locations"])
def test_what_goes_wrong_after_the_rules_is_told_as_a_bug(monkeypatch, part):
    """A `ValueError` above all, which a command would take for the user's mistake."""

    def broken(*_):
        raise ValueError("no such block")

    monkeypatch.setattr(f"jaxsat.compiler.llvm.entry_points.{part}", broken)
    with pytest.raises(NativeBug, match=r"no such block.*bug in jaxsat"):
        _ = Mapped(lambda x, _: 2 * x, 0.5).text


@pytest.mark.parametrize("error", [NativeBug("a rule", "what"), RuntimeError("of LLVM")])
def test_only_what_has_no_rule_is_an_obstacle(monkeypatch, error):
    one = EXAMPLES["corners"]()
    arguments = FixedStepper(one.scan.stepper.solver), program(one), KICKS

    def failing(error):
        def fail(*_):
            raise error

        monkeypatch.setattr("jaxsat.simulation.engine.native.engine._kernel", fail)

    failing(CannotLower("No rule"))
    assert "No rule" in native_obstacle(*arguments)
    failing(error)
    with pytest.raises(type(error)):
        native_obstacle(*arguments)
    with jax.enable_x64(False):
        assert "must have 64-bit numbers" in native_obstacle(*arguments)
