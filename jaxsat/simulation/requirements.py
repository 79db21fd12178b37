"""Margins of requirements (robustness of temporal-logic formulas), computed while a run advances.

The margin is the quantitative semantics (robustness) of signal temporal logic: A. Donzé and O.
Maler, "Robust satisfaction of temporal logic over real-valued signals", FORMATS 2010. A
comparison's margin is the signal's distance to its limit (SI units), positive where it holds; "and"
and "always" take minima, "or" and "eventually" maxima. Memory is constant: windows do not nest.
"""

from collections.abc import Callable, Mapping
from functools import partial, reduce
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Int

from jaxsat.core.array_types import BoolScalar, RealScalar, Vector
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.requirements import (
    Formula,
    Inequality,
    Junction,
    Negation,
    Temporal,
    all_parts,
    comparisons,
)
from jaxsat.core.quotients import angle_of, length
from jaxsat.spacecraft.environment.orbital_torques import Sunlight

AXES = ("rate_x", "rate_y", "rate_z")
SIZES = ("rate", "relative_rate", "torque", "disturbance")
"""Signals used by component (`AXES`) and by Euclidean norm (`SIZES`)."""


class Margin(NamedTuple):
    """A margin (SI units), with the index of the deciding comparison and its time (s).

    Before any comparison the margin is infinite and the time NaN.
    """

    value: Float[Array, "*n"]
    comparison: Int[Array, "*n"]
    time: Float[Array, "*n"]

    @staticmethod
    def none(value: float, like: RealScalar) -> "Margin":
        """The margin before any comparison, in the precision of `like`."""
        return Margin(jnp.full_like(like, value), jnp.array(0), jnp.full_like(like, jnp.nan))

    def negated(self) -> "Margin":
        """The margin of the negation."""
        return self._replace(value=-self.value)

    def least(self, other: "Margin") -> "Margin":
        """The smaller of two margins, NaN if either is NaN."""
        worse = (other.value < self.value) | jnp.isnan(other.value)
        return _either(worse, other, self)

    def most(self, other: "Margin") -> "Margin":
        """The larger of two margins, NaN if either is NaN."""
        return self.negated().least(other.negated()).negated()


def _either(condition: BoolScalar, one: Margin, other: Margin) -> Margin:
    return Margin(*(jnp.where(condition, a, b) for a, b in zip(one, other, strict=True)))


class Track(NamedTuple):
    """Record of a window: its margin so far, and the smallest margin of `held` before."""

    best: Margin
    held: Margin


class Monitor(NamedTuple):
    """Tracks of all windows of a formula, and the last time (s) and margins of comparisons."""

    tracks: tuple[Track, ...]
    time: RealScalar
    margins: Float[Array, " c"]


_RAW: dict[str, str] = {
    **dict.fromkeys(("pointing_error", "tilt", "sun_angle"), "quaternion"),
    **dict.fromkeys(("rate", *AXES), "omega"),
}
"""Recorded signal from which each derived signal is computed."""


def compared(
    formula: Formula, signals: Mapping[str, ArrayLike], sun: Vector | None = None
) -> Float[Array, " c"]:
    """Return the margin (SI units) of each comparison of a formula at an instant.

    `sun` is the unit vector to the Sun in orbit axes, which formulas with a `sun_angle` need.
    """
    margins = []
    for one in comparisons(formula):
        value = _signal(one, signals, sun)
        margins.append(one.limit - value if one.below else value - one.limit)
    return jnp.stack(margins)


def _signal(one: Inequality, signals: Mapping[str, ArrayLike], sun: Vector | None) -> RealScalar:
    """The value of the signal that a comparison names."""
    if one.signal in ("pointing_error", "tilt", "sun_angle"):
        q = jnp.asarray(signals["quaternion"])
        if one.signal == "pointing_error":
            return 2 * angle_of(length(q[1:]), jnp.abs(q[0]))
        if one.signal == "tilt":
            return 2 * angle_of(length(q[1:3]), length(q[::3]))
        assert sun is not None
        direction, light = jnp.asarray(one.direction), Quaternion(q).as_dcm().matrix @ sun
        return angle_of(length(jnp.cross(direction, light)), direction @ light)
    if one.signal in AXES:
        return jnp.asarray(signals["omega"])[AXES.index(one.signal)]
    value = jnp.asarray(signals["omega" if one.signal == "rate" else one.signal])
    if one.signal in SIZES:
        return length(value)
    return jnp.max(jnp.abs(value)) if value.ndim else value


def raw_signals(formula: Formula) -> set[str]:
    """The names of the signals of a run that `compared` reads."""
    return {_RAW.get(one.signal, one.signal) for one in comparisons(formula)}


def initial_monitor(
    formula: Formula, time: RealScalar, margins: Float[Array, " c"], failures: int
) -> Monitor:
    """The monitor before the first observation, at `time` (s), of a run with this many failures."""
    nothing = Track(Margin.none(-jnp.inf, time), Margin.none(jnp.inf, time))
    count = sum(failures if one.after_failure else 1 for one in _temporals(formula))
    return Monitor((nothing,) * count, time, margins)


def observe(
    formula: Formula,
    monitor: Monitor,
    time: RealScalar,
    margins: Float[Array, " c"],
    end: RealScalar,
    failures: Float[Array, " f"],
) -> Monitor:
    """The monitor after an observation, at `time` (s), of the margins of all comparisons.

    `end` (s) is the run's end; `failures` are failure times (s). The margin of a comparison is
    linear between two observations, so that a window may begin or end between them.
    """
    order = comparisons(formula)

    def at(instant: RealScalar, part: Formula) -> Margin:
        span = time - monitor.time
        share = (instant - monitor.time) / jnp.where(span > 0, span, 1.0)
        between = monitor.margins * (1 - share) + margins * share
        return _at_instant(part, order, between, instant)

    def now(part: Formula) -> Margin:
        return _at_instant(part, order, margins, time)

    after = []
    for one, (begin, stop), track in zip(
        *_windows(formula, end, failures), monitor.tracks, strict=True
    ):
        begins, stops = (
            (monitor.time < limit) & (limit < time) for limit in (begin, stop)
        )  # between the two observations

        def between(one=one, begin=begin, stop=stop, track=track, begins=begins, stops=stops):
            track = _with_instant(track, one, partial(at, begin), begins & (begin <= stop))
            return _with_instant(track, one, partial(at, stop), stops & (begin <= stop))

        if not one.whole_run:
            track = jax.lax.cond(begins | stops, between, lambda track=track: track)
        track = _with_instant(track, one, now, (begin <= time) & (time <= stop))
        if one.until is not None:
            track = track._replace(held=track.held.least(now(one.held)))
        after.append(track)
    return Monitor(tuple(after), time, margins)


def _with_instant(
    track: Track, one: Temporal, at: Callable[[Formula], Margin], inside: BoolScalar
) -> Track:
    """The track with one more instant, if that is `inside` the window."""
    margin, held = at(one.held), track.held
    if one.until is not None:
        margin, held = at(one.until).least(held), _either(inside, held.least(margin), held)
    elif one.kind == "always":
        margin = margin.negated()
    return Track(_either(inside, track.best.most(margin), track.best), held)


def margin_of(
    formula: Formula, monitor: Monitor, end: RealScalar, failures: Float[Array, " f"]
) -> Margin:
    """The margin after the last observation, at the `end` (s) of a run.

    The margin is infinite where no window has begun, and so is that of its negation.
    """
    tracks = zip(*_windows(formula, end, failures), monitor.tracks, strict=True)
    holds_always = Margin.none(jnp.inf, monitor.time)
    margin_at: dict[int, Margin] = {}
    for one, (begin, _), track in tracks:
        margin = track.best.negated() if one.kind == "always" else track.best
        margin = _either(begin <= end, margin, holds_always)
        margin_at[id(one)] = margin_at[id(one)].least(margin) if id(one) in margin_at else margin

    def of(part: Formula) -> Margin:
        if isinstance(part, Temporal):
            return margin_at.get(id(part), holds_always)
        if isinstance(part, Negation):
            whole = of(part.part)
            return _either(whole.value == jnp.inf, whole, whole.negated())
        return _combined(part, of)

    return of(formula)


def _combined(formula: Formula, of) -> Margin:
    """The margin of a negation or a junction, from the margins `of` its parts."""
    if isinstance(formula, Negation):
        return of(formula.part).negated()
    assert isinstance(formula, Junction)
    return reduce(Margin.least if formula.every else Margin.most, map(of, formula.parts))


def _at_instant(
    formula: Formula, order: tuple[Inequality, ...], margins: Float[Array, " c"], time: RealScalar
) -> Margin:
    """The margin of a formula without windows at one instant."""

    def of(part: Formula) -> Margin:
        if isinstance(part, Inequality):
            number = order.index(part)
            return Margin(margins[number], jnp.array(number), time)
        return _combined(part, of)

    return of(formula)


def _temporals(formula: Formula) -> list[Temporal]:
    return [one for one in all_parts(formula) if isinstance(one, Temporal)]


def _windows(formula: Formula, end: RealScalar, failures: Float[Array, " f"]):
    """Every window of a formula (one per failure where failures are its anchors): the temporal
    operator, and its begin and end (s), cut at the `end` of the run."""
    of, windows = [], []
    for one in _temporals(formula):
        for failed_at in failures if one.after_failure else (None,):
            anchors = {"start": 0.0, "end": end, "failure": failed_at}
            begin, stop = (anchors[limit.anchor] + limit.offset for limit in (one.begin, one.end))
            of.append(one)
            windows.append((jnp.asarray(begin), jnp.minimum(stop, end)))
    return of, windows


class Requirements(eqx.Module):
    """Requirements on every case of a program, evaluated up to its `end` (s).

    `names` belong to the `formulas`; `light` gives the Sun's direction, needed by each `sun_angle`.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    formulas: tuple[Formula, ...] = eqx.field(static=True)
    end: RealScalar = eqx.field(converter=as_float)
    light: Sunlight | None = None

    def initial(self, zero: RealScalar, failures: int) -> tuple[Monitor, ...]:
        """Monitors before the first observation at time `zero` (s)."""
        counts = [len(comparisons(one)) for one in self.formulas]
        return tuple(
            initial_monitor(one, zero, jnp.zeros(count, zero.dtype), failures)
            for one, count in zip(self.formulas, counts, strict=True)
        )

    def observe(
        self,
        monitors: tuple[Monitor, ...],
        time: RealScalar,
        signals: Mapping[str, ArrayLike],
        failures: Float[Array, " f"],
        good: BoolScalar | bool = True,
    ) -> tuple[Monitor, ...]:
        """The monitors after an observation of signals by name; NaN where that is not `good`."""
        sun = None if self.light is None else self.light(time)[0]
        return tuple(
            observe(
                formula,
                monitor,
                time,
                jnp.where(good, compared(formula, signals, sun), jnp.nan),
                self.end,
                failures,
            )
            for formula, monitor in zip(self.formulas, monitors, strict=True)
        )

    def margins(self, monitors: tuple[Monitor, ...], failures: Float[Array, " f"]) -> Margin:
        """The margin of each formula after the last observation."""
        several = [
            margin_of(formula, monitor, self.end, failures)
            for formula, monitor in zip(self.formulas, monitors, strict=True)
        ]
        return Margin(*(jnp.stack(parts) for parts in zip(*several, strict=True)))

    def after_history(
        self,
        times: Float[Array, " times"],
        signals: Mapping[str, Array | np.ndarray],
        failures: Float[Array, " f"],
    ) -> Margin:
        """The margin of each formula after a whole history (times, ...), NaN after its end."""

        def one(monitors, instant):
            time, here = instant
            return self.observe(monitors, time, here, failures), None

        begin = self.initial(times[0], failures.size)
        monitors, _ = jax.lax.scan(one, begin, (times, signals))
        return self.margins(monitors, failures)


def saved_margin(
    formula: Formula,
    times: Float[np.ndarray, " times"],
    signals: Mapping[str, ArrayLike],
    failures: np.ndarray,
    light: Sunlight | None = None,
) -> Margin:
    """The margin of a formula from the signals (times, ...) of a run at saved times (s).

    `failures` are failure times (s), ignored after the last saved time. `light` gives the direction
    of the Sun, which formulas with a `sun_angle` need.
    """
    arrays = {name: jnp.asarray(signals[name]) for name in raw_signals(formula)}
    at, instants = jnp.asarray(failures, float).reshape(-1), jnp.asarray(times)
    alone = Requirements(("",), (formula,), instants[-1], light)
    return jax.tree.map(lambda x: x[0], _after_history(alone, instants, arrays, at))


@eqx.filter_jit
def _after_history(requirements: Requirements, times, signals, failures) -> Margin:
    return requirements.after_history(times, signals, failures)
