"""Check of a `[dispersion]` table by construction of its distributions."""

from collections.abc import Iterator

import numpy as np

from jaxsat.core.checks import as_float
from jaxsat.core.declaration.quantities import DISPERSIBLE, EXCLUSIVE
from jaxsat.core.errors import ArgumentError
from jaxsat.scenario.build.errors import at_key
from jaxsat.scenario.build.run import Run
from jaxsat.scenario.derived import is_upside_down
from jaxsat.scenario.dispersion_tables import PARAMETERS, DispersionTable, DistributionTable
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.rules import at
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.wording import refusal_text, shown
from jaxsat.studies.designs import LAST_OF_SOBOL
from jaxsat.studies.dispersion_problems import dispersion_problems
from jaxsat.studies.distributions import (
    AbstractProbabilityDistribution,
    Discrete,
    Normal,
    RandomAttitude,
    TruncatedNormal,
    Uniform,
)


def dispersion_issues(scenario: Scenario, run: Run, all_fit: bool) -> list[Issue]:
    """Return issues on invalid distributions, and on values that their quantities cannot have.

    With `all_fit`, or if a case is to be simulated, also on quantities that the loop does not have,
    and on other obstacles to a study. Raises `BuildError` if its program cannot be built.
    """
    table = scenario.dispersion
    assert table is not None
    all_fit = all_fit or table.case is not None
    distributions: dict[str, AbstractProbabilityDistribution] = {}
    issues = list(_exclusions(table))
    for name, entry in table.distributions.items():
        try:
            distributions[name] = distribution_of(entry)
        except ArgumentError as error:
            place = (error.argument,) if error.argument in PARAMETERS[entry.distribution] else ()
            message = refusal_text(error, entry.distribution)
            issues.append(Issue(("dispersion", DISPERSIBLE[name].key, *place), message))
    for problem in dispersion_problems(distributions, table.frequency_known, run.loop, run.start):
        if all_fit or not problem.lacking:
            key = f"{DISPERSIBLE[problem.quantity].key}.{problem.parameter or ''}".rstrip(".")
            if problem.parameter == "frequency_known":
                key = "frequency_known"
            got = "" if problem.got is None else f", got {problem.got}"
            issues.append(at(f"dispersion.{key}", f"{problem.rule}{got}"))
    if all_fit and not issues:
        from jaxsat.scenario.build.study import study_program  # slow

        issues += _start_of_a_study(scenario, set(distributions))
        with at_key("simulation.duration_s"):
            copies, _ = study_program(scenario, run, scenario.simulation.seed)
            size = sum(copies.dimensions().values())
            if table.point is not None and len(table.point) != size:
                rule = f"must have {size} numbers for the dispersed quantities"
                issues.append(at("dispersion.point", f"{rule}, got {len(table.point)}"))
    return issues


def _exclusions(table: DispersionTable) -> Iterator[Issue]:
    for one, other in EXCLUSIVE:
        if {one, other} <= table.distributions.keys():
            first, second = DISPERSIBLE[one].key, DISPERSIBLE[other].key
            yield at(f"dispersion.{second}", f"must be omitted with dispersion.{first}, got both")
    if table.case is None or table.point is not None:
        return
    if table.design == "latin-hypercube":
        yield at("dispersion.case", "must be omitted where cases depend on how many there are")
    if table.design == "sobol" and table.case > LAST_OF_SOBOL:
        rule = f"must be at most {LAST_OF_SOBOL} in a Sobol sequence"
        yield at("dispersion.case", f"{rule}, got {table.case}")


def _start_of_a_study(scenario: Scenario, names: set[str]) -> Iterator[Issue]:
    quaternion = scenario.initial.quaternion
    turns = any(DISPERSIBLE[name].turns for name in names)
    if quaternion is not None and not turns and is_upside_down(quaternion):
        yield at(
            "initial.quaternion",
            "must not be upside down in a study that does not draw attitudes: its cost weighs the "
            f"(w, z), which are singular there, got {shown(quaternion)}",
        )


_KINDS = {
    "uniform": Uniform,
    "normal": Normal,
    "truncated-normal": TruncatedNormal,
    "discrete": Discrete,
    "random-attitude": RandomAttitude,
}


def distribution_of(table: DistributionTable) -> AbstractProbabilityDistribution:
    """Return the distribution of a table; raises `ValueError` for invalid parameters."""
    kind = table.distribution
    parameters = [as_float(np.asarray(getattr(table, name))) for name in PARAMETERS[kind]]
    return _KINDS[kind](*parameters)
