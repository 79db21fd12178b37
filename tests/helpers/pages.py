"""Runs made by hand: a page is made of what is in a file, however it came there."""

import base64
import json
import re

import numpy as np
import xarray as xr

from jaxsat.store.dataset import pointing

SCENARIO = """
title = "A run"
[spacecraft]
inertia_kg_m2 = [0.3, 0.55, 0.62]
[[thruster]]
name = "up"
position_m = [0.1, 0.1, 0.15]
direction = [-1.0, 1.0, -2.0]
two_sided = true
[[thruster]]
torque_axis = [0.0, 0.0, 2.0]
failed = true
[[wheel]]
axis = [0.0, 3.0, 0.0]
momentum_limit_N_m_s = 4.0
[[failure]]
of = "thruster up"
at_s = 3.5
kind = "dead"
[control]
law = "three-axis"
[simulation]
duration_s = 10.0
"""


def body_about(axis, angle):
    """Unit quaternions (n, 4) of rotations by angles (n,) about an axis."""
    axis = np.asarray(axis) / np.linalg.norm(axis)
    return np.concatenate([np.cos(angle / 2)[:, None], np.sin(angle / 2)[:, None] * axis], 1)


def run_dataset(samples=101, *, scenario=SCENARIO, title="A run", settled=6.25, **more):
    """A body that turns about a skew axis for 10 s, with thrusters, a wheel and two phases."""
    time = np.linspace(0.0, 10.0, samples)
    quaternion = body_about([1.0, 2.0, 3.0], 2.0 * np.exp(-time / 3))
    omega = np.stack([np.sin(time), np.cos(time), 0 * time], 1)

    def signal(values, units="1", axis=None, name="a signal"):
        dims = ("time",) if axis is None else ("time", axis)
        return xr.Variable(dims, values, {"units": units, "long_name": name})

    mode = signal((time > 5).astype(float))
    mode.attrs |= {"flag_values": np.array([0.0, 1.0]), "flag_meanings": "slew hold_still"}
    variables = {
        "w": signal(np.zeros((samples, 2)), "1", "w_component"),
        "z": signal(np.exp(-time), "rad"),
        "quaternion": signal(quaternion, "1", "quaternion_component"),
        "omega": signal(omega, "rad s-1", "body_axis"),
        "torque": signal(0.1 * omega, "N m", "body_axis"),
        "lyapunov": signal(np.full(samples, np.nan), "J"),
        "mode": mode,
        "thrust_level": signal(np.abs(omega[:, :2]), "1", "thruster", "mean thrust"),
        "wheel_momentum": signal(2 * omega[:, [0]], "N m s", "wheel", "wheel momentum"),
        "settled_from": xr.Variable((), settled, {"units": "s"}),
        **pointing(quaternion),
        **more,
    }
    attributes = {
        "title": title,
        "scenario": scenario,
        "outcome": "SUCCESS",
        "outcome_code": 0,
        "outcome_explanation": "reached the end",
        "jaxsat_version": "0.1.0",
        "created": "2026-01-01T00:00:00+00:00",
    }
    return xr.Dataset(variables, {"time": time}, attributes)


def json_of(page, identity):
    """What a page holds as JSON under an id."""
    found = re.search(rf'<script type="application/json" id="{identity}">(.*?)</script>', page)
    return json.loads(found.group(1))


def array(text, kind="<f8"):
    return np.frombuffer(base64.b64decode(text), kind)
