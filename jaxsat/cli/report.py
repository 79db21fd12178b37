"""`jaxsat report`: one HTML file of results."""

from collections.abc import Sequence
from pathlib import Path

from jaxsat.cli.computing import interruptibly, use_double_precision
from jaxsat.cli.options import Flag, OutputPath, place
from jaxsat.cli.progress import show_progress
from jaxsat.cli.terminal import SUCCESS, UserMistake, output_problem, print_stdout


def report(
    *paths: str,
    out: OutputPath = Path("jaxsat-report.html"),
    overwrite: Flag = False,
    quiet: Flag = False,
) -> int:
    """Write one HTML file of results: verdict, 3-D replay, linked plots, tables, provenance.

    The file needs no network. Several paths go into one file.

    Parameters
    ----------
    paths
        Folders and stores that jaxsat wrote: of a run, a study, a tuning, a comparison or a
        reproduction.
    out
        File to write.
    overwrite
        Replace the file.
    quiet
        Print nothing unless something is wrong.
    """
    if not paths:
        raise UserMistake("report: must be given at least one path, got none")
    use_double_precision()
    write_report([place("PATH", path) for path in paths], out, overwrite=overwrite)
    if not quiet:
        print_stdout(f"written to {out}")
    return SUCCESS


def write_report(paths: Sequence[Path], out: Path, *, overwrite: bool) -> None:
    """Make the page of results and write it; raises `UserMistake` or `FailedRun`."""
    from jaxsat.results import OutputError, refuse_existing, save_file

    try:
        refuse_existing(out, overwrite=overwrite)
        show_progress("making the report")
        page = interruptibly(lambda: _page(paths))
        save_file(out, page, overwrite=overwrite)
    except OutputError as error:
        raise output_problem(error) from None


def _page(paths: Sequence[Path]) -> str:
    from jaxsat.page import MissingPackages, report_page

    try:
        return report_page(paths)
    except MissingPackages as error:
        raise UserMistake(str(error)) from None
