"""`jaxsat convert`: runs and studies for other programs, and spacecraft of 42 as scenarios."""

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from jaxsat.cli.computing import interruptibly, use_double_precision
from jaxsat.cli.options import Output, Text, mistake, place
from jaxsat.cli.progress import show_progress
from jaxsat.cli.terminal import SUCCESS, UserMistake, print_stdout, print_warning
from jaxsat.core.text import clean

if TYPE_CHECKING:
    import numpy as np

    from jaxsat.scenario.spacecraft_42 import Converted


def convert(
    source: str,
    /,
    *,
    to: Literal["aem", "csv", "mat", "parquet", "scenario"],
    epoch: Text = None,
    frame: Literal["inertial", "orbit"] = "inertial",
    object_name: Text = None,
    object_id: Text = None,
    output: Output = Output(),
) -> int:
    """Write a run or a study for MATLAB or as CSV or Parquet, a run as CCSDS attitude ephemeris
    (AEM), or a spacecraft of 42 as a scenario.

    Parameters
    ----------
    source
        Folder that `jaxsat simulate` or `montecarlo --case` wrote, or its trajectory.nc; the store
        of a study, but for AEM; for a scenario a spacecraft file of the simulator 42.
    to
        aem: quaternions over UTC as defined by CCSDS 504.0-B; csv, parquet: a column for each
        signal of a run or result of a case; mat: all arrays, with their units; scenario: inertia,
        wheels, magnetorquers and thrusters of one rigid body.
    output.out
        File to write; by default beside the source, with its name and the ending of the format
        (.toml for a scenario).
    epoch
        UTC at the start of the run, such as 2026-03-20T12:00:00; for AEM. By default the epoch of
        the scenario.
    frame
        Reference frame of an AEM: inertial (EME2000), computed with the angles of [orbit], or orbit
        (LVLH: x along the velocity, z to the Earth's centre).
    object_name
        OBJECT_NAME of an AEM; by default the title of the scenario.
    object_id
        OBJECT_ID of an AEM, such as 2026-001A; by default UNKNOWN.
    output.overwrite
        Replace the file.
    """
    path = place("SOURCE", source)
    target = output.out or _beside(path, "toml" if to == "scenario" else to)
    if to != "aem" and epoch is not None:
        raise UserMistake(f"--epoch: must be given with --to aem, got --to {to}")
    if to == "parquet" and find_spec("pyarrow") is None:
        raise UserMistake("--to parquet: must have pyarrow; pip install 'jaxsat[parquet]'")
    start = None if epoch is None else _epoch(epoch)
    from jaxsat.store.files import refuse_existing, save_file

    refuse_existing(target, overwrite=output.overwrite)
    left_out: list[str] = []
    content: str | bytes
    if to == "scenario":
        content, left_out = _spacecraft(path)
    else:
        use_double_precision()
        show_progress(f"reading {path}")
        content = interruptibly(lambda: _convert(path, to, start, frame, object_name, object_id))
    save_file(target, content, overwrite=output.overwrite)
    if not output.quiet:
        for line in left_out:
            print_stdout(f"not in it: {line}")
        print_stdout(f"written to {target}")
    return SUCCESS


def _spacecraft(path: Path) -> "Converted":
    from jaxsat.scenario.spacecraft_42 import SpacecraftFileError, scenario_of_42

    try:
        return scenario_of_42(_text(path), lambda name: _text(path.parent / name))
    except SpacecraftFileError as error:
        raise UserMistake(f"{path}: {clean(str(error))}") from None


def _text(path: Path) -> str:
    from jaxsat.scenario.limits import MAX_FILE_SIZE

    try:
        with path.open("rb") as file:
            content = file.read(MAX_FILE_SIZE + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        message = f"must be a file that can be read, got: {reason}"
        raise UserMistake(f"{clean(str(path))}: {message}") from None
    if len(content) > MAX_FILE_SIZE:
        raise UserMistake(f"{clean(str(path))}: must have at most {MAX_FILE_SIZE} bytes, got more")
    return content.decode(errors="replace")


def _beside(run: Path, ending: str) -> Path:
    """Return the path beside the folder of a run, even for its trajectory; else beside the file, or
    the store."""
    from jaxsat.store.marker import MARKER

    if _is_store(run) and run.suffix == ".zarr":
        return run.with_suffix(f".{ending}")
    if not run.is_dir():
        if not (run.parent / MARKER).is_file():
            return run.with_name(f"{run.stem}.{ending}")
        run = run.parent
    if run.name in ("", ".."):
        run = run.resolve()
    return run.parent / f"{run.name or 'run'}.{ending}"


def _is_store(path: Path) -> bool:
    from jaxsat.store.chunks import METADATA

    return (path / METADATA).is_file()


def _convert(
    path: Path,
    to: str,
    start: "np.datetime64 | None",
    frame: str,
    name: str | None,
    identifier: str | None,
) -> str | bytes:
    from jaxsat.cli.conversion import ConversionError, attitude_ephemeris, epoch_of_run
    from jaxsat.core.earth import EPOCH_FORM
    from jaxsat.store.dataset import coarseness, open_trajectory

    if to != "aem":
        return _file(path, to)
    dataset = open_trajectory(path)
    start = epoch_of_run(dataset) if start is None else start
    if start is None:
        raise UserMistake(
            "--epoch: must be given with --to aem where the scenario has no epoch, "
            f"{EPOCH_FORM}, got nothing"
        )
    warning = coarseness(dataset)
    if warning:
        print_warning(f"{path}: {warning}")
    try:
        return attitude_ephemeris(
            dataset, start, frame=frame, object_name=name or "", object_id=identifier or "UNKNOWN"
        )
    except ConversionError as error:
        raise UserMistake(f"{path}: {error}") from None


def _file(path: Path, to: str) -> bytes:
    from jaxsat.cli.conversion import FORMATS, FormatError
    from jaxsat.store.dataset import open_trajectory
    from jaxsat.store.tables import open_study

    try:
        return FORMATS[to](open_study(path) if _is_store(path) else open_trajectory(path))
    except FormatError as error:
        raise UserMistake(f"{path}: {error}") from None


def _epoch(text: str) -> "np.datetime64":
    from jaxsat.core.earth import epoch_of
    from jaxsat.core.errors import ArgumentError

    try:
        return epoch_of(text)
    except ArgumentError as error:
        raise mistake("--epoch", error.rule.removeprefix("must be "), text) from None
