"""Claims of the three-axis law (40)-(43)."""

import numpy as np
import xarray as xr

from jaxsat.core.tolerances import SETTLED_BEFORE
from jaxsat.report.reproduction.claim import (
    SMALL_RATE,
    Claim,
    ClaimVerdict,
    Datasets,
    at,
    decide,
    duration,
    last,
    scenario_of,
    when,
)
from jaxsat.store.dataset import time_to_settle

FIGURES_END = 500.0
"""End of the time axis of the paper's figures, s."""

FINAL_PART = 0.1
"""Error allowed in a final rate, over ω0. The tolerance of "settled" is 0.9 of ω0 and too large
here; the paper prints -0.0011 rad/s, two digits."""

SMALL_ANGLE = 15.0
"""Rotation (degrees) up to which attitude changes little: cos 15° is within 4 % of 1."""

AT_ZERO = 1e-4
"""|w| below which ω_d of (41) is taken to have no direction."""


def attitude_changes_little(datasets: Datasets) -> Claim:
    """Judge whether the manoeuvre is small enough for C_bo = I."""
    small, exact = datasets["three-axis"], datasets["three-axis-exact"]
    scalar = np.abs(small["quaternion"][:, 0].values)
    angle = float(np.degrees(2 * np.arccos(np.clip(scalar, 0, 1))).max())
    low = np.flatnonzero(np.linalg.norm(exact["w"], axis=1) < AT_ZERO)
    until = float(exact["time"][low[0]]) if len(low) else duration(exact)
    apart = float(abs(small["w"] - exact["w"]).sel(time=slice(None, until)).max())
    step = scenario_of(exact)["simulation"]["solver"]["min_step_s"]
    sliding = (
        f". From {until:.0f} s on it slides on w = 0, where ω_d has no limit, and depends on the "
        f"smallest step, {step:g} s"
    )
    return Claim(
        "(11)",
        "The attitude changes little, so C_bo may be replaced by the identity",
        f"the manoeuvre turns through {angle:.0f}°. With the identity: "
        f"{when(time_to_settle(small))}. With the exact relation w differs by up to {apart:.2g} "
        f"until {until:.0f} s, {when(time_to_settle(exact))} in {duration(exact):g} s"
        + (sliding if len(low) else ""),
        ClaimVerdict.HOLDS if angle < SMALL_ANGLE else ClaimVerdict.FAILS,
    )


def attitude_settles(datasets: Datasets) -> Claim:
    """Judge whether attitude and rate settle."""
    held, free = datasets["three-axis"], datasets["free"]
    times = [time_to_settle(dataset) for dataset in (held, free)]
    rates = np.linalg.norm(last(free, 50.0)["relative_rate"], axis=1)
    return Claim(
        "(42), Figs. 5-7",
        "The law stabilises attitude and rate rapidly",
        f"third rate held at zero: {when(times[0])} of {duration(held):g} s; at "
        f"{FIGURES_END:g} s {_state(at(held, FIGURES_END))}. {_holding(held)}. Third rate free: "
        f"{when(times[1])} in {duration(free):g} s, over the last 50 s |ω_r| between "
        f"{rates.min():.2f} and {rates.max():.2f} rad/s",
        *decide(
            bool(np.isfinite(times).all()),
            bool(np.isfinite(times[0])),
            "the third rate is taken as zero, as the note in section 5 says; an ideal torque about "
            "the axis without a thruster has to hold it there",
        ),
    )


def _state(instant: xr.Dataset) -> str:
    return (
        f"|w| = {float(np.linalg.norm(instant['w'])):.1e}, z = {float(instant['z']):.1e} rad, "
        f"|ω_r| = {float(np.linalg.norm(instant['relative_rate'])):.1e} rad/s "
        f"(tolerance {SMALL_RATE:g})"
    )


def _holding(dataset: xr.Dataset) -> str:
    if "constraint_torque" not in dataset:
        return "Nothing holds the third rate"
    peak = float(np.abs(dataset["constraint_torque"]).max())
    return (
        f"An ideal torque about the third axis of up to {peak:.1f} N m holds it, "
        f"{float(dataset['constraint_effort']):.0f} N m s in all, beside "
        f"{float(dataset['effort'].sum()):.0f} N m s of the two thrusters"
    )


def final_rate(datasets: Datasets) -> Claim:
    """Judge whether the rate ends at that of the orbit frame."""
    dataset = datasets["three-axis"]
    orbit_rate = scenario_of(dataset)["orbit"]["rate_rad_s"]
    final = np.array([0.0, -orbit_rate, 0.0])
    error = np.abs(dataset["omega"].values - final).max(axis=1) / orbit_rate
    time, end = dataset["time"].values, duration(dataset)
    off = np.flatnonzero(error >= FINAL_PART)
    since = time[off[-1] + 1] if len(off) and off[-1] + 1 < len(time) else np.inf
    since = since if len(off) else 0.0
    mean = last(dataset, 100.0)["omega"].mean("time").values
    largest = float(error[time >= end - 100].max())
    ends = [float(at(dataset, t)["omega"][1]) for t in (FIGURES_END, end)]
    parts = [100 * abs(rate / orbit_rate + 1) for rate in ends]
    return Claim(
        "(42), Fig. 5b",
        "The final rate is (0, -ω0, 0)",
        f"third rate held: at {FIGURES_END:g} s, where the figure ends, ω2 = {ends[0]:.1e} rad/s, "
        f"off by {parts[0]:.0f} % of ω0; at {end:g} s {ends[1]:.2e} rad/s, "
        f"off by {parts[1]:.0f} %. "
        + (
            f"All components within {100 * FINAL_PART:g} % of ω0 from {since:g} s on"
            if since <= SETTLED_BEFORE * end
            else f"It does not stay within {100 * FINAL_PART:g} % of ω0 from any instant before "
            f"{SETTLED_BEFORE * end:g} s"
        )
        + f": over the last 100 s ω2 is {mean[1]:.2e} rad/s on average, and the rate off by up to "
        f"{largest * 100:.0f} %",
        *decide(
            bool(since <= FIGURES_END),
            bool(np.abs(mean - final).max() < FINAL_PART * orbit_rate),
            f"it means the average over the last 100 s of {end:g} s, third rate held",
        ),
    )


def lyapunov_decreases(datasets: Datasets) -> Claim:
    """Judge whether V of the proof never rises."""
    dataset = datasets["three-axis"]
    value = dataset["lyapunov"].values
    rise = float(np.diff(value).max())
    return Claim(
        "(43), proof of (42)",
        "The Lyapunov function V never increases",
        f"third rate held: from {value[0]:.4g} to {value[-1]:.2g} N m over "
        f"{duration(dataset):g} s; largest rise between two saved instants {max(rise, 0):.1e} N m",
        ClaimVerdict.HOLDS if rise < 1e-6 * value[0] else ClaimVerdict.FAILS,
    )


def disturbance_is_cancelled(datasets: Datasets) -> Claim:
    """Judge whether the internal model makes the late rates much smaller."""
    with_it, without, strong_with, strong_without = (
        float(np.abs(last(datasets[name], 100.0)["relative_rate"]).max())
        for name in (
            "three-axis",
            "three-axis-no-internal-model",
            "strong",
            "strong-no-internal-model",
        )
    )
    printed_gain, raised_gain = (
        scenario_of(datasets[name])["control"]["k4"] for name in ("three-axis", "strong")
    )
    end = duration(datasets["three-axis"])
    return Claim(
        "(42), section 5",
        "The internal model eliminates the effect of the disturbance",
        f"third rate held, largest |ω_ri| over the last 100 s of {end:g} s with it and without: "
        f"{with_it:.1e} and {without:.1e} rad/s for k4 = {printed_gain:g} N m s as printed, "
        f"{strong_with:.1e} and {strong_without:.1e} for k4 = {raised_gain:g}",
        *decide(
            with_it < without / 10,
            strong_with < strong_without / 10,
            f"k4 is raised, here to {raised_gain:g} N m s; the printed gain is too slow for "
            f"{end:g} s",
        ),
    )
