"""Claims of the note in section 5 on a free third rate."""

import jax.numpy as jnp
import numpy as np
import xarray as xr

from jaxsat.core.tolerances import wrap_angle
from jaxsat.report.reproduction.claim import (
    Claim,
    Datasets,
    decide,
    duration,
    last,
    scenario_of,
    when,
)
from jaxsat.store import is_within, time_to_settle

SMALL_ACCELERATION = 1e-5
"""rad/s². With this much a rate stays small for 100 s; d3 alone makes 3e-6."""


def third_rate_converges(datasets: Datasets) -> Claim:
    """dω3/dt, of which the note speaks, not ω3."""
    changes = {
        name: np.abs(_third_rate_change(datasets[name]))
        for name in ("three-axis", "free", "free-without-d3")
    }
    late = {
        name: float(change[-len(last(datasets[name], 50.0)["time"]) :].mean())
        for name, change in changes.items()
    }
    return Claim(
        "note in section 5",
        "dω3/dt by (37) is small and converges to zero",
        f"mean |dω3/dt| over the last 50 s: {late['free']:.1e} rad/s² with the third rate free, "
        f"{late['free-without-d3']:.1e} without d3 (largest "
        f"{changes['free'].max():.3f}; z wound up to {float(datasets['free']['z'][-1]):.1f} rad). "
        f"Along the run with the third rate held (37) would make {late['three-axis']:.1e}, but up "
        f"to {changes['three-axis'].max():.3f} on the way",
        *decide(
            late["free"] < SMALL_ACCELERATION,
            late["three-axis"] < SMALL_ACCELERATION,
            "the third rate is held, so that (37) is not obeyed; then at the end, not on the way",
        ),
    )


def _third_rate_change(dataset: xr.Dataset) -> np.ndarray:
    """dω3/dt (rad/s²) by (37) from the rates and d3 of a run, whether or not it obeys (37)."""
    j1, j2, j3 = scenario_of(dataset)["spacecraft"]["inertia_kg_m2"]
    rates, d3 = dataset["omega"].values, dataset["disturbance"].values[:, 2]
    return ((j1 - j2) * rates[:, 0] * rates[:, 1] + d3) / j3


def switching_settles(datasets: Datasets) -> Claim:
    """Switching between both laws settles the attitude."""
    plain, rounded = datasets["switching"], datasets["switching-rounded"]
    times = [time_to_settle(dataset) for dataset in (plain, rounded)]
    half = last(plain, duration(plain) / 2)
    rate = np.linalg.norm(half["relative_rate"], axis=1)
    width = scenario_of(rounded)["control"].get("tilt_width", 0.0)
    return Claim(
        "note in section 5",
        "Switching between (38) and (42) repeatedly reaches the stable range",
        f"{_settings(plain)}: {when(times[0])} in {duration(plain):g} s; {_transitions(plain)}; "
        f"over the second half |w| "
        f"up to {float(np.linalg.norm(half['w'], axis=1).max()):.3f}, |z| up to "
        f"{float(np.abs(wrap_angle(jnp.asarray(half['z'].values))).max()):.1e} rad, |ω_r| between "
        f"{rate.min():.1e} and {rate.max():.1e} rad/s (median {np.median(rate):.1e}), within all "
        f"tolerances at {100 * is_within(half).mean():.0f} % of the samples. With |w|² + δ² under "
        f"the fraction of (41), δ = {width:g}, and gains tuned with it: {when(times[1])} of "
        f"{duration(rounded):g} s",
        *decide(
            bool(np.isfinite(times[0])),
            bool(np.isfinite(times[1])),
            "(41) is rounded with δ, which the paper does not do: shown for this start and this "
            "time",
        ),
    )


def _settings(dataset: xr.Dataset) -> str:
    """What a run of the switching law was made with."""
    scenario = scenario_of(dataset)
    control, limit = scenario["control"], scenario["spacecraft"]["torque_limit_N_m"]
    model = "with" if control.get("internal_model", True) else "without"
    return (
        f"Third rate free, tuned gains, thrusters of {limit:g} N m, torque held for "
        f"{control['period_s']:g} s, dω_d/dt by a clipped difference, {model} internal model"
    )


def _transitions(dataset: xr.Dataset) -> str:
    """When the laws took over from each other, and which is at work at the end."""
    mode, time = dataset["mode"].values, dataset["time"].values
    starts = time[np.flatnonzero(np.diff(mode)) + 1]
    final = "(38)" if mode[-1] else "(42)"
    if not len(starts):
        return f"no transition, {final} throughout"
    few = ", ".join(f"{t:.1f}" for t in starts[:4]) + (", …" if len(starts) > 4 else "")
    many = "1 transition" if len(starts) == 1 else f"{len(starts)} transitions"
    return f"{many} (at {few} s), from {starts[-1]:.1f} s on {final} alone"
