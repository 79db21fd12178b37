"""`jaxsat compare`: laws on the acceptance set, or in any scenario."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from jaxsat.cli.comparison_bounds import least_bounds
from jaxsat.cli.comparison_text import comparison_lines, least_text, least_time_text
from jaxsat.cli.computing import interruptibly, use_double_precision
from jaxsat.cli.options import (
    Cases,
    Digits,
    End,
    Flag,
    OptionalPath,
    OutputPath,
    Overrides,
    Report,
    Seed,
    StartsOrNone,
    TorqueLimits,
    Workers,
    torque_limits,
)
from jaxsat.cli.places import refuse_nested
from jaxsat.cli.report import finish_report, planned_report
from jaxsat.cli.scenario_comparison import Options, compare_in_scenario, remarks, told
from jaxsat.cli.study_executors import chosen_executor, study_problems
from jaxsat.cli.study_files import refuse_csv, tell_repair
from jaxsat.cli.terminal import (
    SUCCESS,
    Terminated,
    UserMistake,
    print_stderr,
    print_stdout,
)
from jaxsat.cli.words import command_line
from jaxsat.cli.work import require_approval

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from jaxsat.store import ResumableFolder
    from jaxsat.studies import Work
    from jaxsat.synthesis.comparison import (
        Comparison,
        ComparisonRow,
        ComparisonRun,
        ComparisonSetting,
        ComparisonVerdict,
        LeastTime,
    )

Level = Literal["nominal", "mc", "hard", "all"]

RESULT = "comparison.json"
CASE = 400
"""Bytes of a case in memory and on the disk, about."""


def compare(
    scenario: str | None = None,
    /,
    *,
    overrides: Overrides = (),
    level: Annotated[tuple[Level, ...], Parameter(negative="")] = ("hard",),
    torque_limit: TorqueLimits = ("5",),
    law: Annotated[tuple[str, ...], Parameter(negative="")] = ("all",),
    count: Cases = 200,
    seed: Seed,
    out: OutputPath = Path("jaxsat-comparison"),
    engine: Literal["auto", "native", "scan", "diffrax"] = "auto",
    workers: Workers = None,
    bounds: StartsOrNone = 0,
    end: End = "settled",
    csv: OptionalPath = None,
    report: Report = False,
    overwrite: Flag = False,
    yes: Flag = False,
    elsewhere: Flag = False,
    digits: Digits = None,
    quiet: Flag = False,
) -> int:
    """Compare laws on the same cases: those of a scenario, or of the acceptance set.

    With a scenario every --law flies its dispersed cases, failures in flight included. Without one
    the laws steer three axes with two torques, the paper's included: random starts and the paper's
    start, with a free third rate, a torque limit and dispersions. Prints a table and the
    recommended law, and writes both with figures. The same command resumes an interrupted run.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file, with a [dispersion] table; without one
        the acceptance set.
    overrides
        KEY=VALUE that replaces a value of the scenario, as for `jaxsat simulate`.
    level
        Dispersions: nominal, mc, hard or all; may be given several times.
    torque_limit
        Largest torque of each thruster in N m, or all for 1, 5 and 20; may be given several times.
    law
        Laws to compare: three-slew, oscillatory, switching, three-axis, rate, or all for these;
        planned, which takes longer than they do; your own law as module:Class; an installed law; or
        a scenario file, of which [control] is used. With a scenario any laws that suit it. May be
        given several times.
    count
        Random starts for each law, limit and level.
    seed
        Seed of the cases.
    out
        Folder for the table, the figure and the stores of the cases.
    engine
        As for `jaxsat montecarlo`.
    workers
        Threads, each of which computes one chunk; by default the number of processors.
    bounds
        Starts of the search for the minimum time and effort, as in `jaxsat bound`, from the paper's
        start under each limit; 0 skips it.
    end
        Where the least times end that stand below the table. settled: within the tolerances, as
        laws do; rest: exactly at rest, which laws do not reach, so that nothing is divided by them.
    csv
        CSV file of all cases, one row each: law, outcome, times, effort, final state and drawn
        values. Column names contain the units.
    report
        Also write a report, as `jaxsat report` does: report.html in the output folder, or the given
        file.
    overwrite
        Replace the files of --csv and --report; results in the folder are resumed.
    yes
        Start even if the work exceeds the limits of steps, memory or disk.
    elsewhere
        Resume stores that were started with other versions or on another processor, if the program
        is the same.
    digits
        Significant digits of the numbers that are printed, at least; by default about four.
    quiet
        Print only warnings and errors.
    """
    del digits  # `jaxsat.cli.app` sees to it
    given = (level, torque_limit, bounds, end, csv) != (("hard",), ("5",), 0, "settled", None)
    if scenario is not None:
        if given:
            only = "--level, --torque-limit, --bounds, --end and --csv"
            raise UserMistake(f"{only}: must be given without a scenario")
        if overwrite and report is False:
            raise UserMistake("--overwrite: must be given with --report; a comparison is resumed")
        planned = planned_report(report, out, overwrite=overwrite)
        options = Options(law, count, seed, out, engine, workers, yes, elsewhere, quiet)
        compare_in_scenario(scenario, overrides, options)
        finish_report(planned, quiet=quiet)
        return SUCCESS
    if overrides:
        raise UserMistake("--set: must be given with a scenario")
    limits = torque_limits(torque_limit)
    if csv is not None:
        refuse_nested(("--csv", csv), ("--out", out))
        refuse_csv(csv, overwrite=overwrite)
    elif overwrite and report is False:
        raise UserMistake(
            "--overwrite: must be given with --csv or --report, as a comparison is resumed"
        )
    planned = planned_report(report, out, overwrite=overwrite)
    use_double_precision()
    from jaxsat.store import ResumableFolder, save_file
    from jaxsat.synthesis.comparison import (
        LAWS,
        LEVELS,
        ComparisonRun,
        comparison_settings,
        least_times,
    )

    others = dict.fromkeys(one for one in law if one not in (*LAWS, "all"))
    settings = comparison_settings([*_chosen(law, LAWS), *others], _chosen(level, LEVELS), limits)
    _require_suitable(settings)
    _tell_of_untuned(limits)
    require_approval([_work(one, count) for one in settings], out, yes=yes, quiet=quiet)
    executor = chosen_executor(workers, None, None, None)
    run = ComparisonRun(
        count, seed, out, engine, executor, elsewhere, told, remarks(quiet), tell_repair
    )
    try:
        with study_problems():
            with ResumableFolder(out, "comparison", {}) as folder:
                rows, verdicts = _run(run, settings)
                found = [least_bounds(one, bounds, seed, end, folder) for one in limits if bounds]
                least = least_times(rows, seed, end)
                _write(folder, rows, verdicts, found, least, seed)
            if csv is not None:
                content = interruptibly(lambda: run.table(settings).to_csv(index=False))
                save_file(csv, content, overwrite=overwrite, option="--csv")
    except (KeyboardInterrupt, Terminated) as stop:
        kept = f"the results so far are in {out}; the same command resumes"
        raise type(stop)(kept) from None
    if not quiet:
        of_starts = map(least_time_text, least)
        for line in (*comparison_lines(rows, verdicts), *of_starts, *map(least_text, found)):
            print_stdout(line)
        print_stdout(f"written to {out}{f' and {csv}' if csv else ''}")
    finish_report(planned, quiet=quiet)
    return SUCCESS


def _run(run: "ComparisonRun", settings: Sequence["ComparisonSetting"]) -> "Comparison":
    from jaxsat.synthesis.comparison import UnsuitableSetting

    try:
        return interruptibly(lambda: run.run(settings))
    except UnsuitableSetting as error:
        raise UserMistake(str(error)) from None


def _work(setting: "ComparisonSetting", count: int) -> "Work":
    """What the cases of one setting take, about: a law is looked at ten times a second."""
    from jaxsat.studies import Work
    from jaxsat.synthesis.comparison import PERIOD, horizon

    steps = round(horizon(setting.torque_limit) / PERIOD)
    return Work(count + 1, (count + 1) * steps, count * CASE, count * CASE)


def _require_suitable(settings: Sequence["ComparisonSetting"]) -> None:
    """Raise `UserMistake` for laws that do not come with the set and that it cannot fly."""
    from jaxsat.scenario import ScenarioError
    from jaxsat.synthesis.comparison import require_suitable

    try:
        require_suitable(settings)
    except ScenarioError as error:
        raise UserMistake(str(error), located=True) from None
    except ValueError as error:
        raise UserMistake(f"--law: {error}") from None


def _chosen(given: Sequence[str], known: Iterable[str]) -> list[str]:
    return [one for one in known if one in given or "all" in given]


def _tell_of_untuned(limits: Sequence[float]) -> None:
    from jaxsat.core.declaration.settling import TUNED_LIMITS

    tuned = ", ".join(f"{one:g}" for one in TUNED_LIMITS)
    for limit in limits:
        if limit not in TUNED_LIMITS:
            inside = min(TUNED_LIMITS) < limit < max(TUNED_LIMITS)
            how = "interpolated" if inside else "those of the nearest"
            print_stderr(f"gains are tuned for {tuned} N m, for {limit:g} N m {how}", "warning: ")


def _write(
    folder: "ResumableFolder",
    rows: Sequence["ComparisonRow"],
    verdicts: Sequence["ComparisonVerdict"],
    bounds: Sequence[dict[str, Any]],
    least: Sequence["LeastTime"],
    seed: int,
) -> None:
    from jaxsat.report.saving import save_figures
    from jaxsat.store import provenance

    record = {
        "command": command_line(),
        "seed": seed,
        "rows": [row.as_data() for row in rows],
        "verdicts": [one._asdict() for one in verdicts],
        "bounds_from_papers_start": list(bounds),
        "median_least_times": [
            {"torque_limit": one.torque_limit, "end": one.end, "seconds": one.median}
            for one in least
        ],
        **provenance(),
    }
    text = json.dumps(record, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    folder.write(RESULT, text)
    save_figures(lambda: _figures(rows), folder.write)


def _figures(rows: Sequence["ComparisonRow"]) -> "dict[str, Figure]":
    from jaxsat.report.comparison_figures import settling_comparison
    from jaxsat.synthesis.comparison import horizon

    panels: dict[tuple[str, float | None], dict[str, Any]] = {}
    for row in rows:
        panels.setdefault(row.setting[:2], {})[row.setting.law] = row.settling_times
    horizons = {row.setting[:2]: horizon(row.setting.torque_limit) for row in rows}
    title = "Three axes with two torques, third rate free"
    return {"comparison": settling_comparison(panels, horizons, title)}
