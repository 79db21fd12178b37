"""Laws of three slews that hold against a drift about the axis without a torque.

The drift is that of a constant torque, or of gravity gradient at errors of the model. Units of the
numbers here are those of `jaxsat.control.presets`.
"""

import dataclasses
import math
from typing import cast

import equinox as eqx
import numpy as np

from jaxsat.control.estimators import MOST_TURN
from jaxsat.control.handover import TurnRoom
from jaxsat.control.normal_form import NormalForm
from jaxsat.control.oscillatory import FlatTop, twice_mean_square
from jaxsat.control.presets import balanced_drift, moments_of, scaling_of
from jaxsat.control.ripple import RippleFilter, Steady
from jaxsat.control.supervisor import ThreeSlewSettling
from jaxsat.core.checks import as_float

STEADY, STEADY_DRIFT, CALM = 5e-9, 4e-12, 4.0
"""Expected acceleration by a constant torque in the ripple filter, and its drift: rad per
`fine_time`², and per its 5/2nd power; learnt at rates below this many amplitudes of the end
game."""

ORBIT_STEADY, ORBIT_STEADY_DRIFT, AIM_SLACK = 0.05, 1e-4, 2.0
"""Under gravity gradient: acceleration at rest by errors of the products, in parts of ω0², its
drift with the attitude, in parts of ω0^2.5; and the tolerance on the aimed slow rate at the begin
of a hold, in parts of the oscillation's dead zone."""

AIMED_SHARE = 2 / 3
"""Turn against the drift at which a hold is aimed, relative to the turn at which it ends."""

TILT_ROOM, NO_PART = 1.6, 1e-9
"""Ratio of the limits on turns across the body's third axis and about it (0.1 against 0.05 rad,
less a tenth and the oscillation's share of the tilt), and an axis component treated as zero."""

TILTED = 0.085
"""Largest tilt of the body during a hold, rad: that of settling, 0.1 rad, less the oscillation's.
"""

PULSE_SHARE, LEAST_QUIET = 0.2, 0.5
"""The amplitude of the end game is reduced by the first share of a pulse's rate, but to no less
than the second share of itself: pulses and hold together stay within the tolerance of the rate."""

SWITCH_SHARE = 0.5
"""Share of the torque limit with which the flat-topped waves of the end game change sign."""


def coasting(law: ThreeSlewSettling, pulse: float, noise: float) -> ThreeSlewSettling:
    """Return the law with an estimate of the constant torque about n, and holds that begin against
    that torque where the end game cannot balance it.

    They turn about n as far as the tolerances of settling allow. The end game leaves room for the
    rate (rad/s) that the smallest `pulse` of a thruster changes. The estimate assumes at least the
    `noise` (rad/s) of the measured rates.
    """
    unit = scaling_of(law.form, float(law.torque_limit), float(law.period)).fine_time
    amplitude = float(law.fine.holding_amplitude)
    law = _with_steady(law, (STEADY / unit**2, STEADY_DRIFT / unit**2.5), noise)
    amplitude = max(amplitude - PULSE_SHARE * pulse, LEAST_QUIET * amplitude)
    room, handover = _room(law.form), law.fine.handover
    leave_turn = room * float(handover.leave_turn)
    handover = dataclasses.replace(
        handover,
        enter_turn=room * float(handover.enter_turn),
        leave_turn=leave_turn,
        aimed_turn=AIMED_SHARE * leave_turn,
    )
    fine = dataclasses.replace(law.fine, holding_amplitude=as_float(amplitude), handover=handover)
    estimator = dataclasses.replace(law.estimator, balanced=balanced_drift(fine))
    late_turn = room * float(law.late_turn)
    return dataclasses.replace(law, fine=fine, estimator=estimator, late_turn=late_turn)


def balancing(law: ThreeSlewSettling, noise: float) -> ThreeSlewSettling:
    """Return the law with an estimate of the drift by errors of the products under gravity
    gradient, which moves the held attitude, and holds that begin against drift that no attitude
    balances, of flat-topped waves. The held attitude turns about n, and the body beside it, as far
    as the tolerances of settling allow. After an attitude has been lost, slews are about the
    estimated axes.

    The estimate assumes at least the `noise` (rad/s) of the measured rates. A law without gravity
    gradient or ripple filter is unchanged.
    """
    if law.estimator.gradient is None or law.estimator.observer is None:
        return law
    orbit_rate = abs(float(law.form.model.orbit.rate))
    steady = ORBIT_STEADY * orbit_rate**2, ORBIT_STEADY_DRIFT * orbit_rate**2.5
    law = _with_steady(law, steady, noise)
    slack = AIM_SLACK * law.fine.oscillator.dead_zone
    leave = law.fine.handover.leave_turn
    handover = dataclasses.replace(
        law.fine.handover, aim_slack=slack, leave_held=leave, room=TurnRoom(leave, TILTED)
    )
    largest = float(law.torque_limit) / max(moments_of(law.form)[:2])
    flat_top = FlatTop(SWITCH_SHARE * largest, law.period)
    fine = dataclasses.replace(law.fine, handover=handover, flat_top=flat_top)
    estimator = dataclasses.replace(
        law.estimator,
        balances_steady=True,
        balanced=balanced_drift(fine) * twice_mean_square(fine.roundness),
        most_turn=as_float(_room(law.form) * MOST_TURN),
    )
    return dataclasses.replace(law, fine=fine, estimator=estimator, turns_slews=True)


def _room(form: NormalForm) -> float:
    """Limit on a turn about n relative to one about the body's third axis.

    Settling limits the tilt of that axis, which may be twice as large as the turn about it.
    """
    first, second, third = np.abs(np.asarray(form.axes)[2])
    return min(1 / max(third, NO_PART), TILT_ROOM / max(math.hypot(first, second), NO_PART))


def _with_steady(
    law: ThreeSlewSettling, steady: tuple[float, float], noise: float
) -> ThreeSlewSettling:
    """The law with an estimate of a `steady` acceleration, size and drift, and holds that coast."""
    calm = CALM * float(law.fine.holding_amplitude)
    ripple = cast(RippleFilter, law.estimator.observer)
    observer = dataclasses.replace(
        ripple,
        steady=Steady(*map(as_float, (*steady, calm))),
        noise=as_float(max(float(ripple.noise), noise)),
    )
    handover = dataclasses.replace(law.fine.handover, coasts=True)
    fine = dataclasses.replace(law.fine, handover=handover)
    estimator = dataclasses.replace(law.estimator, observer=observer)
    return eqx.tree_at(lambda one: (one.estimator, one.fine), law, (estimator, fine))
