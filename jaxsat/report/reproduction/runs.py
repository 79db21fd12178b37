"""Which simulations the reproduction needs: library scenarios, with what is changed in them."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class PaperRun(NamedTuple):
    """A library scenario with overrides in the form the command line takes, and what it is for."""

    scenario: str
    overrides: tuple[str, ...]
    purpose: str


_LONG = ("simulation.duration_s=1000.0", "simulation.save_every_s=0.5")
_STRONG = (*_LONG, "control.k4=100.0")
_NO_INTERNAL_MODEL = "control.internal_model=false"
_SLIDING = (  # with the exact relation w comes to slide on zero, where no step meets a tolerance
    'simulation.solver.name="tsit5"',
    "simulation.solver.rtol=1e-8",
    "simulation.solver.atol=1e-8",
    "simulation.solver.min_step_s=5e-3",
    "simulation.solver.max_steps=500000",
)
_NO_D3 = "disturbance.amplitude_N_m=[0.01, 0.02, 0.0]"

RUNS: Mapping[str, PaperRun] = MappingProxyType(
    {
        "rate": PaperRun("paper-rate", (), "rate law as printed (Figs. 3, 4)"),
        "rate-without-d3": PaperRun("paper-rate", (_NO_D3,), "rate law, no disturbance on axis 3"),
        "rate-fine": PaperRun(
            "paper-rate",
            ("simulation.duration_s=70.0", "simulation.save_every_s=0.001"),
            "rate law, torque looked at 100 times more closely",
        ),
        "three-axis": PaperRun(
            "paper-three-axis", _LONG, "three-axis law, third rate held (Figs. 5-7)"
        ),
        "three-axis-no-internal-model": PaperRun(
            "paper-three-axis", (*_LONG, _NO_INTERNAL_MODEL), "the same without the internal model"
        ),
        "strong": PaperRun("paper-three-axis", _STRONG, "three-axis law with k4 = 100 N m s"),
        "strong-no-internal-model": PaperRun(
            "paper-three-axis", (*_STRONG, _NO_INTERNAL_MODEL), "the same without internal model"
        ),
        "three-axis-exact": PaperRun(
            "paper-three-axis",
            (*_LONG, *_SLIDING, 'orbit.relation="exact"'),
            "three-axis law, third rate held, exact orbit relation (11)",
        ),
        "free": PaperRun("free-third-rate", (), "three-axis law, third rate free"),
        "free-without-d3": PaperRun(
            "free-third-rate", (_NO_D3,), "the same, no disturbance on axis 3"
        ),
        "switching": PaperRun(
            "switching",
            ("simulation.save_every_s=0.1",),  # every sample, to see each transition
            "switching between the two laws, third rate free",
        ),
        "switching-rounded": PaperRun(
            "switching-rounded", (), "the same with δ² under the fraction of (41), tuned with it"
        ),
    }
)
