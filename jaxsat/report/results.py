"""Results for Python and notebooks: a flight and a study, which show and draw themselves."""

import abc
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jaxsat.core.errors import ArgumentError
from jaxsat.report.document import Document
from jaxsat.report.facts import scenario_tables, settles_in_attitude
from jaxsat.report.run_document import run_document
from jaxsat.scenario.build.datasets import simulated_finely
from jaxsat.scenario.resolution import excessive_error
from jaxsat.scenario.schema import Scenario
from jaxsat.store.dataset import coarseness, errors_of, time_at_rest, time_to_settle
from jaxsat.store.labelled import LabelledArrays

if TYPE_CHECKING:  # a run that draws nothing needs neither
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

    from jaxsat.store.folder import OutputFolder
    from jaxsat.studies.summary import Summary


class AbstractResult(abc.ABC):
    """A result that a notebook shows as its document, with figures by name."""

    @property
    @abc.abstractmethod
    def document(self) -> Document:
        """Verdict, facts and tables, as the command line prints them."""

    @abc.abstractmethod
    def drawings(self) -> "Mapping[str, Callable[[], Figure]]":
        """Return functions that draw the figures, by name."""

    def plot(self, name: str) -> "Figure":
        """Draw the figure of this name, one of `figures`.

        Raises `ArgumentError` for another name.
        """
        drawings = self.drawings()
        if name not in drawings:
            raise ArgumentError("name", f"must be one of {', '.join(drawings)}", name)
        return drawings[name]()

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of the figures."""
        return tuple(self.drawings())

    def __repr__(self) -> str:
        """Return the verdict in one line."""
        document = self.document
        return f"<{type(self).__name__}: {document.title}. {document.verdict.text}>"

    def __str__(self) -> str:
        """Return the document as text."""
        from jaxsat.report.printers import terminal_text

        return terminal_text(self.document)

    def _repr_markdown_(self) -> str:
        """Return the document for notebooks."""
        from jaxsat.report.printers import notebook_text

        return notebook_text(self)


@dataclass(frozen=True, eq=False, repr=False)
class Flight(AbstractResult):
    """A run of a `scenario`, whose steps are those that were fine enough; see `jaxsat.fly`.

    `arrays` has the content of `trajectory.nc`.
    """

    scenario: Scenario
    arrays: LabelledArrays

    @property
    def dataset(self) -> "xr.Dataset":
        """The trajectory over `time` (s), as `jaxsat.open_trajectory` reads it."""
        return self.arrays.dataset()

    @property
    def document(self) -> Document:
        """Settling time, final state, actuators, and requirements."""
        return run_document(self.arrays)

    @property
    def settling_time(self) -> float:
        """From when on the run is settled (s), infinite where it is not.

        Under a law that only stops a rotation, from when on the body is at rest.
        """
        attitude = settles_in_attitude(scenario_tables(self.arrays))
        return time_to_settle(self.arrays) if attitude else time_at_rest(self.arrays)

    @property
    def cautions(self) -> list[str]:
        """Warnings of times too far apart to interpolate, and of errors beyond the tolerances."""
        errors = errors_of(self.arrays)
        texts = (coarseness(self.arrays), excessive_error(errors, self.scenario))
        return [text for text in texts if text]

    def drawings(self) -> "Mapping[str, Callable[[], Figure]]":
        """Return functions that draw the figures of `jaxsat simulate`, by name."""
        from jaxsat.report.figures import trajectory_drawings

        return trajectory_drawings(self.arrays)

    def plot(self, name: str = "attitude") -> "Figure":
        """Draw the figure of this name, one of `figures`; raises `ArgumentError` for another."""
        return super().plot(name)

    def save(self, folder: str | Path, *, overwrite: bool = False) -> None:
        """Write scenario, trajectory, figures and provenance to a folder, as `jaxsat simulate`.

        Raises `OutputError` for a folder that exists, unless `overwrite` is set and jaxsat wrote
        all of it.
        """
        from jaxsat.store.folder import OutputFolder

        with OutputFolder(folder, kind="run", overwrite=overwrite) as output:
            self.write(output)

    def write(self, folder: "OutputFolder") -> None:
        """Write the files of `save` to an open folder."""
        from jaxsat.store.provenance import command_line, provenance

        record = {
            "title": self.scenario.title,
            "command": command_line(),
            "outcome": self.arrays.attrs["outcome"],
            "seed": self.scenario.simulation.seed,
            **provenance(),
        }
        folder.write("run.json", json.dumps(record, indent=2, ensure_ascii=False) + "\n")
        self.write_trajectory(folder)

    def write_trajectory(self, folder: "OutputFolder") -> None:
        """Write scenario, trajectory and figures to an open folder."""
        from jaxsat.report.saving import save_figures
        from jaxsat.store.netcdf import dataset_bytes

        folder.write("scenario.toml", self.arrays.attrs["scenario"])
        folder.write("trajectory.nc", dataset_bytes(self.arrays))
        save_figures(self.drawings, folder.write)


def fly(scenario: Scenario, tell: Callable[[str], Any] = lambda remark: None) -> Flight:
    """Fly a scenario as `jaxsat simulate` does, and return the `Flight`.

    Equal steps are halved until the error estimate is within the tolerances of
    `[simulation.solver]`, unless `substeps` or `step_s` is given. With `dispersion.case` it is that
    case of the study. `tell` receives remarks on finer steps and on the engine. A run that ends
    early is a `Flight`, too: its document says so.

    Raises `BuildError` and `PrecisionError` as `jaxsat.build` does.
    """
    return Flight(*simulated_finely(scenario, tell))


class StudyResults(AbstractResult):
    """The results of a study in the store at `path`, complete or not.

    Raises `OutputError` for a store that is damaged, or without a finished case.
    """

    path: Path
    dataset: "xr.Dataset"
    summary: "Summary"

    def __init__(self, path: str | Path):
        from jaxsat.store.files import OutputError
        from jaxsat.store.ledger import study_columns
        from jaxsat.store.tables import open_study
        from jaxsat.studies.summary import summarise

        self.path, self.dataset = Path(path), open_study(path)
        try:
            self.summary = summarise(study_columns(path))
        except ValueError:
            raise OutputError(f"{path} has no finished case.") from None

    @property
    def document(self) -> Document:
        """Settled fraction, percentiles, recovery and sensitivities."""
        from jaxsat.report.study_document import study_document

        identity = json.loads(self.dataset.attrs["identity"])
        return study_document(self.summary, identity.get("scenario", {}))

    def drawings(self) -> "Mapping[str, Callable[[], Figure]]":
        """Return functions that draw the figures of `jaxsat montecarlo`, by name.

        Fan charts, for which cases are flown again, are not among them.
        """
        from jaxsat.report.study_figures import stored_drawings

        return stored_drawings(self.dataset, self.summary, self.path.stem)

    def plot(self, name: str = "settling") -> "Figure":
        """Draw the figure of this name, one of `figures`; raises `ArgumentError` for another."""
        return super().plot(name)

    def to_pandas(self) -> "pd.DataFrame":
        """Return `jaxsat.case_table` of the study: a row for each finished case."""
        from jaxsat.store.tables import case_table

        return case_table(self.dataset)
