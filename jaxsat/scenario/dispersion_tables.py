"""`[dispersion]`: distributions of the quantities that differ between the cases of a study."""

from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt, Le, Len, Lt
from pydantic import Discriminator, Tag, model_validator

from jaxsat.core.declaration.quantities import DISPERSIBLE, DispersibleQuantity
from jaxsat.core.errors import ArgumentError
from jaxsat.scenario.quantities import (
    Number,
    ScenarioTable,
    Switch,
    Whole,
    choice,
    quantity,
    table_with,
)

NumberOrList = Annotated[
    Annotated[Number, Tag("one")] | Annotated[tuple[Number, ...], Len(1, 1000), Tag("each")],
    Discriminator(lambda value: "each" if isinstance(value, list | tuple) else "one"),
]
_Coordinate = Annotated[Number, Gt(0), Lt(1)]
Numbers = Annotated[tuple[Number, ...], Len(1, 1000)]


def _has_lists(value: Any) -> bool:
    return isinstance(value, list | tuple) and any(isinstance(one, list | tuple) for one in value)


ListOrLists = Annotated[
    Annotated[Numbers, Tag("all")] | Annotated[tuple[Numbers, ...], Len(1, 1000), Tag("each")],
    Discriminator(lambda value: "each" if _has_lists(value) else "all"),
]

Kind = Literal["uniform", "normal", "truncated-normal", "discrete", "random-attitude"]

PARAMETERS = {
    "uniform": ("low", "high"),
    "normal": ("mean", "sigma"),
    "truncated-normal": ("mean", "sigma", "low", "high"),
    "discrete": ("values", "weights"),
    "random-attitude": (),
}
"""Parameters of each distribution."""


class DistributionTable(ScenarioTable):
    """`[dispersion.QUANTITY]`: a distribution, in the unit of the quantity.

    A parameter is one number for all components or a list with one for each; `values` and `weights`
    are one list for all components or a list of such lists, one for each.
    """

    distribution: Kind = choice("Kind of distribution")
    low: NumberOrList | None = choice("Least value", None)
    high: NumberOrList | None = choice("Largest value", None)
    mean: NumberOrList | None = choice("Mean, before truncation", None)
    sigma: NumberOrList | None = choice("Standard deviation, before truncation", None)
    values: ListOrLists | None = choice("Values from which each component is drawn", None)
    weights: ListOrLists | None = choice("Weights of the values", None)

    @model_validator(mode="after")
    def _own_parameters(self) -> "DistributionTable":
        parameters, kind = PARAMETERS[self.distribution], f'a "{self.distribution}" distribution'
        for name in sorted({entry for names in PARAMETERS.values() for entry in names}):
            present = getattr(self, name) is not None
            if present and name not in parameters:
                raise ArgumentError(name, f"must not have {name} in {kind}")
            if not present and name in parameters:
                raise ArgumentError(name, f"must have {name} in {kind}")
            lists = getattr(self, name) if _has_lists(getattr(self, name)) else ()
            if len({len(one) for one in lists}) > 1:
                raise ArgumentError(
                    name, f"must have lists of one length in {name}", [*map(len, lists)]
                )
        return self


def _distribution_field(one: DispersibleQuantity) -> tuple[Any, Any]:
    what = f"Distribution of the {one.meaning}"
    what += ', always "random-attitude"' if one.random_attitude else ""
    return (DistributionTable | None, quantity(what, one.unit, None))


class DispersionTable(
    table_with({one.key: _distribution_field(one) for one in DISPERSIBLE.values()})
):
    """`[dispersion]`: the quantities that a Monte-Carlo study draws for every case."""

    design: Literal["independent", "sobol", "latin-hypercube"] = choice(
        "How the cases are spread over the distributions", "independent"
    )
    frequency_known: Switch = choice(
        "Whether the law's internal model or ripple estimator knows the drawn disturbance "
        "frequencies",
        False,
    )
    case: Annotated[Whole, Ge(0), Le(2**32 - 1)] | None = quantity(
        "Number of the case that `jaxsat simulate` flies in place of the nominal run", "1", None
    )
    point: Annotated[tuple[_Coordinate, ...], Len(1, 1000)] | None = quantity(
        "Point in the unit cube, quantity by quantity in their order, that all cases have in place "
        "of their own draws",
        "1",
        None,
    )

    @property
    def distributions(self) -> dict[str, DistributionTable]:
        """Given distributions by the name of the quantity, in the order in which they apply."""
        tables = {name: getattr(self, one.key) for name, one in DISPERSIBLE.items()}
        return {name: table for name, table in tables.items() if table is not None}
