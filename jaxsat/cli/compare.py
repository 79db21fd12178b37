"""`jaxsat compare`: laws on the acceptance set, or in any scenario."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from cyclopts import Parameter

from jaxsat.cli.computing import interruptibly, use_double_precision
from jaxsat.cli.listening import resumable
from jaxsat.cli.loading import load_scenario
from jaxsat.cli.options import (
    Cases,
    End,
    OptionalPath,
    Overrides,
    Resumable,
    Seed,
    StartsOrNone,
    TorqueLimits,
    option_mistake,
    torque_limits,
)
from jaxsat.cli.report import finish_report, planned_report
from jaxsat.cli.study_files import refuse_csv, refuse_nested
from jaxsat.cli.terminal import SUCCESS, UserMistake, print_document, print_stdout

Level = Literal["nominal", "mc", "hard", "all"]
Result = TypeVar("Result")


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class AcceptanceSet:
    """Options that apply only without a scenario.

    Parameters
    ----------
    level
        Dispersions: nominal, mc, hard or all; may be given several times.
    torque_limit
        Largest torque of each thruster in N m, or all for 1, 5 and 20; may be given several times.
    bounds
        Starts of the search for the minimum time and effort, as in `jaxsat bound`, from the paper's
        start under each limit; 0 skips it.
    end
        Where the least times end that stand below the table. settled: within the tolerances, as
        laws do; rest: exactly at rest, which laws do not reach, so that nothing is divided by them.
    csv
        CSV file of all cases, one row each: law, outcome, times, effort, final state and drawn
        values. Column names contain the units.
    """

    level: Annotated[tuple[Level, ...], Parameter(negative="")] = ("hard",)
    torque_limit: TorqueLimits = ("5",)
    bounds: StartsOrNone = 0
    end: End = "settled"
    csv: OptionalPath = None


def compare(
    scenario: str | None = None,
    /,
    *,
    overrides: Overrides = (),
    law: Annotated[tuple[str, ...], Parameter(negative="")] = ("all",),
    count: Cases = 200,
    seed: Seed,
    acceptance: AcceptanceSet = AcceptanceSet(),
    results: Resumable = Resumable(),
) -> int:
    """Compare laws on the same cases: those of a scenario, or of the acceptance set.

    With a scenario every --law flies its dispersed cases, failures in flight included; a scenario
    without [dispersion] has one case. Without a scenario the laws steer three axes with two
    torques, the paper's included: random starts and the paper's start, with a free third rate, a
    torque limit and dispersions. Prints a table and the recommended law, and writes both with
    figures. The same command resumes an interrupted run.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file; without one the acceptance set.
    law
        Laws to compare: three-slew, oscillatory, switching, three-axis, rate, or all for these;
        planned, which takes longer than they do; your own law as module:Class; an installed law; or
        a scenario file, of which [control] is used. With a scenario any laws that suit it, and all
        for its own and those that fit its actuators. May be given several times.
    count
        Random starts for each law, limit and level.
    seed
        Seed of the cases.
    results.out
        Folder for the table, the figure and the stores of the cases; by default jaxsat-comparison.
    results.overwrite
        Replace the files of --csv and --report; results in the folder are resumed.
    """
    out, csv = results.out or Path("jaxsat-comparison"), acceptance.csv
    if scenario is not None and acceptance != AcceptanceSet():
        only = "--level, --torque-limit, --bounds, --end and --csv"
        raise UserMistake(f"{only}: must be given without a scenario")
    if scenario is None and overrides:
        raise UserMistake("--set: must be given with a scenario")
    limits = torque_limits(acceptance.torque_limit)
    if csv is not None:
        refuse_nested(("--csv", csv), ("--out", out))
        refuse_csv(csv, overwrite=results.overwrite)
    elif results.overwrite and results.report is False:
        other = "--report; a comparison" if scenario else "--csv or --report, as a comparison"
        raise UserMistake(f"--overwrite: must be given with {other} is resumed")
    report = planned_report(results, out)
    use_double_precision()
    if scenario is None:
        record = _on_acceptance_set(law, limits, count, seed, acceptance, out, results)
    else:
        record = _in_scenario(scenario, overrides, law, count, seed, out, results)
    if not results.quiet:
        from jaxsat.report.comparison_document import comparison_document

        print_document(comparison_document(record))
        print_stdout(f"written to {out}{f' and {csv}' if csv else ''}")
    finish_report(report, quiet=results.quiet)
    return SUCCESS


def _on_acceptance_set(
    laws: Sequence[str],
    limits: Sequence[float],
    count: int,
    seed: int,
    acceptance: AcceptanceSet,
    out: Path,
    results: Resumable,
) -> dict[str, Any]:
    import jaxsat
    from jaxsat.store.files import save_file
    from jaxsat.synthesis.comparison.acceptance import LAWS, LEVELS

    others = dict.fromkeys(one for one in laws if one not in (*LAWS, "all"))
    comparison = _compute(
        out,
        results,
        lambda **into: jaxsat.compare(
            [*_select(laws, LAWS), *others],
            level=_select(acceptance.level, LEVELS),
            torque_limit=limits,
            count=count,
            seed=seed,
            bounds=acceptance.bounds,
            end=acceptance.end,
            **into,
        ),
    )
    csv = acceptance.csv
    if csv is not None:
        content = interruptibly(lambda: comparison.table(out).to_csv(index=False))
        save_file(csv, content, overwrite=results.overwrite, option="--csv")
    return comparison.as_data()


def _in_scenario(
    name: str,
    overrides: Sequence[str],
    laws: Sequence[str],
    count: int,
    seed: int,
    out: Path,
    results: Resumable,
) -> dict[str, Any]:
    scenario = load_scenario(name, overrides, "study")
    from jaxsat.synthesis.comparison.in_scenario import compare_in_scenario

    comparison = _compute(
        out,
        results,
        lambda **into: compare_in_scenario(scenario, laws, count=count, seed=seed, **into),
    )
    return comparison.as_data()


def _compute(out: Path, results: Resumable, work: Callable[..., Result]) -> Result:
    """Do the work; its errors become mistakes, and an interruption names `out`."""
    from jaxsat.synthesis.comparison.run import UnsuitableLaw, UnsuitableSetting

    try:
        return resumable(out, results, work)
    except UnsuitableLaw as error:
        raise option_mistake(error, ["law"], "--law: ") from None
    except (UnsuitableSetting, ModuleNotFoundError) as error:
        raise UserMistake(str(error)) from None


def _select(names: Sequence[str], options: Iterable[str]) -> list[str]:
    return [one for one in options if one in names or "all" in names]
