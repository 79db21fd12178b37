"""`jaxsat convert`: the trajectory of a run in a format that other programs read."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from jaxsat.cli.computing import interruptibly, use_double_precision
from jaxsat.cli.options import Flag, OptionalPath, Text, mistake, place
from jaxsat.cli.progress import show_progress
from jaxsat.cli.terminal import SUCCESS, UserMistake, output_problem, print_stdout

if TYPE_CHECKING:
    import numpy as np


def convert(
    run: str,
    /,
    *,
    to: Literal["aem", "csv"],
    out: OptionalPath = None,
    epoch: Text = None,
    frame: Literal["inertial", "orbit"] = "inertial",
    object_name: Text = None,
    object_id: Text = None,
    overwrite: Flag = False,
    quiet: Flag = False,
) -> int:
    """Write the trajectory of a run as a CCSDS attitude ephemeris (AEM) or as CSV.

    Parameters
    ----------
    run
        Folder that `jaxsat simulate` or `montecarlo --case` wrote, or its trajectory.nc.
    to
        aem: quaternions over UTC as defined by CCSDS 504.0-B; csv: all signals, one column each.
    out
        File to write; by default that of the run with .aem or .csv.
    epoch
        UTC at the start of the run, such as 2026-03-20T12:00:00; for AEM.
    frame
        Reference frame of an AEM: inertial (EME2000), computed with the angles of [orbit], or orbit
        (LVLH: x along the velocity, z to the Earth's centre).
    object_name
        OBJECT_NAME of an AEM; by default the title of the scenario.
    object_id
        OBJECT_ID of an AEM, such as 2026-001A; by default UNKNOWN.
    overwrite
        Replace the file.
    quiet
        Print only warnings and errors.
    """
    path = place("RUN", run)
    target = out or Path(f"{path.name if path.is_dir() else path.stem}.{to}")
    if to == "csv" and epoch is not None:
        raise UserMistake("--epoch: must be given with --to aem, as CSV has seconds")
    start = _epoch(epoch) if to == "aem" else None
    from jaxsat.results import OutputError, refuse_existing, save_file

    try:
        refuse_existing(target, overwrite=overwrite)
        use_double_precision()
        show_progress(f"reading {path}")
        text = interruptibly(lambda: _converted(path, start, frame, object_name, object_id))
        save_file(target, text, overwrite=overwrite)
    except OutputError as error:
        raise output_problem(error) from None
    if not quiet:
        print_stdout(f"written to {target}")
    return SUCCESS


def _converted(
    path: Path,
    start: "np.datetime64 | None",
    frame: str,
    name: str | None,
    identifier: str | None,
) -> str:
    from jaxsat.conversion import ConversionError, attitude_ephemeris, signal_table
    from jaxsat.results import open_trajectory

    dataset = open_trajectory(path)
    if start is None:
        return signal_table(dataset)
    try:
        return attitude_ephemeris(
            dataset,
            start,
            frame=frame,
            object_name=name or "",
            object_id=identifier or "UNKNOWN",
        )
    except ConversionError as error:
        raise UserMistake(f"{path}: {error}") from None


def _epoch(text: str | None) -> "np.datetime64":
    import numpy as np

    form = "a date and time in UTC such as 2026-03-20T12:00:00"
    if text is None:
        raise UserMistake(f"--epoch: must be given with --to aem, {form}, got nothing")
    try:
        found = np.datetime64(text.strip().removesuffix("Z"), "ns")
    except ValueError:
        raise mistake("--epoch", form, text) from None
    if np.isnat(found) or "T" not in text:
        raise mistake("--epoch", form, text)
    return found
