"""Tubes that enclose all flights, against 10,000 of these flights.

    python benchmarks/enclosures.py

prints for each loop whether the flights are in the tube, how wide it is against their spread, and
processor seconds; of the contest's loop also whether it is proved to avoid the unsafe set.
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxsat
from jaxsat.control.quaternion_feedback import QuaternionFeedback
from jaxsat.control.rate import RateLaw
from jaxsat.core.attitude import Quaternion
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft

UNSAFE = ([-0.2, -0.5, 0.0, -0.7, 0.7, -0.4], [0.0, -0.4, 0.2, -0.6, 0.8, -0.2])
"""Unsafe set of the contest's loop."""


class Loop(NamedTuple):
    """A sampled loop and its starts: the arguments of `jaxsat.enclose`."""

    dynamics: Callable
    controller: Callable
    start: tuple[np.ndarray, np.ndarray]
    period: float
    periods: int


def layers() -> list[tuple[np.ndarray, np.ndarray]]:
    """Weights and biases of the contest's network; `notice` in the file has source and licence."""
    with np.load(Path(__file__).with_name("attitude_control.npz")) as file:
        return [(file[f"weights_{k}"], file[f"biases_{k}"]) for k in range(4)]


def contest() -> Loop:
    """Attitude control of ARCH-COMP's category AINNCS.

    Three torques on a rigid body, from a network of three layers of 64 sigmoids, at 10 Hz for 3 s
    (D. Manzanas Lopez et al., ARCH22; dynamics: S. Prajna, P. A. Parrilo and A. Rantzer, IEEE
    Transactions on Automatic Control 49(2), 2004). The state is rates and Rodrigues parameters psi,
    whose rate has |psi|² times the sum of the rates, as in the contest's files, in place of psi
    times psi's product with the rates, which a rigid body has.
    """
    network = [(weights.astype(float), biases.astype(float)) for weights, biases in layers()]

    def controller(x):
        for weights, biases in network[:-1]:
            x = jax.nn.sigmoid(weights @ x + biases)
        return network[-1][0] @ x + network[-1][1]

    def dynamics(x, u):
        omega, psi = x[:3], x[3:]
        product = jnp.stack([omega[1] * omega[2], omega[0] * omega[2], omega[0] * omega[1]])
        rate = jnp.array([0.25, 0.5, 1.0]) * (u + jnp.array([1.0, -3.0, 2.0]) * product)
        turning = omega + jnp.cross(psi, omega) + (psi @ psi) * jnp.sum(omega)
        return jnp.concatenate([rate, turning / 2])

    low = np.array([-0.45, -0.55, 0.65, -0.75, 0.85, -0.65])
    high = np.array([-0.44, -0.54, 0.66, -0.74, 0.86, -0.64])
    return Loop(dynamics, controller, (low, high), 0.1, 30)


def slew(period: float = 0.5, periods: int = 200, width: float = 0.01) -> Loop:
    """Quaternion feedback of a body with three ideal torques from 65 degrees, for 100 s.

    The state is the vector part of the quaternion, and rates (rad/s).
    """
    body = Spacecraft([[3.0, 0.2, -0.1], [0.2, 2.0, 0.15], [-0.1, 0.15, 4.0]])
    model = RigidBody(body, ExactOrbit(0.0011))
    law = QuaternionFeedback(
        model=model, natural_frequency=0.2, damping=0.7, max_rate=np.inf, period=period
    )

    def attitude(x):
        return Quaternion(jnp.concatenate([jnp.sqrt(1 - x[:3] @ x[:3])[None], x[:3]]))

    def dynamics(x, u):
        relative_rate = model.relative_rate(PlantState(attitude(x), x[3:]))
        turning = attitude(x).rate(relative_rate).q[1:]
        return jnp.concatenate([turning, model.angular_acceleration(x[3:], u)])

    def controller(x):
        state = PlantState(attitude(x), x[3:])
        return law.step(jnp.zeros(()), state, law.init(state))[0]

    middle = np.array([0.4, -0.3, 0.2, 0.02, -0.01, 0.03])
    return Loop(dynamics, controller, (middle - width / 2, middle + width / 2), period, periods)


def rate(period: float = 0.1, periods: int = 100, width: float = 0.0025) -> Loop:
    """The rate law (38)-(39) by two torques with its corner rounded over 2e-4 rad/s, for 10 s.

    The body is the paper's, the gains are those of `switching-rounded`. The state is rates, rad/s.
    """
    model = RigidBody(Spacecraft([449.5, 264.6, 312.5]), ExactOrbit(0.0011))
    law, start = RateLaw(model, 1.02, 0.496, 2e-4), np.array([0.1, -0.11, 0.1])

    def dynamics(x, u):
        return model.angular_acceleration(x, jnp.concatenate([u, jnp.zeros(1)]))

    def controller(x):
        state = PlantState(Quaternion(jnp.array([1.0, 0.0, 0.0, 0.0])), x)
        return law(jnp.zeros(()), state, None)[0]

    return Loop(dynamics, controller, (start - width / 2, start + width / 2), period, periods)


def three_axis(period: float = 0.1, periods: int = 160, width: float = 0.01) -> Loop:
    """The three-axis law (40)-(42) with tanh for sat and |w|² + δ² under its fraction, for 16 s.

    The third rate is held at 0, (11) is that of small angles, the body is the paper's, and the
    gains are those of `switching-rounded`. The state is w, z, and two rates (rad/s); w stays away
    from 0.
    """
    moments, orbit_rate = jnp.array([449.5, 264.6]), jnp.array([0.0, 0.0011])
    k3, mu, bound, k4, weight, tilt = 0.0622, 0.232, 0.341, jnp.array([48.9, 521.0]), 2.41, 0.0201

    def kinematics(x):
        w, rate = x[:2], x[3:] + orbit_rate
        turning = (1 - w @ w) / 2 * rate + w * (w @ rate)
        return jnp.concatenate([turning, (w[0] * rate[1] - w[1] * rate[0])[None]])

    def dynamics(x, u):
        return jnp.concatenate([kinematics(x), u / moments])

    def reference(attitude):
        w, z = attitude[:2], attitude[2]
        across = jnp.stack([w[1], -w[0]])
        steering = bound * jnp.tanh(z / (w @ w + tilt**2) * across / bound)
        return mu * steering - k3 * w / (1 + w @ w) - orbit_rate

    def controller(x):
        w, z = x[:2], x[2]
        wanted, change = jax.jvp(reference, (x[:3],), (kinematics(x),))
        pull = jnp.stack([w[1], -w[0]]) * z - w * (1 + w @ w)
        return weight * pull - k4 * (x[3:] - wanted) + moments * change

    middle = np.array([-1.0, 1.0, 1.27, 0.1, -0.11])
    return Loop(dynamics, controller, (middle - width / 2, middle + width / 2), period, periods)


def flights(loop: Loop, count: int = 10_000, substeps: int = 10) -> np.ndarray:
    """Return the states of flights at all samples, from all corners and random starts."""
    low, high = loop.start
    size = len(low)
    draws = np.random.default_rng(0).uniform(size=(count, size))
    draws[: 2**size] = np.stack(np.meshgrid(*[[0, 1]] * size), -1).reshape(-1, size)
    rate, command = jax.vmap(loop.dynamics), jax.vmap(loop.controller)
    step = loop.period / substeps

    def sample(x, _):
        u = command(x)

        def runge_kutta(x, _):
            first = rate(x, u)
            second = rate(x + step / 2 * first, u)
            third = rate(x + step / 2 * second, u)
            fourth = rate(x + step * third, u)
            return x + step / 6 * (first + 2 * second + 2 * third + fourth), None

        x, _ = jax.lax.scan(runge_kutta, x, None, length=substeps)
        return x, x

    start = low + draws * (high - low)
    _, states = jax.jit(lambda x: jax.lax.scan(sample, x, None, length=loop.periods))(start)
    return np.concatenate([start[None], np.asarray(states)])


LOOPS = {"contest": contest, "slew": slew, "rate": rate, "three-axis": three_axis}
"""Loops by name."""


def main() -> None:
    """Print a row for each loop."""
    jax.config.update("jax_enable_x64", True)
    print("| loop | flights in the tube | width against spread, largest and at the end | seconds |")
    for name, make in LOOPS.items():
        loop, begin = make(), time.process_time()
        tube = jaxsat.enclose(*loop)
        seconds = time.process_time() - begin
        states = flights(loop)
        inside = (states >= tube.lower[:, None]) & (states <= tube.upper[:, None])
        ratio = (tube.upper - tube.lower) / np.ptp(states, axis=1)
        ratios = f"{ratio.max():.3f}, {ratio[-1].max():.3f}"
        print(f"| {name} | {bool(inside.all())} | {ratios} | {seconds:.1f} |")
        if name == "contest":
            print("proved" if tube.avoids(UNSAFE) else "not proved")


if __name__ == "__main__":
    main()
