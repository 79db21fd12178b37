"""Failures and outages that are allowed and yet likely a mistake: those that never strike."""

from collections.abc import Iterator

from jaxsat.scenario.dispersion_tables import DistributionTable
from jaxsat.scenario.errors import Issue, Location
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.thruster_tables import FailureTable, number_of
from jaxsat.scenario.wording import shown

IDLE = {"wheel": ("dead", "degraded"), "magnetorquer": ("dead", "degraded", "reversed")}
"""Kinds that change nothing of what the law does not use; other ones make a torque."""

LASTING = ("dead", "stopped")
"""Kinds after which one does not expect that an actuator works again."""


def failure_cautions(scenario: Scenario) -> Iterator[Issue]:
    """What never strikes, what strikes an actuator that has failed, and what ends a failure."""
    yield from _after_the_end(scenario)
    for number, one in enumerate(scenario.failure):
        if _failed_before(scenario, one):
            message = "should be an actuator that works at the start, else nothing more fails"
            yield Issue(("failure", number, "of"), f"{message}, got {shown(one.of)}")
    if _drawn(scenario, "failure_time_s") is None:
        yield from _working_again(scenario)


def _after_the_end(scenario: Scenario) -> Iterator[Issue]:
    """Times at or after the end of the run; of those that are drawn the least ones."""
    outage = getattr(scenario.star_tracker, "outage_start_s", None)
    begins: dict[str, dict[Location, float]] = {
        "failure_time_s": {
            ("failure", number, "at_s"): one.at_s for number, one in enumerate(scenario.failure)
        },
        "tracker_outage_start_s": {}
        if outage is None
        else {("star_tracker", "outage_start_s"): outage},
    }
    end = scenario.simulation.duration_s
    for key, times in begins.items():
        drawn = _drawn(scenario, key)
        for location, at in (times if drawn is None else _least(key, drawn)).items():
            if at >= end:
                message = f"should be before simulation.duration_s = {shown(end)}"
                yield Issue(location, f"{message}, else it never strikes, got {shown(at)}")


def _drawn(scenario: Scenario, key: str) -> DistributionTable | None:
    return getattr(scenario.dispersion, key, None)


def _least(key: str, drawn: DistributionTable) -> dict[Location, float]:
    """The least number that is drawn, and where it is told; nothing where there is none."""
    for name in ("low", "values"):
        told = getattr(drawn, name)
        if told is not None:
            return {("dispersion", key, name): min(told) if isinstance(told, tuple) else told}
    return {}


def _failed_before(scenario: Scenario, one: FailureTable) -> bool:
    """Whether it changes nothing of what has failed before the start."""
    if one.kind not in IDLE.get(one.part, (one.kind,)):
        return False
    if one.part == "thruster" and not scenario.thruster:
        return one.of.partition(" ")[2] in map(str, scenario.spacecraft.failed_thrusters)
    tables = getattr(scenario, one.part)
    number = number_of(one.of, one.part, tables)
    return number is not None and tables[number].failed


def _working_again(scenario: Scenario) -> Iterator[Issue]:
    """Failures of what was dead or had seized, which end that."""
    last: dict[str, FailureTable] = {}
    for number, one in sorted(enumerate(scenario.failure), key=lambda found: found[1].at_s):
        before = last.get(one.of)
        if before is not None and before.kind in LASTING and one.kind not in LASTING:
            yield Issue(
                ("failure", number, "kind"),
                f'should be meant to replace "{before.kind}" at {shown(before.at_s)} s, after '
                f"which {one.of} works again in part, got {shown(one.kind)}",
            )
        last[one.of] = one
