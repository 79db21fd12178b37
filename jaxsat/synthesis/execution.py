"""Execution of tunings, comparisons and designs: engine, callbacks, and the folder of records."""

import dataclasses
import json
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jaxsat.core.package_files import text_of
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.study import EngineName
from jaxsat.scenario.resolution import excessive_error
from jaxsat.store.files import OutputError
from jaxsat.store.header import differences
from jaxsat.store.ledger import study_columns
from jaxsat.store.provenance import machine, record_of
from jaxsat.store.resumable import ResumableFolder
from jaxsat.studies.columns import ERRORS
from jaxsat.studies.ensemble import Study
from jaxsat.studies.executors import AbstractExecutor
from jaxsat.studies.run import run_study
from jaxsat.studies.statistics import AbstractStopRule
from jaxsat.studies.summary import largest_errors
from jaxsat.studies.work import Work, study_work


@dataclass(frozen=True)
class Execution:
    """Execution of studies: `engine` as in `build_study`, `executor`, `elsewhere` as in
    `run_study`."""

    engine: EngineName = "auto"
    executor: AbstractExecutor | None = None
    elsewhere: bool = False

    def work(self, study: Study) -> Work:
        """Return the largest work of a study by this executor."""
        return study_work(study, workers=1 if self.executor is None else self.executor.at_once)


@dataclass(frozen=True)
class Listener:
    """Callbacks of a long computation.

    `progress` gets the name of a part and its state: a `StudyProgress`, a `DescentProgress` or
    None. `remark` gets notes, such as why an engine is not used, and `warn` likely mistakes and
    repairs of stores. `approve` gets the estimated work before anything is computed or written; an
    exception from it ends the call.
    """

    progress: Callable[[str, Any], None] = lambda what, at: None
    remark: Callable[[str], None] = lambda text: None
    warn: Callable[[str], None] = warnings.warn
    approve: Callable[[Sequence[Work]], None] = lambda works: None


def run_columns(
    study: Study,
    scenario: Scenario,
    store: Path,
    what: str,
    execution: Execution = Execution(),
    listener: Listener = Listener(),
    *,
    until: AbstractStopRule | None = None,
) -> dict[str, np.ndarray]:
    """Run the cases that a study's store lacks, and return all columns by name.

    `until` stops the run by its rule. The listener gets progress under the name `what`, and a
    warning of solver errors larger than the `scenario` allows.
    """
    if study.remark is not None:
        listener.remark(study.remark)
    listener.progress(what, None)
    count = run_study(
        study,
        store,
        executor=execution.executor,
        until=until,
        report=lambda progress: listener.progress(what, progress),
        tell=listener.warn,
        elsewhere=execution.elsewhere,
    )
    columns = study_columns(store)
    errors = largest_errors({name: columns[name][:count] for name in ERRORS if name in columns})
    excess = excessive_error((errors["rate_error"], errors["attitude_error"]), scenario)
    if excess:
        listener.warn(f"{what}: {excess}")
    return {name: np.asarray(columns[name][:count]) for name in columns}


@contextmanager
def folder_of_call(
    out: str | Path | None,
    kind: str,
    identity: Mapping[str, Any] | None = None,
    elsewhere: bool | None = None,
) -> Iterator[ResumableFolder]:
    """Open the folder by which the same call is resumed; without `out` a temporary one.

    Raises `OutputError` as `resumable_folder` does.
    """
    with ExitStack() as stack:
        if out is None:
            out = Path(stack.enter_context(tempfile.TemporaryDirectory())) / kind
        yield stack.enter_context(resumable_folder(out, kind, identity, kind, elsewhere))


def resumable_folder(
    path: str | Path,
    kind: str,
    identity: Mapping[str, Any] | None,
    what: str,
    elsewhere: bool | None = None,
) -> ResumableFolder:
    """Open a folder of one kind of result, new or of the same `identity` (plain data, if any).

    Raises `OutputError` for a folder that cannot be used, that holds another `what`, or (with
    `elsewhere` false, not None) that was begun with other versions or on another processor, where
    the bits may differ.
    """
    if identity is None:
        return ResumableFolder(path, kind, {})
    about: dict[str, Any] = {"identity": identity}
    if elsewhere is not None:
        about["machine"] = machine()
    about = json.loads(json.dumps(about))
    folder = ResumableFolder(path, kind, about)
    try:
        if other := differences(folder.about["identity"], about["identity"]):
            raise OutputError(
                f"{folder.path} holds another {what} ({'; '.join(other)}); give another folder."
            )
        machine_then = folder.about.get("machine", {})
        if elsewhere is False and (other := differences(machine_then, about["machine"])):
            raise OutputError(
                f"{folder.path} was begun under other conditions ({'; '.join(other)}), so results "
                "may differ in their last bits; allow that explicitly or give another folder.",
                elsewhere=True,
            )
    except BaseException:
        folder.close()
        raise
    return folder


def plain_data(value: Any) -> Any:
    """Convert nested results to plain data for JSON; numbers that are not finite become None.

    A result becomes what its `as_data` returns or, without that, its fields by name.
    """
    if hasattr(value, "as_data"):
        return plain_data(value.as_data())
    if isinstance(value, dict):
        return {str(key): plain_data(entry) for key, entry in value.items()}
    if hasattr(value, "_asdict"):
        return plain_data(value._asdict())
    if dataclasses.is_dataclass(value):
        return plain_data(vars(value))
    if isinstance(value, np.ndarray):
        return plain_data(value.tolist())
    if isinstance(value, list | tuple):
        return [plain_data(entry) for entry in value]
    if isinstance(value, np.generic):
        return plain_data(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def write_record(folder: ResumableFolder, package: str, name: str, result: Any) -> dict[str, Any]:
    """Write the record of a result with its JSON Schema, a file of the `package`; return it."""
    record, schema = record_of(plain_data(result)), f"{name}.schema.json"
    folder.write(f"{name}.json", json.dumps(record, indent=1, ensure_ascii=False) + "\n")
    folder.write(schema, text_of(package, schema))
    return record
