"""Output paths, checked before any computation, and the files of a study beside its store."""

import contextlib
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jaxsat.cli.computing import interruptibly
from jaxsat.cli.terminal import UserMistake, print_stdout

if TYPE_CHECKING:
    from jaxsat.report.results import Flight
    from jaxsat.scenario import Scenario
    from jaxsat.store.folder import OutputFolder
    from jaxsat.studies.ensemble import Study
    from jaxsat.studies.summary import Summary


class _EndOfTrial(Exception):
    """End of a folder that was opened only as a trial."""


def try_folder(open_folder: "Callable[[], OutputFolder]") -> None:
    """Raise `OutputError` now for a folder that could not be written later."""

    with contextlib.suppress(_EndOfTrial), open_folder():
        raise _EndOfTrial


def refuse_nested(first: tuple[str, Path], second: tuple[str, Path]) -> None:
    """Raise `UserMistake` where one of two places is the other or is inside it."""
    (one, here), (other, there) = (
        (name, Path(os.path.realpath(path))) for name, path in (first, second)
    )
    if here.is_relative_to(there) or there.is_relative_to(here):
        raise UserMistake(f"{one} and {other}: must be apart from each other, got {here}, {there}")


def write_figures(
    folder: Path, title: str, study: "Study", store: Path, summary: "Summary"
) -> None:
    """Write the figures of a study in its store into a folder of their own."""
    from jaxsat.report.study_figures import write_study_figures

    def write() -> None:
        with figures_folder(folder) as place:
            write_study_figures(place.write, title, study, store, summary)

    interruptibly(write)


def figures_folder(folder: Path) -> "OutputFolder":
    """Return the folder for a study's figures, which replaces only unchanged figures.

    Raises `OutputError`.
    """
    from jaxsat.store.folder import OutputFolder

    return OutputFolder(folder, kind="figures", overwrite=True, option="--figures")


def refuse_csv(path: Path, *, overwrite: bool) -> None:
    """Raise `OutputError` now for a table that could not be written later."""
    from jaxsat.store.files import refuse_existing

    refuse_existing(path, overwrite=overwrite, option="--csv")


def write_csv(path: Path, store: Path, count: int, *, overwrite: bool) -> None:
    """Write the first `count` cases of a store as CSV."""
    from jaxsat.store.tables import save_case_table

    interruptibly(lambda: save_case_table(store, path, count=count, overwrite=overwrite))


def write_one_case(
    scenario: "Scenario", study: "Study", number: int, target: Path, *, overwrite: bool, quiet: bool
) -> None:
    """Compute one case again, and write a folder like that of `jaxsat simulate`."""
    from jaxsat.store.folder import OutputFolder

    try:
        with OutputFolder(target, kind="run", overwrite=overwrite) as folder:
            flight, draws = interruptibly(lambda: replayed(scenario, study, number), brief=True)
            flight.write_trajectory(folder)
    except ValueError as error:
        raise UserMistake(str(error)) from None
    if not quiet:
        print_stdout(f"case {number}: {flight.arrays.attrs['outcome_explanation']}")
        for line in draws:
            print_stdout(line)
        print_stdout(f"written to {target}")


def replayed(scenario: "Scenario", study: "Study", number: int) -> tuple["Flight", Sequence[str]]:
    """Return the flight of one case, and the values drawn for it as lines."""
    from jaxsat.core.declaration.quantities import DISPERSIBLE
    from jaxsat.report.results import Flight
    from jaxsat.scenario.build.datasets import replayed_case

    flight = Flight(scenario, replayed_case(scenario, study, number))
    lines = []
    for key, values in flight.arrays.attrs.items():
        if not key.startswith("drawn_"):
            continue
        name, numbers = key.removeprefix("drawn_"), ", ".join(f"{value:.6g}" for value in values)
        lines.append(f"{name:<24} {numbers} {DISPERSIBLE[name].unit.replace('1', '')}".rstrip())
    return flight, lines
