"""`[[flexible_mode]]`: declaration of flexible modes of panels and booms."""

from collections.abc import Iterator, Sequence
from typing import Any, Literal

from jaxsat.core.declaration.actuator import EffectorDeclaration, Signal
from jaxsat.core.declaration.keys import DispersibleQuantity, Finding, Rule, number
from jaxsat.core.ranges import COUPLING, COUPLING_SIZE, DAMPING, KNOWN_FREQUENCY, TURN, Range


def _modes_couple_to_the_body(modes: Sequence[Any]) -> Iterator[Finding]:
    for place, one in enumerate(modes):
        if not any(one.coupling_sqrt_kg_m):
            message = f"must have an entry other than 0, got {list(one.coupling_sqrt_kg_m)}"
            yield Finding(f"flexible_mode.{place}.coupling_sqrt_kg_m", message)


def _modes_are_part_of_the_body(modes: Sequence[Any], inertia: Any) -> Iterator[Finding]:
    if modes and not _is_positive_definite(_rest_of(inertia, modes)):
        most = max(range(len(modes)), key=lambda k: sum(x * x for x in modes[k].coupling_sqrt_kg_m))
        yield Finding(
            f"flexible_mode.{most}.coupling_sqrt_kg_m",
            "must be of a part of spacecraft.inertia_kg_m2, which is that of the rigid body with "
            "all that is flexible: less the sum of d dᵀ of all modes it must stay positive "
            f"definite, got {list(modes[most].coupling_sqrt_kg_m)}",
        )


def _rest_of(inertia: Any, modes: Sequence[Any]) -> list[list[float]]:
    """Return J - Σ d dᵀ, kg m²."""
    return [
        [
            (row[j] if isinstance(row, list | tuple) else row * (i == j))
            - sum(one.coupling_sqrt_kg_m[i] * one.coupling_sqrt_kg_m[j] for one in modes)
            for j in range(3)
        ]
        for i, row in enumerate(inertia)
    ]


def _is_positive_definite(matrix: list[list[float]]) -> bool:
    """Whether all leading minors are above zero (Sylvester's criterion)."""
    (a, b, c), (_, d, e), (_, _, f) = matrix
    return (
        a > 0
        and a * d - b * b > 0
        and a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d) > 0
    )


def _relative(
    field: str, within: Range, what: str = "the", stage: Literal["body", "part"] = "part"
) -> DispersibleQuantity:
    meaning = f"relative change of {what} {field} of each flexible mode"
    return DispersibleQuantity(
        f"mode_{field}", meaning, "1", field, within, True, stage, axis="flexible_mode"
    )


FLEXIBLE_MODE = EffectorDeclaration(
    "flexible_mode",
    "one mode of a flexible panel or boom, which the body excites as it turns",
    most=100,
    meaning="Modes of flexible panels and booms, of which the law has no knowledge",
    keys=(
        number(
            "frequency_rad_s",
            "Natural frequency with the body held, undamped",
            within=KNOWN_FREQUENCY,
        ),
        number("damping", "Damping ratio", within=DAMPING, default=0.005),
        number(
            "coupling_sqrt_kg_m",
            "Coupling d to the rotation of the body, of the mode normalised to 1 kg, body axes",
            within=COUPLING,
            size=3,
        ),
        number(
            "angle_rad",
            "Amplitude over the size of the coupling at the start",
            within=TURN,
            default=0.0,
        ),
    ),
    maker="jaxsat.spacecraft.flexible_modes:FlexibleModes.from_tables",
    rules=(
        Rule(("flexible_mode",), _modes_couple_to_the_body),
        Rule(("flexible_mode", "spacecraft.inertia_kg_m2"), _modes_are_part_of_the_body),
    ),
    dispersible=(
        _relative("coupling", COUPLING_SIZE, "the size of the", "body"),
        _relative("frequency", KNOWN_FREQUENCY),
        _relative("damping", DAMPING),
    ),
    signals=(
        Signal(
            "mode_angle",
            "rad",
            "angle of each flexible mode",
            peak=True,
            overall="largest angle of any flexible mode (rad)",
        ),
    ),
    called="flexible mode",
)
