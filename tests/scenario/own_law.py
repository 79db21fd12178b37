"""A module with laws, sound and broken, and a scenario that flies one of them."""

LAW = """
import jax
import jax.numpy as jnp
from jaxsat.control import AbstractController, AbstractFeedbackLaw
from jaxsat.core.declaration import Finding, LawDeclaration, Rule, choice, number, switch


def _kd_is_large(kp, kd):
    if kd < kp:
        yield Finding("control.kd", f"must be at least kp = {kp}, got {kd}")


class PD(AbstractFeedbackLaw):
    declaration = LawDeclaration(
        summary="quaternion feedback",
        keys=(
            number("kp", "Gain on the attitude", "N m", above=0, tunable=True),
            number("kd", "Gain on the rate", "N m s", above=0, tunable=True),
            number("bias_N_m", "Torque added", "N m", size=3, default=[0.0, 0.0, 0.0]),
            switch("shortest", "Whether to turn the shorter way", True),
            choice("frame", "What is tracked", ("orbit", "inertial"), "orbit"),
        ),
        torques=3,
        rules=(Rule(("control.kp", "control.kd"), _kd_is_large),),
    )
    kp: jax.Array
    kd: jax.Array

    @classmethod
    def from_table(cls, values, context):
        return cls(jnp.asarray(values["kp"]), jnp.asarray(values["kd"]))

    def torque(self, t, state):
        return -self.kp * state.attitude.as_quaternion().q[1:] - self.kd * state.omega


def _raises(kd):
    yield kd + None


class BrokenRule(PD):
    declaration = LawDeclaration(
        summary="", keys=PD.declaration.keys, rules=(Rule(("control.kd",), _raises),)
    )


class NoDeclaration(PD):
    declaration = None


class Abstract(AbstractController):
    declaration = PD.declaration


class Unbuildable(PD):
    @classmethod
    def from_table(cls, values, context):
        return cls(values["kq"], 0)


class Other(PD):
    @classmethod
    def from_table(cls, values, context):
        return 3


class TwoTorques(PD):
    def torque(self, t, state):
        return super().torque(t, state)[:2]


class Broken(PD):
    def torque(self, t, state):
        return self.kp @ state.omega


class WithText(PD):
    frame: str = "orbit"


class NoSuchGain(PD):
    declaration = LawDeclaration(
        summary="",
        keys=(
            number("kp", "Gain", tunable="gain_p"), number("kd", "Gain", tunable=True),
            *PD.declaration.keys[2:],
        ),
        torques=3,
    )


class RateErrorIsANumber(PD):
    def rate_error(self, state):
        return jnp.nan


class LyapunovIsAVector(PD):
    def lyapunov(self, state, memory, unmodelled, unmodelled_rate):
        return state.omega


class Branches(PD):
    def torque(self, t, state):
        return -self.kp * state.omega if state.omega[0] > 0 else -self.kd * state.omega


class Integral(AbstractController):
    declaration = PD.declaration
    kp: jax.Array
    kd: jax.Array
    from_table = classmethod(PD.from_table.__func__)

    def init(self, state):
        return jnp.zeros(3)

    def __call__(self, t, state, memory):
        return -self.kp * memory - self.kd * state.omega, state.omega


class NoMemoryRate(Integral):
    def __call__(self, t, state, memory):
        return -self.kd * state.omega


class OtherMemory(Integral):
    def __call__(self, t, state, memory):
        return -self.kd * state.omega, memory[:2]


class Linear(PD):
    def torque(self, t, state):
        size = jnp.linalg.eigvalsh(jnp.eye(3) + jnp.outer(state.omega, state.omega))
        return super().torque(t, state) / size


def not_a_class():
    pass
"""

SCENARIO = """
title = "Own law"
[spacecraft]
inertia_kg_m2 = [4.0, 5.0, 6.0]
thruster_torque_axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
[orbit]
rate_rad_s = 0.0
[initial]
quaternion = [0.8, 0.6, 0.0, 0.0]
omega_rad_s = [0.0, 0.1, -0.2]
[control]
law = "own_law:PD"
kp = 1.0
kd = 3.0
[simulation]
duration_s = 4
[dispersion.omega_rad_s]
distribution = "uniform"
low = -0.1
high = 0.1
[tuning]
[tuning.parameters.kd]
low = 1.0
high = 10.0
"""
