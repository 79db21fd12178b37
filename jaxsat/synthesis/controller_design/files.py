"""What a design leaves in its folder, every file whole; the record before the figures."""

import json
from typing import TYPE_CHECKING, Any

import jaxsat
from jaxsat.core.declaration.quantities import DISPERSIBLE
from jaxsat.report.design_document import DESIGNED, LINES, design_document
from jaxsat.report.markdown import markdown_page
from jaxsat.scenario import dump
from jaxsat.store import ResumableFolder, provenance
from jaxsat.synthesis.controller_design.explanation import drawn_numbers
from jaxsat.synthesis.controller_design.result import ControllerDesign, Step

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from jaxsat.report.study_figures import DrawnNumber

PAGE, RECORD = "design.md", "design.json"


def design_record(found: ControllerDesign) -> dict[str, Any]:
    """The record of a design, of which its document is made."""
    return {"title": found.original.title, "headline": found.headline, **found.as_data()}


def design_comment(found: ControllerDesign, version: str) -> str:
    """Lines for the head of the designed scenario: where it comes from and what it is proven on."""
    verification = found.verification
    assert verification is not None
    lines = [
        f"Designed by jaxsat {version} for: {found.original.title}",
        *[f"  {line}" for line in found.verdict.lines()],
        found.headline,
        f"Verification: seed {found.settings.seeds.verification}, by "
        f"`jaxsat montecarlo {DESIGNED} --seed {found.settings.seeds.verification} "
        f"-n {found.settings.cases}`.",
    ]
    if found.assumed:
        lines += [f"{LINES['assumed']}:"]
        lines += [f"  {line}" for line in found.assumed]
    if found.misses_attitude is not None:
        lines.append(found.misses_attitude)
    elif found.settings.attitude == "nearest" and not found.verdict.holds:
        lines.append(
            "Body axes are turned so that the nearest attitude that can be held is the target."
        )
    if not found.gains:
        lines.append("The gains are functions of inertia, torque limit and control period.")
    return "".join(f"# {line}\n" for line in lines)


def write_files(found: ControllerDesign, folder: ResumableFolder) -> None:
    """The page, the designed scenario, the record as JSON, and figures."""
    folder.write(PAGE, markdown_page(design_document(design_record(found))))
    if found.scenario is not None:
        comment = design_comment(found, jaxsat.__version__)
        folder.write(DESIGNED, comment + dump(found.scenario))
    record = design_record(found) | provenance()
    folder.write(RECORD, json.dumps(record, indent=1, ensure_ascii=False) + "\n")
    if found.verification is not None:
        from jaxsat.report.saving import save_figures

        save_figures(lambda: _figures(found), folder.write)


def _figures(found: ControllerDesign) -> "dict[str, Figure]":
    from jaxsat.report.study_figures import study_figures
    from jaxsat.report.tuning_figures import gains_figure, loss_figure
    from jaxsat.synthesis.tuning.history import history_dataset

    assert found.verification is not None
    assert found.scenario is not None
    columns, title = found.verification.columns, found.scenario.title
    figures = study_figures(columns, _mapped(found), title)
    figures["laws"] = _laws_figure(found)
    if found.tuned is not None:
        plan, state = found.tuned.plan, found.tuned.state
        history = history_dataset(plan, state, title, dump(found.scenario))
        figures["loss"] = loss_figure(history, f"{title}: loss of tuning")
        figures["gains"] = gains_figure(history, f"{title}: gains in tuning")
    return figures


def _laws_figure(found: ControllerDesign) -> "Figure":
    from jaxsat.report.comparison_figures import settling_comparison

    steps: dict[str, Step | None] = {"screening": found.screening, "validation": found.validation}
    panels, horizons = {}, {}
    for name, step in steps.items():
        if step is None:
            continue
        key = (name, step.rows[0].setting.torque_limit)
        panels[key] = {row.setting.law: row.settling_times for row in step.rows}
        assert found.scenario is not None
        horizons[key] = found.scenario.simulation.duration_s
    return settling_comparison(
        panels, horizons, f"{found.original.title}: screening and validation"
    )


def _mapped(found: ControllerDesign) -> "dict[str, DrawnNumber]":
    """The two numbers on which settling depends most, or the cost where all cases settle."""
    from jaxsat.report.study_figures import DrawnNumber

    made = found.verification
    assert made is not None
    assert found.scenario is not None
    drawn = drawn_numbers(
        found.scenario, made.columns, found.verdict.judgement.laws == "two torques"
    )
    names = [one.name for one in made.separations] + [
        entry.name for entry in made.summary.ranking if entry.matters
    ]
    kept = {}
    for label in list(dict.fromkeys(names))[:2]:
        quantity = DISPERSIBLE.get(label.partition("[")[0])
        unit, meaning = (quantity.unit, quantity.meaning) if quantity else _DERIVED[label]
        kept[label] = DrawnNumber(drawn[label], unit, meaning)
    return kept


_DERIVED = {
    "size of omega": ("rad/s", "size of the initial angular velocity"),
    "coupling c": ("1", "difference of the reduced moments over the third"),
}
