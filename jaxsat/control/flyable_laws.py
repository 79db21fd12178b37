"""Laws that fly with the actuators that still work.

One table serves the law `fault-tolerant`, the verdicts of `controllability`, studies of failures
and the candidates of `design`.
"""

from collections.abc import Mapping
from typing import Literal, NamedTuple

from jaxsat.control.tolerant_actuators import TolerantMode

Laws = Literal["three torques", "two torques", "two wheels", "nearest attitude", "magnetic", "none"]


class FlyableLaws(NamedTuple):
    """Laws for one class of remaining torques.

    `words` is the printed sentence, `modes` the modes of the law `fault-tolerant`, `laws` the
    candidates of `design`, and `everywhere` whether they reach every attitude.
    """

    words: str
    modes: tuple[TolerantMode, ...]
    laws: tuple[str, ...]
    everywhere: bool = True


FLYABLE: Mapping[Laws, FlyableLaws] = {
    "three torques": FlyableLaws(
        "every law applies; the allocation distributes its torque among the actuators",
        (TolerantMode.THREE_AXES, TolerantMode.REALLOCATED),
        ("quaternion-feedback",),
    ),
    "two torques": FlyableLaws(
        "the laws for two torques apply, in the plane of the torques of both signs; so does the "
        "law fault-tolerant, for tables [[thruster]], which leaves a wheel beside them idle",
        (
            TolerantMode.STOPPING,
            TolerantMode.SLEWING,
            TolerantMode.OSCILLATING,
            TolerantMode.HOLDING,
        ),
        ("three-slew", "oscillatory", "planned", "fault-tolerant"),
    ),
    "two wheels": FlyableLaws(
        "the laws for two torques apply, by wheels without momentum about their normal, and the "
        "law fault-tolerant",
        (TolerantMode.TWO_WHEELS,),
        ("fault-tolerant", "three-axis", "three-slew"),
    ),
    "nearest attitude": FlyableLaws(
        "the law fault-tolerant applies; with their momentum two wheels hold some attitudes, and "
        "it goes to the one nearest to the target, unless the momentum would turn the body faster "
        "than a slew may",
        (TolerantMode.NEAREST,),
        ("fault-tolerant",),
        everywhere=False,
    ),
    "magnetic": FlyableLaws(
        "the laws magnetic and fault-tolerant apply; all axes are held as the field turns in the "
        "orbit",
        (
            TolerantMode.RODS,
            TolerantMode.MAGNETIC_DAMPING,
            TolerantMode.MAGNETIC_SLEWING,
            TolerantMode.MAGNETIC_POINTING,
        ),
        ("magnetic", "fault-tolerant"),
    ),
    "none": FlyableLaws("no law of jaxsat applies", (TolerantMode.DAMPING,), (), everywhere=False),
}
"""Laws by remaining torques: of either sign about three axes or in a plane; of two wheels without
momentum about their normal, or with it for a target at rest; of magnetorquers over an orbit, alone
or with wheels; or less."""
