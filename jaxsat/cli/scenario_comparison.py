"""`jaxsat compare SCENARIO`: laws on the dispersed cases of any scenario."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jaxsat.cli.computing import interruptibly
from jaxsat.cli.loading import load_or_explain
from jaxsat.cli.progress import show_progress
from jaxsat.cli.study_executors import chosen_executor, study_problems
from jaxsat.cli.study_files import tell_repair
from jaxsat.cli.study_text import progress_text
from jaxsat.cli.terminal import Terminated, UserMistake, print_document, print_stderr, print_stdout
from jaxsat.cli.words import command_line
from jaxsat.cli.work import require_approval

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from jaxsat.scenario import Scenario
    from jaxsat.store import ResumableFolder
    from jaxsat.studies import StudyProgress
    from jaxsat.synthesis.comparison import ScenarioComparison

RESULT = "comparison.json"


@dataclass(frozen=True)
class Options:
    """The options of the command that count with a scenario."""

    laws: Sequence[str]
    count: int
    seed: int
    out: Path
    engine: Any
    workers: int | None
    yes: bool
    elsewhere: bool
    quiet: bool


def compare_in_scenario(name: str, overrides: Sequence[str], options: Options) -> None:
    """Run the cases of a scenario under every law; print and write what came of them."""
    if list(options.laws) == ["all"]:
        raise UserMistake("--law: must be given with a scenario, at least one law")
    scenario = load_or_explain(name, overrides, "study")
    from jaxsat.store import ResumableFolder, provenance
    from jaxsat.synthesis.comparison import ComparisonRun
    from jaxsat.synthesis.comparison import compare_in_scenario as compared

    _require_suitable(scenario, options)
    run = ComparisonRun(
        options.count,
        options.seed,
        options.out,
        options.engine,
        chosen_executor(options.workers, None, None, None),
        options.elsewhere,
        told,
        remarks(options.quiet),
        tell_repair,
    )
    try:
        with study_problems(), ResumableFolder(options.out, "comparison", {}) as folder:
            found = interruptibly(lambda: compared(scenario, options.laws, run))
            record = {
                "command": command_line(),
                "seed": options.seed,
                **found.as_data(),
                **provenance(),
            }
            write_record(folder, record, lambda: _figures(scenario, found, record["rows"]))
    except (KeyboardInterrupt, Terminated) as stop:
        kept = f"the results so far are in {options.out}; the same command resumes"
        raise type(stop)(kept) from None
    if not options.quiet:
        print_record(record)
        print_stdout(f"written to {options.out}")


def write_record(
    folder: "ResumableFolder",
    record: dict[str, Any],
    figures: "Callable[[], dict[str, Figure]]",
) -> None:
    """The record as JSON, then figures."""
    from jaxsat.report.saving import save_figures

    folder.write(RESULT, json.dumps(record, indent=2, ensure_ascii=False, allow_nan=False) + "\n")
    save_figures(figures, folder.write)


def print_record(record: dict[str, Any]) -> None:
    """What a comparison found."""
    from jaxsat.report.comparison_document import comparison_document

    print_document(comparison_document(record))


def told(what: str, progress: "StudyProgress | None") -> None:
    """Shows how far a study is."""
    show_progress(f"{what}: {'compiling' if progress is None else progress_text(progress)}")


def remarks(quiet: bool) -> Callable[[str], None]:
    """Tells each remark once."""
    known: set[str] = set()

    def remark(text: str) -> None:
        if text not in known and not quiet:
            print_stderr(text, "")
        known.add(text)

    return remark


def _require_suitable(scenario: "Scenario", options: Options) -> None:
    """Raise `UserMistake` for a law that cannot fly the scenario, and for too much work."""
    from jaxsat.scenario import ScenarioError
    from jaxsat.scenario.build.study import build_study
    from jaxsat.studies import study_work
    from jaxsat.synthesis.comparison import scenario_under

    works = []
    for law in dict.fromkeys(options.laws):
        try:
            one = scenario_under(scenario, law)
            study = build_study(one, options.count, seed=options.seed, engine=options.engine)
        except ScenarioError as error:
            raise UserMistake(str(error), located=True) from None
        except ValueError as error:
            raise UserMistake(f"--law: {error}") from None
        works.append(study_work(study, None))
    require_approval(works, options.out, yes=options.yes, quiet=options.quiet)


def _figures(
    scenario: "Scenario", found: "ScenarioComparison", rows: list[dict[str, Any]]
) -> "dict[str, Figure]":
    from jaxsat.report.comparison_figures import recovery_comparison, settling_comparison

    title = scenario.title
    times = {row.setting.law: row.settling_times for row in found.rows}
    panel: tuple[str, float | None] = ("the same cases under every law", None)
    horizons: dict[tuple[str, float | None], float] = {panel: scenario.simulation.duration_s}
    figures = {"comparison": settling_comparison({panel: times}, horizons, title)}
    recovered = {row["law"]: row["recovered"] for row in rows if "recovered" in row}
    if recovered:
        figures["recovered"] = recovery_comparison(recovered, title)
    return figures
