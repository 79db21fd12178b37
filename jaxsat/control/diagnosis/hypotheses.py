"""The kinds of failure that a diagnosis tells apart, as points and lines in the plane of (a, b).

Of a thruster a is the missing part of what was commanded, b the part of full thrust that it makes
all the time:

    dead (1, 0), degraded (s, 0), stuck on (1, 1), stuck at (1, s), leaking (s, s), reversed (2, 0).

Of a reaction wheel b is the part of its full motor torque that brakes the rotor all the time, so
that a motor that drives it on has b = -1:

    dead (1, 0), degraded (s, 0), friction up (0, s), runaway (1, -1).
"""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.declaration.failures import AbstractFailureKind

RealScalar = Float[Array, ""]

LEAST_PART = 0.02
"""A loss or a leak below this part of full torque is none."""

MOST_FRICTION = 4.0
"""Of the full torque of a motor: what brakes a wheel more counts as this."""


class DiagnosedKind(AbstractFailureKind):
    """Kinds of failure that are told apart; those from `FRICTION_UP` on are of wheels alone."""

    DEAD = 0, "dead", "no torque"
    DEGRADED = 1, "degraded", "a part of the torque that is commanded"
    STUCK_ON = 2, "stuck-on", "full thrust all the time"
    STUCK_AT = 3, "stuck-at", "a part of full thrust all the time"
    LEAKING = 4, "leaking", "never less than a part of full thrust"
    REVERSED = 5, "reversed", "the opposite of the torque that is commanded"
    FRICTION_UP = 6, "friction-up", "the rotor is braked"
    RUNAWAY = 7, "runaway", "full motor torque, which drives the rotor on"
    STOPPED = 8, "stopped", "the rotor stands still"


class Hypotheses(NamedTuple):
    """What may have happened to an actuator.

    `parts` gives the most likely (a, b) of each of `kinds` (kinds, 2, m), from the entries aa, ab
    and bb of the information (3, m), its product with (a, b) (2, m) and the uncertainty of full
    torques.
    Of those that are `free` a number is fitted; the kind `full` makes its full torque, b = `level`
    but for the uncertainty. `tests` are the signs of flow for which there is a CUSUM test, and
    `weak_losses` tells whether small signatures tell of a full loss, too: friction, which holds
    back what little a wheel at rest is commanded, looks like one. An actuator with a failure of a
    kind in `in_service` stays in use, and is diagnosed further.
    """

    kinds: tuple[int, ...]
    free: tuple[int, ...]
    full: int
    level: float
    parts: Callable[
        [Float[Array, "3 m"], Float[Array, "2 m"], RealScalar], Float[Array, "kinds 2 m"]
    ]
    tests: tuple[float, ...] = (1.0,)
    weak_losses: bool = True
    in_service: tuple[int, ...] = ()


def _thruster_parts(information, weighted, uncertainty) -> Float[Array, "kinds 2 m"]:
    """The most likely (a, b) of every kind; b of one stuck on is full thrust as it really is."""
    aa, ab, bb = information
    y, z = weighted
    one, zero = jnp.ones_like(y), jnp.zeros_like(y)
    lost, stuck = _nearest(y, aa), _nearest(z - ab, bb)
    certain = 1 / uncertainty**2
    fully = (z - ab + certain) / (bb + certain)
    leak = _nearest(y + z, aa + 2 * ab + bb)
    return _stacked(
        (one, zero), (lost, zero), (one, fully), (one, stuck), (leak, leak), (2 * one, zero)
    )


def _wheel_parts(information, weighted, uncertainty) -> Float[Array, "kinds 2 m"]:
    """The same of a wheel; b of a runaway is minus its full torque as it really is."""
    aa, ab, bb = information
    y, z = weighted
    one, zero = jnp.ones_like(y), jnp.zeros_like(y)
    lost, braked = _nearest(y, aa), _nearest(z, bb, MOST_FRICTION)
    certain = 1 / uncertainty**2
    driven = (z - ab - certain) / (bb + certain)
    return _stacked((one, zero), (lost, zero), (zero, braked), (one, driven))


def _nearest(value, weight, most: float = 1.0) -> Float[Array, " m"]:
    quotient = value / jnp.where(weight > 0, weight, 1.0)
    return jnp.clip(quotient, LEAST_PART, most)


def _stacked(*pairs) -> Float[Array, "kinds 2 m"]:
    return jnp.stack([jnp.stack(pair) for pair in pairs])


OF_THRUSTERS = Hypotheses(
    kinds=tuple(range(DiagnosedKind.REVERSED + 1)),
    free=(DiagnosedKind.DEGRADED, DiagnosedKind.STUCK_AT, DiagnosedKind.LEAKING),
    full=DiagnosedKind.STUCK_ON,
    level=1.0,
    parts=_thruster_parts,
)
"""Of thrusters that push."""

OF_WHEELS = Hypotheses(
    kinds=(
        DiagnosedKind.DEAD,
        DiagnosedKind.DEGRADED,
        DiagnosedKind.FRICTION_UP,
        DiagnosedKind.RUNAWAY,
    ),
    free=(DiagnosedKind.DEGRADED, DiagnosedKind.FRICTION_UP, DiagnosedKind.RUNAWAY),
    full=DiagnosedKind.RUNAWAY,
    level=-1.0,
    parts=_wheel_parts,
    tests=(1.0, -1.0),
    weak_losses=False,
    in_service=(DiagnosedKind.DEGRADED, DiagnosedKind.FRICTION_UP),
)
"""Of reaction wheels, whose momenta tell of each alone."""
