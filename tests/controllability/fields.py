"""Vector fields of a general body, and states to evaluate them at."""

import jax.numpy as jnp
import numpy as np

from jaxsat.controllability.lie import DriftField, control_fields, pack

JA = np.array([[9.0, 0.5, -0.3], [0.5, 5.0, 0.8], [-0.3, 0.8, 7.0]])


def random_state(seed, time=None):
    rng = np.random.default_rng(seed)
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    q = q * np.linalg.det(q)
    return pack(jnp.asarray(q), jnp.asarray(rng.normal(size=3)), time)


def paper_cross(x):
    return jnp.array([[0, x[2], -x[1]], [-x[2], 0, x[0]], [x[1], -x[0], 0]])


def rotating_disturbance(time):
    return jnp.array([0.3, -0.2, 0.1]) * jnp.sin(jnp.array([0.7, 0.8, 0.1]) * time + 0.4)


def fields(**options):
    drift = DriftField(jnp.asarray(JA), **options)
    controls = control_fields(jnp.asarray(JA), jnp.array([[1.0, 0.3], [0.2, -1.0], [0.5, 0.4]]))
    return drift, *controls
