"""Results of a run: outcome, signals and trajectory."""

import dataclasses
import enum
from collections.abc import Mapping
from typing import NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from jaxsat.core.array_types import IntScalar
from jaxsat.simulation.assessment import Assessment, IntegrationError


class ExplainedCode(enum.IntEnum):
    """A code with its `explanation`, one clause for a person."""

    explanation: str

    def __new__(cls, number: int, explanation: str) -> "ExplainedCode":
        """Make a member, which is declared as a tuple of these arguments."""
        member = int.__new__(cls, number)
        member._value_, member.explanation = number, explanation
        return member


class Outcome(ExplainedCode):
    """Outcome of a run; any other than `SUCCESS` leaves NaN after the end of the run."""

    SUCCESS = 0, "reached the end"
    STATE_LIMIT = 1, "a state passed its limit or became NaN"
    MAX_STEPS = 2, "used up its number of steps"
    STEP_UNDERFLOW = 3, "needed a step below the smallest that time can resolve"
    IMPOSSIBLE_CASE = 4, "never began: its dispersions gave what no spacecraft can have"


class TorqueRange(eqx.Module):
    """Range of the torque of all actuators (N m) from each saved time to the next, over all holds.

    `mean` is weighted by time. At the last time all three are the torque there.
    """

    least: Float[Array | np.ndarray, "*times 3"]
    largest: Float[Array | np.ndarray, "*times 3"]
    mean: Float[Array | np.ndarray, "*times 3"]


class Signals(eqx.Module):
    """Signals of a run at one instant; body axes, SI units, angles in rad.

    `torque` is the torque of all effectors, `constraint_torque` the ideal torque about the third
    axis that holds the third rate, None where that is free, `rate_error` is η of the active law,
    `mode` the number of the active part of a sampled controller (zero for continuous controllers).
    `torque_unmade` is the commanded torque beyond the actuators' limits, None where the law
    commands devices. Of thrusters that push, `torque` is the mean over the period that begins here.
    Only engines fill `torque_range`, of sampled loops.

    `parts` contains the signals of effectors, estimator and law by name: the signals that actuators
    declare, such as `wheel_momentum` (N m s); with `jaxsat.control.navigation` truth less estimate
    of attitude (rotation vector), rate and gyro bias ("rate_estimate_error"), and three times the
    standard deviations that the estimator computes ("rate_estimate_3sigma"). A law that diagnoses
    actuators gives for each the `DiagnosedKind` (`diagnosed_kind`), -1 for one that works, and its
    CUSUM statistic over the threshold (`detection_statistic`); `alarm` is 1 while the cause of an
    alarm is being isolated. With a leading axis the arrays are a history.
    """

    w: Float[Array, "*times 2"]
    z: Float[Array, "*times"]
    quaternion: Float[Array, "*times 4"]
    omega: Float[Array, "*times 3"]
    relative_rate: Float[Array, "*times 3"]
    torque: Float[Array, "*times 3"]
    disturbance: Float[Array, "*times 3"]
    rate_error: Float[Array, "*times 2"]
    lyapunov: Float[Array, "*times"]
    mode: Float[Array, "*times"]
    constraint_torque: Float[Array, "*times"] | None = None
    torque_unmade: Float[Array, "*times 3"] | None = None
    torque_range: TorqueRange | None = None
    parts: dict[str, Array | np.ndarray] = eqx.field(default_factory=dict)

    def with_parts(self, *parts: Mapping[str, Array | np.ndarray]) -> "Signals":
        """The signals with these parts added to their own."""
        additions = {name: value for one in parts for name, value in one.items()}
        return dataclasses.replace(self, parts=self.parts | additions)


class Details(NamedTuple):
    """The loop's own state at the end of the run, the number of its steps, the time from which its
    inertial rate alone was within the tolerance (s, infinite if never), and ∫|T_i| dt by body axis
    and of the ideal torque that holds the third rate, None where that is free (N m s); NaN where
    the run did not reach its end. `forced` counts adaptive steps taken in spite of their error."""

    final: PyTree
    steps: Int[Array, "*n"]
    at_rest_from: Float[Array, "*n"]
    effort: Float[Array, "*n 3"]
    constraint_effort: Float[Array, "*n"] | None
    forced: Int[Array, "*n"] | None = None


class Trajectory(eqx.Module):
    """The history of one run at the requested times.

    `final` is the loop's own state at the last of these times, from which a run can resume.
    `assessment` covers the whole run and does not depend on the times between its ends.
    `torque_range` is the range of a sampled loop's torque between these times, over all holds; None
    for other loops. `integration_error` is the estimate of equal steps; None for adaptive steps,
    which meet their tolerances.
    """

    times: Float[Array, " times"]
    signals: Signals
    final: PyTree
    code: IntScalar
    steps: IntScalar
    assessment: Assessment
    torque_range: TorqueRange | None = None
    integration_error: IntegrationError | None = None

    @property
    def outcome(self) -> Outcome:
        """The outcome of the run."""
        return Outcome(int(self.code))
