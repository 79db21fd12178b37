"""What the actuators that are left allow, and what flies with it.

One table for all: the law `fault-tolerant` in flight, the verdicts of `controllability`, studies of
failures, and the candidates of `design`.
"""

from collections.abc import Mapping
from typing import Literal, NamedTuple

from jaxsat.control.tolerant_actuators import TolerantMode

Laws = Literal["three torques", "two torques", "two wheels", "nearest attitude", "magnetic", "none"]


class WhatFlies(NamedTuple):
    """What flies with what is left.

    `words` say which laws apply, `modes` what the law `fault-tolerant` does where it takes the
    actuators, `laws` which ones `design` tries, and `everywhere` whether they reach every attitude.
    """

    words: str
    modes: tuple[TolerantMode, ...]
    laws: tuple[str, ...]
    everywhere: bool = True


LEFT: Mapping[Laws, WhatFlies] = {
    "three torques": WhatFlies(
        "every law applies; the allocation distributes its torque among the actuators",
        (TolerantMode.THREE_AXES, TolerantMode.REALLOCATED),
        ("quaternion-feedback",),
    ),
    "two torques": WhatFlies(
        "the laws for two torques apply, in the plane of the torques of both signs",
        (
            TolerantMode.STOPPING,
            TolerantMode.SLEWING,
            TolerantMode.OSCILLATING,
            TolerantMode.HOLDING,
        ),
        ("three-slew", "oscillatory", "planned"),
    ),
    "two wheels": WhatFlies(
        "the law fault-tolerant and the laws for two torques apply, by wheels without momentum "
        "about their normal",
        (TolerantMode.TWO_WHEELS,),
        ("fault-tolerant", "three-axis", "three-slew"),
    ),
    "nearest attitude": WhatFlies(
        "the law fault-tolerant applies; with their momentum two wheels hold some attitudes, and "
        "it goes to the one nearest to the target, unless the momentum would turn the body faster "
        "than a slew may",
        (TolerantMode.NEAREST,),
        ("fault-tolerant",),
        everywhere=False,
    ),
    "magnetic": WhatFlies(
        "the laws magnetic and fault-tolerant apply; all axes are held as the field turns in the "
        "orbit",
        (
            TolerantMode.RODS,
            TolerantMode.MAGNETIC_DAMPING,
            TolerantMode.MAGNETIC_SLEWING,
            TolerantMode.MAGNETIC_POINTING,
        ),
        ("magnetic",),
    ),
    "none": WhatFlies("no law of jaxsat applies", (TolerantMode.DAMPING,), (), everywhere=False),
}
"""By the torques that are left: of either sign about three axes or in a plane; by two wheels
without momentum about their normal, or with it while the target stands still; by magnetorquers,
alone or with wheels, over an orbit; or less."""
