"""All claims of the paper's section 5, judged from trajectory datasets alone.

No result of the runs is assumed here.
"""

from collections.abc import Callable, Sequence

import jax.numpy as jnp
import numpy as np
import xarray as xr

from jaxsat.core.tolerances import wrap_angle
from jaxsat.report.document import Document, Shown, Table, Verdict
from jaxsat.report.reproduction.claim import (
    SMALL_RATE,
    Claim,
    ClaimVerdict,
    Datasets,
    decide,
    duration,
    last,
    scenario_of,
    when,
)
from jaxsat.report.reproduction.three_axis_claims import (
    attitude_changes_little,
    attitude_settles,
    disturbance_is_cancelled,
    final_rate,
    lyapunov_decreases,
)
from jaxsat.store.dataset import is_within, time_to_settle

SMALL_ACCELERATION = 1e-5
"""Acceleration (rad/s²) with which a rate stays small for 100 s; d3 alone makes 3e-6."""


def third_rate_converges(datasets: Datasets) -> Claim:
    """Judge whether dω3/dt, of which the note speaks, converges to zero; not ω3."""
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
    """Return dω3/dt (rad/s²) by (37) from rates and d3 of a run, even if it does not obey (37)."""
    j1, j2, j3 = scenario_of(dataset)["spacecraft"]["inertia_kg_m2"]
    rates, d3 = dataset["omega"].values, dataset["disturbance"].values[:, 2]
    return ((j1 - j2) * rates[:, 0] * rates[:, 1] + d3) / j3


def switching_settles(datasets: Datasets) -> Claim:
    """Judge whether switching between both laws settles the attitude."""
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
    scenario = scenario_of(dataset)
    control, limit = scenario["control"], scenario["spacecraft"]["torque_limit_N_m"]
    model = "with" if control.get("internal_model", True) else "without"
    return (
        f"Third rate free, tuned gains, thrusters of {limit:g} N m, torque held for "
        f"{control['period_s']:g} s, dω_d/dt by a clipped difference, {model} internal model"
    )


def _transitions(dataset: xr.Dataset) -> str:
    mode, time = dataset["mode"].values, dataset["time"].values
    starts = time[np.flatnonzero(np.diff(mode)) + 1]
    final = "(38)" if mode[-1] else "(42)"
    if not len(starts):
        return f"no transition, {final} throughout"
    few = ", ".join(f"{t:.1f}" for t in starts[:4]) + (", …" if len(starts) > 4 else "")
    many = "1 transition" if len(starts) == 1 else f"{len(starts)} transitions"
    return f"{many} (at {few} s), from {starts[-1]:.1f} s on {final} alone"


def third_rate_decays(datasets: Datasets) -> Claim:
    """Judge whether the third rate falls exponentially, at the rate that (38) gives."""
    dataset = datasets["rate-without-d3"]
    scenario = scenario_of(dataset)
    j1, j2, j3 = scenario["spacecraft"]["inertia_kg_m2"]
    prediction = scenario["control"]["k1"] * abs(j1 - j2) / j3
    part = dataset.sel(time=slice(1.0, 5.0))
    slope = np.polyfit(part["time"], np.log(np.abs(part["omega"][:, 2])), 1)[0]
    small = np.abs(datasets["rate"]["omega"][:, 2].values) < SMALL_RATE
    first = float(datasets["rate"]["time"][np.argmax(small)])
    return Claim(
        "(38), Fig. 3",
        "The reference (38) makes ω3 decay",
        f"without d3 decay at {-slope:.4f} 1/s where (38) predicts {prediction:.4f}; with d3 "
        f"|ω3| is first below {SMALL_RATE:g} rad/s at {first:.1f} s",
        ClaimVerdict.HOLDS if abs(-slope / prediction - 1) < 1e-2 else ClaimVerdict.FAILS,
    )


def rates_reach_zero(datasets: Datasets) -> Claim:
    """Judge whether all rates are below `SMALL_RATE` at the end."""
    worst = {
        name: float(np.abs(last(datasets[name], 50.0)["omega"]).max())
        for name in ("rate", "rate-without-d3")
    }
    return Claim(
        "(39), Fig. 3b",
        "The rates are close to zero at 500 s",
        f"largest |ω_i| over the last 50 s: {worst['rate']:.1e} rad/s; "
        f"without d3 {worst['rate-without-d3']:.1e} (close to zero: below {SMALL_RATE:g}, the "
        "tolerance of “settled”; the rates begin at 0.1)",
        *decide(
            worst["rate"] < SMALL_RATE,
            worst["rate-without-d3"] < SMALL_RATE,
            "no disturbance acts on the third axis, as section 4 assumes and section 5 does not",
        ),
    )


def burr(datasets: Datasets) -> Claim:
    """Judge whether the torque has small spikes, caused by the disturbance."""
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
        f"without d3 {quiet:.2g} N m"
        + (": spikes where ω3 crosses zero, as (39) has 1/√|ω3|" if grows else ""),
        *decide(
            not grows and coarse > 2 * quiet,
            grows and fine > 2 * quiet,
            "any size counts as slight: d3 causes it, and the spikes grow with the resolution",
        ),
    )


_CLAIMS: tuple[Callable[[Datasets], Claim], ...] = (
    attitude_changes_little,
    third_rate_decays,
    rates_reach_zero,
    burr,
    attitude_settles,
    final_rate,
    lyapunov_decreases,
    disturbance_is_cancelled,
    third_rate_converges,
    switching_settles,
)


def judge(datasets: Datasets) -> list[Claim]:
    """Judge all claims, in the paper's order, from the runs named in `RUNS`."""
    return [claim(datasets) for claim in _CLAIMS]


GOOD = {ClaimVerdict.HOLDS: True, ClaimVerdict.ONLY_IF: None, ClaimVerdict.FAILS: False}


def claims_document(claims: Sequence[Claim]) -> Document:
    """Return a table of the claims: place in the paper, statement, number, verdict."""
    counts = {verdict: sum(one.verdict is verdict for one in claims) for verdict in ClaimVerdict}
    tally = "; ".join(f"{verdict.value}: {count}" for verdict, count in counts.items() if count)
    text = f"{len(claims)} claims of the paper's section 5. {tally.capitalize()}."
    more = [
        "Wang, Jia, Jin, Xu, Acta Astronautica 83 (2013) 44-53. Every number comes from the runs "
        "in this folder."
    ]
    rows = [
        [one.source, one.statement, one.finding, Shown(one.verdict_text, good=GOOD[one.verdict])]
        for one in claims
    ]
    table = Table("Claims", ["where", "claim", "found", "verdict"], rows)
    return Document("The paper's section 5", Verdict(None, text, more), [table])
