"""Claims of the rate law (38)-(39)."""

import numpy as np
import xarray as xr

from jaxsat.report.reproduction.claim import (
    SMALL_RATE,
    Claim,
    ClaimVerdict,
    Datasets,
    decide,
    last,
    scenario_of,
)


def third_rate_decays(datasets: Datasets) -> Claim:
    """The third rate falls exponentially, at the rate that (38) gives."""
    dataset = datasets["rate-without-d3"]
    scenario = scenario_of(dataset)
    j1, j2, j3 = scenario["spacecraft"]["inertia_kg_m2"]
    predicted = scenario["control"]["k1"] * abs(j1 - j2) / j3
    part = dataset.sel(time=slice(1.0, 5.0))
    slope = np.polyfit(part["time"], np.log(np.abs(part["omega"][:, 2])), 1)[0]
    small = np.abs(datasets["rate"]["omega"][:, 2].values) < SMALL_RATE
    first = float(datasets["rate"]["time"][np.argmax(small)])
    return Claim(
        "(38), Fig. 3",
        "The reference (38) makes ω3 decay",
        f"without d3 decay at {-slope:.4f} 1/s where (38) predicts {predicted:.4f}; with d3 "
        f"|ω3| is first below {SMALL_RATE:g} rad/s at {first:.1f} s",
        ClaimVerdict.HOLDS if abs(-slope / predicted - 1) < 1e-2 else ClaimVerdict.FAILS,
    )


def rates_reach_zero(datasets: Datasets) -> Claim:
    """All rates are below `SMALL_RATE` at the end."""
    worst = {name: _worst_rate(datasets[name], 50.0) for name in ("rate", "rate-without-d3")}
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
    """The torque has small spikes, and the disturbance makes them."""
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


def _worst_rate(dataset: xr.Dataset, span: float) -> float:
    return float(np.abs(last(dataset, span)["omega"]).max())
