"""Parts for diffrax: a solver that assesses a run on its own steps, and a step-size controller.

The controller scales momenta of effectors by a unit of the body. This module imports diffrax.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.core.array_types import RealScalar
from jaxsat.core.tolerances import SettlingTracker
from jaxsat.simulation.assessment import stop_gradient
from jaxsat.simulation.units import in_units, out_of_units
from jaxsat.spacecraft.dynamics import RigidBody

CHECKS = 4
"""Number of equal parts of a step at whose ends a run is monitored."""

HALVINGS = 40
"""Number of bisections of a fraction: the rest of a step of 1 s is below its round-off."""


class MonitorSample(NamedTuple):
    """Output of a monitor at one instant.

    `excess` is the relative excess over the tolerances by group of conditions, `rate` an integrand.
    """

    excess: tuple[Float[Array, " _"], ...]
    rate: Float[Array, "*m"]


Monitor = Callable[[RealScalar, PyTree], MonitorSample]
"""Function of a time (s) and of the integrated state."""


class EntryBracket(NamedTuple):
    """The last step in which a group's conditions all became true, and its bracketing fractions.

    `low` is infinite before the first entry.
    """

    begin: RealScalar
    end: RealScalar
    dense: PyTree
    low: RealScalar
    high: RealScalar


class MonitorRecord(NamedTuple):
    """Record of a monitor up to the end of the last step."""

    since: tuple[SettlingTracker, ...]
    entries: tuple[EntryBracket, ...]
    integral: Float[Array, "*m"]


class MonitoredState(NamedTuple):
    """The state of a solver and the record of its monitor."""

    solver: Any
    record: MonitorRecord


class MonitoredSolver(diffrax.AbstractWrappedSolver):
    """A solver with a monitor on the dense output of every accepted step; its steps are unchanged.

    The record is not differentiated. The solution contains it as `solver_state.record`.
    """

    solver: diffrax.AbstractSolver  # pyright: ignore[reportIncompatibleVariableOverride]
    monitor: Monitor

    @property
    def term_structure(self):  # pyright: ignore[reportIncompatibleVariableOverride]
        """The structure of the terms that the solver takes."""
        return self.solver.term_structure

    @property
    def interpolation_cls(self):  # pyright: ignore
        """The class of the solver's dense output."""
        return self.solver.interpolation_cls

    @property
    def term_compatible_contr_kwargs(self):  # pyright: ignore[reportIncompatibleVariableOverride]
        """The solver's own keyword arguments of the terms' contractions."""
        return self.solver.term_compatible_contr_kwargs

    @property
    def scan_kind(self):
        """The kind of loop over the solver's stages, which diffrax replaces for forward mode."""
        return self.solver.scan_kind  # pyright: ignore[reportAttributeAccessIssue]

    def order(self, terms):
        """The order of the solver."""
        return self.solver.order(terms)

    def strong_order(self, terms):
        """The strong order of the solver."""
        return self.solver.strong_order(terms)

    def error_order(self, terms):
        """The order of the solver's error estimate."""
        return self.solver.error_order(terms)

    def func(self, terms, t0, y0, args):
        """The rate of the state, as the solver computes it."""
        return self.solver.func(terms, t0, y0, args)

    def init(self, terms, t0, t1, y0, args) -> MonitoredState:
        """The solver's state and the monitor's record with the first sample."""
        inner = self.solver.init(terms, t0, t1, y0, args)
        shapes = eqx.filter_eval_shape(self.solver.step, terms, t0, t1, y0, args, inner, False)[2]
        dense = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), shapes)
        t0 = jnp.asarray(t0)
        sample = self.monitor(*stop_gradient((t0, y0)))
        never = EntryBracket(t0, t0, dense, t0 + jnp.inf, t0 + jnp.inf)
        since = tuple(SettlingTracker.initial(t0, len(x)).observe(t0, x) for x in sample.excess)
        record = MonitorRecord(since, (never,) * len(since), jnp.zeros_like(sample.rate))
        return MonitoredState(inner, record)

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        """The solver's step, with its record."""
        y1, error, dense, inner, result = self.solver.step(
            terms, t0, t1, y0, args, solver_state.solver, made_jump
        )
        begin, end, stages = stop_gradient((jnp.asarray(t0), jnp.asarray(t1), dense))
        record = self._record_step(begin, end, stages, solver_state.record)
        return y1, error, dense, MonitoredState(inner, record), result

    def _record_step(self, t0, t1, dense, record: MonitorRecord) -> MonitorRecord:
        at = jnp.arange(CHECKS + 1) / CHECKS
        samples = jax.vmap(lambda fraction: self._at(t0, t1, dense, fraction))(at)
        groups = []
        for since, entry, values in zip(record.since, record.entries, samples.excess, strict=True):
            entry_fraction = t0 + jnp.inf
            for number, fraction in enumerate(at[1:], 1):
                now = values[number]
                enters = jnp.any(since.excess >= 0) & jnp.all(now < 0)
                entry_fraction = jnp.where(enters, fraction, entry_fraction)
                since = since.observe(t0 + fraction * (t1 - t0), now)
            here = EntryBracket(t0, t1, dense, entry_fraction - 1 / CHECKS, entry_fraction)
            enters = jnp.isfinite(entry_fraction)
            entry = jax.tree.map(lambda x, y, e=enters: jnp.where(e, x, y), here, entry)
            groups.append((since, entry))
        weights = jnp.array([1.0, 4.0, 2.0, 4.0, 1.0]) / 12.0  # Simpson's
        integral = record.integral + (t1 - t0) * weights @ samples.rate
        since, entries = (tuple(group[i] for group in groups) for i in range(2))
        return MonitorRecord(since, entries, integral)

    def _at(self, t0, t1, dense, fraction) -> MonitorSample:
        t = t0 + fraction * (t1 - t0)
        return self.monitor(t, self.interpolation_cls(t0=t0, t1=t1, **dense).evaluate(t))

    def since(self, record: MonitorRecord, group: int) -> SettlingTracker:
        """The time since which a group's conditions hold, located on the dense output."""
        since, entry = record.since[group], record.entries[group]
        never = jnp.isinf(entry.low)
        begin, end, dense = entry.begin, jnp.where(never, entry.end + 1, entry.end), entry.dense

        def halve(_, bracket):
            low, high = bracket
            middle = (low + high) / 2
            inside = jnp.all(self._at(begin, end, dense, middle).excess[group] < 0)
            return jnp.where(inside, low, middle), jnp.where(inside, middle, high)

        bracket = (jnp.where(never, 0.0, entry.low), jnp.where(never, 1.0, entry.high))
        high = jax.lax.fori_loop(0, HALVINGS, halve, bracket)[1]
        instant = begin + high * (end - begin)
        return since._replace(start=jnp.where(never | jnp.isinf(since.start), since.start, instant))


class StepControl(diffrax.PIDController):
    """A `PIDController` that scales a state's momenta by the unit of the `body`."""

    body: RigidBody | None = None

    def init(self, terms, t0, t1, y0, dt0, args, func, error_order):
        """The first step and the controller's state, chosen with momenta in units of the body."""

        def rate(terms, t, y, args):
            return self._of(in_units, func(terms, t, self._of(out_of_units, y), args))

        return super().init(terms, t0, t1, self._of(in_units, y0), dt0, args, rate, error_order)

    def adapt_step_size(
        self, t0, t1, y0, y1_candidate, args, y_error, error_order, controller_state
    ):
        """The next step, controlled by states and error with momenta in units of the body."""
        before, after, error = (self._of(in_units, y) for y in (y0, y1_candidate, y_error))
        return super().adapt_step_size(
            t0, t1, before, after, args, error, error_order, controller_state
        )

    def _of(self, change, state):
        return state if self.body is None else change(self.body, state)
