"""Each claim of the paper's section 5: what it says, the number found, and whether it holds.

A claim is judged from trajectory datasets alone. Nothing here knows how the numbers come out.
"""

import enum
import tomllib
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import xarray as xr

from jaxsat.metrics import wrapped
from jaxsat.results import is_within, time_to_settle

SMALL_RATE = 1e-3
"""rad/s. A rate below this counts as zero, as in the definition of settled."""

SMALL_ACCELERATION = 1e-5
"""rad/s². With this much a rate stays small for 100 s; d3 alone makes 3e-6."""

FINAL_PART = 0.25
"""Part of ω0 by which a final rate may be off."""

SMALL_ANGLE = 15.0
"""Degrees up to which an attitude may be said to change little: cos 15° is within 4 % of 1."""

Datasets = Mapping[str, xr.Dataset]


class Verdict(enum.Enum):
    """What became of a claim."""

    HOLDS = "holds"
    ONLY_IF = "holds only if"
    FAILS = "does not hold"


class Claim(NamedTuple):
    """A claim of the paper and what simulation says of it."""

    source: str
    statement: str
    found: str
    verdict: Verdict
    condition: str = ""

    @property
    def verdict_text(self) -> str:
        """The verdict with its condition."""
        return f"{self.verdict.value} {self.condition}".strip()


def judge(datasets: Datasets) -> list[Claim]:
    """All claims, in the order of the paper, from the runs named in `jaxsat.reproduction.RUNS`."""
    return [claim(datasets) for claim in _CLAIMS]


def _decide(holds: bool, holds_if: bool, condition: str) -> tuple[Verdict, str]:
    if holds:
        return Verdict.HOLDS, ""
    return (Verdict.ONLY_IF, condition) if holds_if else (Verdict.FAILS, "")


def _third_rate_decays(datasets: Datasets) -> Claim:
    dataset = datasets["rate-without-d3"]
    scenario = _scenario(dataset)
    j1, j2, j3 = scenario["spacecraft"]["inertia_kg_m2"]
    predicted = scenario["control"]["k1"] * abs(j1 - j2) / j3
    part = dataset.sel(time=slice(1.0, 5.0))
    slope = np.polyfit(part["time"], np.log(np.abs(part["omega"][:, 2])), 1)[0]
    small = np.abs(datasets["rate"]["omega"][:, 2].values) < SMALL_RATE
    first = float(datasets["rate"]["time"][np.argmax(small)])
    return Claim(
        "(38), Fig. 3",
        "The reference (38) makes ω3 decay",
        f"decay at {-slope:.4f} 1/s where (38) predicts {predicted:.4f}; "
        f"|ω3| below {SMALL_RATE:g} rad/s at {first:.1f} s",
        Verdict.HOLDS if abs(-slope / predicted - 1) < 1e-2 else Verdict.FAILS,
    )


def _rates_reach_zero(datasets: Datasets) -> Claim:
    worst = {name: _worst_rate(datasets[name], 50.0) for name in ("rate", "rate-without-d3")}
    return Claim(
        "(39), Fig. 3b",
        "The rates are close to zero at 500 s",
        f"largest |ω_i| over the last 50 s: {worst['rate']:.2e} rad/s; "
        f"without d3 {worst['rate-without-d3']:.1e} (close to zero: below {SMALL_RATE:g})",
        *_decide(
            worst["rate"] < SMALL_RATE,
            worst["rate-without-d3"] < SMALL_RATE,
            "no disturbance acts on the third axis",
        ),
    )


def _burr(datasets: Datasets) -> Claim:
    late = slice(20.0, 70.0)
    coarse, quiet, fine = (
        float(np.abs(datasets[name].sel(time=late)["torque"]).max())
        for name in ("rate", "rate-without-d3", "rate-fine")
    )
    first = datasets["rate"]["torque"][0].values
    grows = fine > 2 * coarse
    return Claim(
        "(39), Fig. 4",
        "The torque has a slight burr, caused by the disturbance",
        f"starts at {first[0]:.1f} and {first[1]:.1f} N m; from 20 s to 70 s up to "
        f"{coarse:.3g} N m saved every 0.1 s and {fine:.3g} N m every 0.001 s, "
        f"without d3 {quiet:.2g} N m: "
        + ("spikes without bound where ω3 crosses zero" if grows else "bounded"),
        *_decide(
            not grows and coarse > 2 * quiet,
            grows and fine > 2 * quiet,
            "any size counts as slight: d3 causes it, and it grows the closer one looks",
        ),
    )


def _final_rate(datasets: Datasets) -> Claim:
    dataset = datasets["three-axis"]
    orbit_rate = _scenario(dataset)["orbit"]["rate_rad_s"]
    final = np.array([0.0, -orbit_rate, 0.0])
    error = np.abs(dataset["omega"].values - final).max(axis=1) / orbit_rate
    time = dataset["time"].values
    at_500 = int(np.searchsorted(time, 500.0))
    off = np.flatnonzero(error >= FINAL_PART)
    inside = len(off) == 0 or off[-1] + 1 < len(time)
    since = float(time[off[-1] + 1 if len(off) else 0]) if inside else np.inf
    late = float(error[time > time[-1] - 100].max())
    return Claim(
        "(42), Fig. 5b",
        "The final rate is (0, -ω0, 0)",
        f"at 500 s, where the figure ends, ω2 = {float(dataset['omega'][at_500, 1]):.1e} rad/s, "
        f"off by {100 * error[at_500]:.0f} % of ω0; "
        + (
            f"all components within {100 * FINAL_PART:g} % of ω0 from {since:g} s on"
            if inside
            else f"not within {100 * FINAL_PART:g} % of ω0 in {time[-1]:g} s"
        )
        + f"; over the last 100 s of {time[-1]:g} s off by up to {100 * late:.1f} %",
        *_decide(since <= 500.0, inside, f"one waits until {since:g} s, third rate held"),
    )


def _attitude_settles(datasets: Datasets) -> Claim:
    held, free = datasets["three-axis"], datasets["free"]
    times = [time_to_settle(dataset) for dataset in (held, free)]
    at_500 = held.isel(time=int(np.searchsorted(held["time"], 500.0)))
    return Claim(
        "(42), Figs. 5-7",
        "The law stabilises attitude and rate rapidly",
        f"third rate held at zero: {_when(times[0])}; at 500 s |w| = "
        f"{float(np.linalg.norm(at_500['w'])):.1e}, z = {float(at_500['z']):.1e} rad, |ω_r| = "
        f"{float(np.linalg.norm(at_500['relative_rate'])):.1e} rad/s. {_holding(held)}. "
        f"Third rate free: {_when(times[1])}",
        *_decide(
            bool(np.isfinite(times).all()),
            bool(np.isfinite(times[0])),
            "an ideal torque about the axis without a thruster holds the third rate at zero",
        ),
    )


def _holding(dataset: xr.Dataset) -> str:
    """What the ideal torque about the third axis does, beside the thrusters."""
    if "constraint_torque" not in dataset:
        return "Nothing holds the third rate"
    peak = float(np.abs(dataset["constraint_torque"]).max())
    return (
        f"What holds it is an ideal torque about the third axis of up to {peak:.1f} N m, "
        f"{float(dataset['constraint_effort']):.0f} N m s in all, beside "
        f"{float(dataset['effort'].sum()):.0f} N m s of the two thrusters"
    )


def _lyapunov_decreases(datasets: Datasets) -> Claim:
    value = datasets["three-axis"]["lyapunov"].values
    rise = float(np.diff(value).max())
    return Claim(
        "(43), proof of (42)",
        "The Lyapunov function V never increases",
        f"from {value[0]:.4g} to {value[-1]:.2g} N m over 1000 s; largest rise between two "
        f"saved instants {max(rise, 0):.1e} N m",
        Verdict.HOLDS if rise < 1e-6 * value[0] else Verdict.FAILS,
    )


def _disturbance_is_cancelled(datasets: Datasets) -> Claim:
    with_it, without, strong_with, strong_without = (
        float(np.abs(_last(datasets[name], 100.0)["relative_rate"]).max())
        for name in (
            "three-axis",
            "three-axis-no-internal-model",
            "strong",
            "strong-no-internal-model",
        )
    )
    printed, raised = (
        _scenario(datasets[name])["control"]["k4"] for name in ("three-axis", "strong")
    )
    return Claim(
        "(42), section 5",
        "The internal model eliminates the effect of the disturbance",
        f"largest |ω_r| from 900 s to 1000 s with it and without: {with_it:.1e} and {without:.1e} "
        f"rad/s for k4 = {printed:g} N m s as printed, {strong_with:.1e} and {strong_without:.1e} "
        f"for k4 = {raised:g}",
        *_decide(
            with_it < without / 10,
            strong_with < strong_without / 10,
            f"k4 is raised, here to {raised:g} N m s; with the printed gain it has no time to act",
        ),
    )


def _attitude_changes_little(datasets: Datasets) -> Claim:
    small, exact = datasets["three-axis"], datasets["three-axis-exact"]
    scalar = np.abs(small["quaternion"][:, 0].values)
    angle = float(np.degrees(2 * np.arccos(np.clip(scalar, 0, 1))).max())
    apart = float(np.abs(small["w"] - exact["w"]).max())
    return Claim(
        "(11)",
        "The attitude changes little, so C_bo may be replaced by the identity",
        f"the manoeuvre turns through {angle:.0f}°; with the exact relation w differs by up to "
        f"{apart:.2g} on the way, {_when(time_to_settle(exact))} "
        f"(approximation: {_when(time_to_settle(small))})",
        Verdict.HOLDS if angle < SMALL_ANGLE else Verdict.FAILS,
    )


def _third_rate_converges(datasets: Datasets) -> Claim:
    changes = {
        name: np.abs(_third_rate_change(datasets[name]))
        for name in ("three-axis", "free", "free-without-d3")
    }
    late = {
        name: float(change[_is_late(datasets[name], 50.0)].mean())
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
        *_decide(
            late["free"] < SMALL_ACCELERATION,
            late["three-axis"] < SMALL_ACCELERATION,
            "the third rate is held: (37) is then not obeyed",
        ),
    )


def _third_rate_change(dataset: xr.Dataset) -> np.ndarray:
    """dω3/dt (rad/s²) by (37) from the rates and d3 of a run, whether or not it obeys (37)."""
    j1, j2, j3 = _scenario(dataset)["spacecraft"]["inertia_kg_m2"]
    rates, d3 = dataset["omega"].values, dataset["disturbance"].values[:, 2]
    return ((j1 - j2) * rates[:, 0] * rates[:, 1] + d3) / j3


def _switching_settles(datasets: Datasets) -> Claim:
    plain, rounded = datasets["switching"], datasets["switching-rounded"]
    times = [time_to_settle(dataset) for dataset in (plain, rounded)]
    half = _last(plain, float(plain["time"][-1]) / 2)
    rate = np.linalg.norm(half["relative_rate"], axis=1)
    width = _scenario(rounded)["control"].get("tilt_width", 0.0)
    return Claim(
        "note in section 5",
        "Switching between (38) and (42) repeatedly reaches the stable range",
        f"{_settings(plain)}: {_when(times[0])}; {_transitions(plain)}; over the second half |w| "
        f"up to {float(np.linalg.norm(half['w'], axis=1).max()):.3f}, |z| up to "
        f"{float(np.abs(wrapped(jnp.asarray(half['z'].values))).max()):.4f} rad, |ω_r| between "
        f"{rate.min():.1e} and {rate.max():.1e} rad/s (median {np.median(rate):.1e}), within all "
        f"tolerances at {100 * is_within(half).mean():.0f} % of the samples. With |w|² + δ² under "
        f"the fraction of (41), δ = {width:g}, and gains tuned with it: {_when(times[1])} of "
        f"{float(rounded['time'][-1]):g} s",
        *_decide(
            bool(np.isfinite(times[0])),
            bool(np.isfinite(times[1])),
            "(41) is rounded with δ, which the paper does not do; not from every start, and not "
            "for ever",
        ),
    )


def _settings(dataset: xr.Dataset) -> str:
    """What a run of the switching law was made with."""
    scenario = _scenario(dataset)
    control, limit = scenario["control"], scenario["spacecraft"]["torque_limit_N_m"]
    model = "with" if control.get("internal_model", True) else "without"
    return (
        f"Third rate free, tuned gains, thrusters of {limit:g} N m, torque held for "
        f"{control['period_s']:g} s, dω_d/dt by a clipped difference, {model} internal model"
    )


def _transitions(dataset: xr.Dataset) -> str:
    """When the laws took over from each other, and which is at work at the end."""
    mode, time = dataset["mode"].values, dataset["time"].values
    at = time[np.flatnonzero(np.diff(mode)) + 1]
    last = "(38)" if mode[-1] else "(42)"
    if not len(at):
        return f"no transition, {last} throughout"
    few = ", ".join(f"{t:.1f}" for t in at[:4]) + (", …" if len(at) > 4 else "")
    many = "1 transition" if len(at) == 1 else f"{len(at)} transitions"
    return f"{many} (at {few} s), from {at[-1]:.1f} s on {last} alone"


_CLAIMS: tuple[Callable[[Datasets], Claim], ...] = (
    _attitude_changes_little,
    _third_rate_decays,
    _rates_reach_zero,
    _burr,
    _attitude_settles,
    _final_rate,
    _lyapunov_decreases,
    _disturbance_is_cancelled,
    _third_rate_converges,
    _switching_settles,
)


def _scenario(dataset: xr.Dataset) -> dict[str, Any]:
    return tomllib.loads(dataset.attrs["scenario"])


def _is_late(dataset: xr.Dataset, span: float) -> np.ndarray:
    return dataset["time"].values >= float(dataset["time"][-1]) - span


def _last(dataset: xr.Dataset, span: float) -> xr.Dataset:
    return dataset.sel(time=slice(float(dataset["time"][-1]) - span, None))


def _worst_rate(dataset: xr.Dataset, span: float) -> float:
    return float(np.abs(_last(dataset, span)["omega"]).max())


def _when(time: float) -> str:
    return f"settled from {time:.2f} s" if np.isfinite(time) else "not settled"
