"""A design in one call, with the folder of the way: `design`."""

import json
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from jaxsat.core.processors import processors
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.study import EngineName
from jaxsat.scenario.laws import known_law
from jaxsat.store import OutputError, ResumableFolder
from jaxsat.store.differences import differences
from jaxsat.studies import AbstractExecutor, Serial, Threads
from jaxsat.synthesis.controller_design.files import write_files
from jaxsat.synthesis.controller_design.reading import ALL
from jaxsat.synthesis.controller_design.result import ControllerDesign
from jaxsat.synthesis.controller_design.settings import Attitude, DesignSettings, Goal
from jaxsat.synthesis.controller_design.steps import DesignRun
from jaxsat.synthesis.controller_design.studies import Report, Studies

KIND = "design"
"""Of the output folder."""


def design(
    scenario: Scenario,
    *,
    law: str | None = None,
    settled: float = 0.99,
    cases: int = 2000,
    steps: int = 16,
    seed: int | None = None,
    attitude: Attitude = "wanted",
    goal: Goal = "quickest",
    engine: EngineName = "auto",
    executor: AbstractExecutor | None = None,
    out: str | Path | None = None,
    elsewhere: bool = False,
    timed: bool = True,
    report: Report = lambda what, progress: None,
    remark: Callable[[str], None] = lambda text: None,
) -> ControllerDesign:
    """Design a controller for the vehicle of a scenario, and verify it on cases never seen before.

    `law` is the law to design, "all" for every law of jaxsat that fits, None for the scenario's own
    ("all" if that is "coast"). At least a fraction `settled` of `cases` cases must settle; `steps`
    are those of the tuner, 0 for none. The seeds of the steps are `seed` (the scenario's own if
    left out) and the three that follow. With `attitude` "nearest" the target is the nearest
    attitude that can be held. The `goal` "settled" is done with the first law that surely settles
    the wanted fraction, and tunes only where none does. Without `timed` the scenario's duration
    counts for nothing. With `out` the design is kept in that folder, as by `jaxsat design`, and the
    same call resumes it; `engine`, `executor` and `elsewhere` are those of a study. `report` is
    called with what runs and how far it is, `remark` with what there is to be told besides.

    Raises `ValueError` for arguments that cannot be and `OutputError` for a folder that cannot be
    used. A vehicle with nothing to design raises nothing: see `ControllerDesign.outcome`.
    """
    own = scenario.control.law
    settings = DesignSettings(
        law=(ALL if own == "coast" else own) if law is None else law,
        settled=settled,
        cases=cases,
        steps=steps,
        seed=scenario.simulation.seed if seed is None else seed,
        attitude=attitude,
        goal=goal,
        engine=engine,
    )
    _require_law(settings.law)
    identity = {"scenario": scenario.model_dump(mode="json"), "timed": timed, **settings.identity()}
    with ExitStack() as stack:
        place = out
        if place is None:
            place = Path(stack.enter_context(tempfile.TemporaryDirectory())) / KIND
        folder = stack.enter_context(_folder(place, identity))
        chosen = executor or (Threads(processors()) if processors() > 1 else Serial())
        studies = Studies(folder, engine, chosen, elsewhere, report, remark)
        found = DesignRun(scenario, settings, studies, timed).run()
        if out is not None:
            report("figures and files", None)
            write_files(found, folder)
        return found


def _folder(place: str | Path, identity: dict[str, Any]) -> ResumableFolder:
    """The folder of this design, new or to be resumed."""
    identity = json.loads(json.dumps(identity))
    folder = ResumableFolder(place, KIND, {"identity": identity})
    other = differences(folder.about["identity"], identity)
    if other:
        folder.close()
        raise OutputError(
            f"{folder.path} holds another design ({'; '.join(other)}); give another folder."
        )
    return folder


def _require_law(name: str) -> None:
    """Raise `ValueError` for a law that there is not or that aims at no attitude."""
    if name == ALL:
        return
    law = known_law(name)
    if law is None:
        raise ValueError(f"Argument `law` must be a law or all, but got {name}.")
    if not law.declaration.regulates_attitude or not law.declaration.torques:
        raise ValueError(f"Argument `law` must be one that aims at an attitude, but got {name}.")
