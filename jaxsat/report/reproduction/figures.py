"""The paper's Figs. 3-7 and the two runs that it describes without a figure."""

from collections.abc import Mapping

import xarray as xr
from matplotlib.figure import Figure

from jaxsat.report.figures import (
    attitude_figure,
    comparison_figure,
    lyapunov_figure,
    rates_figure,
    torque_figure,
)


def paper_figures(datasets: Mapping[str, xr.Dataset]) -> dict[str, Figure]:
    """Return figures by file name, from the runs named in `jaxsat.report.reproduction.RUNS`."""
    rate = datasets["rate"]
    three_axis = datasets["three-axis"].sel(time=slice(0.0, 500.0))
    return {
        "fig3-rates": rates_figure(
            rate, zoom=(0.0, 10.0), title="Fig. 3: rates under the rate law (38)-(39)"
        ),
        "fig3b-rates-late": rates_figure(
            rate.sel(time=slice(20.0, None)),
            zoom=(400.0, 500.0),
            title="Fig. 3b: the same after 20 s, where d3 keeps ω2 moving",
        ),
        "fig4-torque": torque_figure(
            rate,
            zoom=(25.0, 70.0),
            linear_to=1.0,
            title="Fig. 4: torque of the rate law (39), and its burr",
        ),
        "fig5-rates": rates_figure(
            three_axis, title="Fig. 5: rates under the three-axis law (42), third rate held"
        ),
        "fig6-attitude": attitude_figure(
            three_axis, title="Fig. 6: attitude under the three-axis law (42), third rate held"
        ),
        "fig7-torque": torque_figure(
            three_axis,
            zoom=(0.0, 100.0),
            title="Fig. 7: torque of the three-axis law (42), and the ideal one that holds ω3",
        ),
        "lyapunov": lyapunov_figure(
            datasets["three-axis"], title="Lyapunov function of the proof of (42)"
        ),
        "third-rate-held-or-free": comparison_figure(
            [three_axis, datasets["free"], datasets["free-without-d3"]],
            ["third rate held", "free", "free, d3 = 0"],
            title="The three-axis law (42) with the third rate held and free",
        ),
        "switching-attitude": attitude_figure(
            datasets["switching"].sel(time=slice(0.0, 200.0)),
            title="Switching between (38) and (42), third rate free, 5 N m: the first 200 s",
        ),
        "switching-rates": rates_figure(
            datasets["switching"],
            title="Two transitions, then (42) alone, third rate free, 5 N m: no rest",
        ),
        "switching-rounded": comparison_figure(
            [datasets["switching"], datasets["switching-rounded"]],
            ["(41) as printed", "|w|² + δ² in (41)"],
            title="Switching between (38) and (42), third rate free, 5 N m, tuned",
        ),
    }
