"""Declaration of a control law."""

from dataclasses import dataclass
from typing import Any, Literal

from jaxsat.core.declaration.domain import Sweep
from jaxsat.core.declaration.keys import Key, Rule, number, require_own_keys
from jaxsat.core.ranges import SECONDS

OF_ALL_LAWS = ("law", "model", "measured_disturbance")
"""Keys of `[control]` with the same meaning under every law."""


@dataclass(frozen=True)
class LawDeclaration:
    """Everything that a scenario, its checks, tuning and the commands need to know of a law.

    - `summary`: one line that describes the law.
    - `keys`: the law's own keys of `[control]`. A sampled law has `period_s` among them.
    - `torques`: 2 for a law that commands (u1, u2) about body x and y, 3 for one that commands a
      torque about each body axis, which takes three independent thrusters, 1 for one that commands
      a torque about the only remaining axis, `jaxsat.core.allocation.torque_axis`, 0 for none.
    - `any_plane`: the two torques are about `jaxsat.core.allocation.torque_directions` of the
      remaining thrusters, or of wheels alone, in any plane, instead of body x and y.
    - `commands_actuators`: the law allocates its torques itself and commands the duty of each
      `[[thruster]]` and the torque of each `[[wheel]]`.
    - `steers`: kinds of actuators with a steering of their own that such a law also commands.
    - `has_model`: whether the table `[control.model]` may give the controller's model.
    - `measures_disturbance`: whether the key `measured_disturbance` may add the periodic
      disturbance to the model.
    - `ordered`: pairs of keys of which the first must not exceed the second.
    - `rules`: further rules across keys.
    - `needs_torque_limit`: the thrusters must be limited.
    - `takes_orbits`: the motion depends on the place in the orbit, so its unit of time is 1/ω0.
    - `needs_unequal_moments`: the law moves ω3 through (J1 - J2) ω1 ω2 alone.
    - `needs_gyroscopic_torque`: the law moves the third axis by the gyroscopic torque of a body
      without wheels, which the momentum of wheels that make its torques changes.
    - `tracks_rates`: the law tracks reference rates as in (43), a subclass of
      `AbstractBacksteppingLaw`, so that its loop may be integrated in error coordinates.
    - `works_in_wz`: the law uses (w, z), which are singular upside down.
    - `regulates_attitude`: whether settling is judged by attitude and rate, or by rate alone.
    - `jumps_without`: widths that must be above 0, or the commanded torque jumps, which fixed steps
      do not suit.
    - `searched`: for a law without gradients, as it searches in flight: the keys that
      `jaxsat design` tunes by a derivative-free search. Empty for all others.
    - `domain`: the verified domain of the law, one dimensionless number at a time.
    """

    summary: str
    keys: tuple[Key, ...] = ()
    torques: Literal[0, 1, 2, 3] = 2
    any_plane: bool = False
    commands_actuators: bool = False
    steers: tuple[str, ...] = ()
    has_model: bool = True
    measures_disturbance: bool = False
    ordered: tuple[tuple[str, str], ...] = ()
    rules: tuple[Rule, ...] = ()
    needs_torque_limit: bool = False
    takes_orbits: bool = False
    needs_unequal_moments: bool = False
    needs_gyroscopic_torque: bool = False
    tracks_rates: bool = False
    works_in_wz: bool = False
    regulates_attitude: bool = True
    jumps_without: tuple[str, ...] = ()
    searched: tuple[str, ...] = ()
    domain: tuple[Sweep, ...] = ()

    def __post_init__(self):
        require_own_keys(self.keys, "law", OF_ALL_LAWS)

    @property
    def sampled(self) -> bool:
        """Whether the law runs once a period and its torque is held in between."""
        return any(key.name == "period_s" for key in self.keys)

    @property
    def tunable(self) -> dict[str, str]:
        """Tunable keys, and their attributes in the law."""
        return {key.name: key.tunable for key in self.keys if key.tunable is not None}

    @property
    def widths(self) -> tuple[str, ...]:
        """Keys that round corners."""
        return tuple(key.name for key in self.keys if key.width)


def control_period(default: Any = ..., remark: str = "") -> Key:
    """Declare the key of a sampled law's period, with a remark after its meaning."""
    meaning = f"Time between two runs of the controller{remark}"
    return number("period_s", meaning, within=SECONDS, default=default)
