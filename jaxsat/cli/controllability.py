"""`jaxsat controllability`: can the remaining actuators still control the spacecraft?"""

from typing import Annotated

from cyclopts import Parameter

from jaxsat.cli.computing import interruptibly
from jaxsat.cli.loading import load_vehicle
from jaxsat.cli.options import Flag, Overrides, Results, number, whole
from jaxsat.cli.progress import show_progress
from jaxsat.cli.report import finish_report, planned_report
from jaxsat.cli.study_files import try_folder
from jaxsat.cli.terminal import SUCCESS, UserMistake, print_document, print_stdout


def controllability(
    scenario: str,
    /,
    *,
    overrides: Overrides = (),
    failures: Annotated[int | None, Parameter(converter=whole(0, 99))] = None,
    drift: Flag = False,
    tolerance: Annotated[float, Parameter(converter=number(0.0, 1.0, open_ends=True))] = 5e-6,
    results: Results = Results(),
) -> int:
    """Say whether the spacecraft of a scenario can be steered, now and after every failure.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file. [spacecraft] is enough.
    failures
        List only cases of so many failures; by default all.
    drift
        Also follow the drift: recurrence, and the energy claim (18). Takes a few seconds.
    tolerance
        Margins below this are called borderline; use the relative error of your inertia.
    results.out
        Folder for tables, maps and the page; by default nothing is written.
    """
    chosen = load_vehicle(scenario, overrides).scenario
    out, report = results.out, None
    if results.report is not False and out is None:
        raise UserMistake("--report: must be given with --out, the folder of the results")
    from jaxsat.store.folder import OutputFolder

    def output_folder() -> OutputFolder:
        assert out is not None
        return OutputFolder(out, kind="controllability", overwrite=results.overwrite)

    if out is not None:
        report = planned_report(results, out)
        try_folder(output_folder)
    from jaxsat.report.controllability_study import controllability_study

    study = interruptibly(
        lambda: controllability_study(
            chosen, drift=drift, tolerance=tolerance, report=show_progress
        )
    )
    if out is not None:
        show_progress("drawing maps")
        with output_folder() as folder:
            interruptibly(lambda: study.write(folder))
    if not results.quiet:
        print_document(study.document(failures))
        if out is not None:
            print_stdout(f"written to {out}")
    finish_report(report, quiet=results.quiet)
    return SUCCESS
