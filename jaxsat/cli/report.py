"""`jaxsat report`: one HTML file of results, and `--report` of the commands that write results."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from jaxsat.cli.computing import dask_unseen, interruptibly, use_double_precision
from jaxsat.cli.options import Output, Results, place
from jaxsat.cli.progress import show_progress
from jaxsat.cli.study_files import refuse_nested
from jaxsat.cli.terminal import SUCCESS, UserMistake, print_document, print_stdout

if TYPE_CHECKING:
    from jaxsat.report.document import Document

REPORT = "report.html"
"""Name of the file that `--report` writes into a folder of results."""


def report(*paths: str, output: Output = Output()) -> int:
    """Write one HTML file of results: verdict, 3-D replay, linked plots, tables, provenance.

    The file needs no network. Several paths go into one file. Commands that write results write a
    report of them with --report.

    Parameters
    ----------
    paths
        Folders and stores that jaxsat wrote: of a run, a study, a tuning, a comparison, a design,
        a verification, a rare event, a worst case, a reproduction, or an analysis of
        controllability.
    output.out
        File to write; by default jaxsat-report.html.
    output.overwrite
        Replace the file.
    """
    if not paths:
        raise UserMistake("report: must be given at least one path, got none")
    use_double_precision()
    _require_packages()
    out = output.out or Path("jaxsat-report.html")
    write_report([place("PATH", path) for path in paths], out, overwrite=output.overwrite)
    if not output.quiet:
        print_stdout(f"written to {out}")
    return SUCCESS


def write_report(paths: Sequence[Path], out: Path, *, overwrite: bool) -> None:
    """Make the page of results and write it; raises `OutputError` or `UserMistake`."""
    from jaxsat.store.files import refuse_existing, save_file

    refuse_existing(out, overwrite=overwrite)
    save_file(out, _page(paths), overwrite=overwrite)


@dataclass(frozen=True)
class PlannedReport:
    """The report requested by `--report`: a page of `results`, in their folder or elsewhere."""

    results: Path
    file: Path
    inside: bool
    overwrite: bool

    def write(self) -> None:
        """Make and write the page, once the results are written."""
        from jaxsat.store.files import save_file
        from jaxsat.store.resumable import ResumableFolder

        use_double_precision()
        page = _page([self.results])
        if self.inside:
            with ResumableFolder.of_any_kind(self.results) as folder:
                folder.write(REPORT, page)
        else:
            save_file(self.file, page, overwrite=self.overwrite, option="--report")


def planned_report(options: Results, results: Path, *, store: bool = False) -> PlannedReport | None:
    """Return the report requested by `--report`, or None; raises `UserMistake` for impossible ones.

    `results` is the path of the results; with `store` it is that of a study, and the page is beside
    it.
    """
    request, overwrite = options.report, options.overwrite
    if request is False:
        return None
    from jaxsat.store.files import refuse_existing

    _require_packages()
    if request is True:
        file = results.with_suffix(".html") if store else results / REPORT
    else:
        file = place("--report", str(request))
    if not store and os.path.realpath(file) == os.path.realpath(results / REPORT):
        return PlannedReport(results, file, inside=True, overwrite=overwrite)
    refuse_nested(("--report", file), ("--out", results))
    refuse_existing(file, overwrite=overwrite, option="--report")
    return PlannedReport(results, file, inside=False, overwrite=overwrite)


def finish_report(plan: PlannedReport | None, *, quiet: bool) -> None:
    """Write the requested page, and print its path."""
    if plan is None:
        return
    plan.write()
    if not quiet:
        print_stdout(f"report written to {plan.file}")


def present(
    document: "Document",
    target: Path,
    results: Results,
    report: PlannedReport | None,
    already: str = "",
) -> None:
    """Print the document of results unless quiet, and write their report."""
    if not results.quiet:
        print_document(document)
        print_stdout("")
        print_stdout(f"{already}written to {target}")
    finish_report(report, quiet=results.quiet)


def _require_packages() -> None:
    from jaxsat.report.page import MissingPackages, require_packages

    try:
        require_packages()
    except MissingPackages as error:
        raise UserMistake(str(error)) from None


def _page(paths: Sequence[Path]) -> str:
    from jaxsat.report.page import report_page

    show_progress("making the report")
    with dask_unseen():
        return interruptibly(lambda: report_page(paths))
