"""`jaxsat export`: the controller of a scenario as C99 for a flight computer."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from jaxsat.cli.computing import interruptibly
from jaxsat.cli.loading import load_scenario
from jaxsat.cli.options import Output, Overrides, number
from jaxsat.cli.progress import show_progress
from jaxsat.cli.terminal import SUCCESS, UserMistake, print_stdout, print_warning

if TYPE_CHECKING:
    from jaxsat.flight.files import Export
    from jaxsat.flight.request import Request
    from jaxsat.scenario import Scenario

Begin = Annotated[float | None, Parameter(converter=number(0.0, 1e9))]
Float = Annotated[bool, Parameter(name="--float", negative="")]
Fmu = Annotated[bool, Parameter(name="--fmu", negative="")]


def export(
    scenario: str,
    /,
    *,
    overrides: Overrides = (),
    float_: Float = False,
    functions: Literal["own", "libm"] = "own",
    fmu: Fmu = False,
    plan_begin: Begin = None,
    output: Output = Output(),
) -> int:
    """Write the controller of a scenario as C99, with test vectors, a test program and build files.

    The law must be a sampled law. The export includes its estimator, the allocation and the
    modulation, also from plug-ins. With the law `planned` it is the tracker of a plan, which is
    made of the scenario's start.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file.
    output.out
        Output folder; by default jaxsat-NAME-flight in the current folder.
    float_
        Single precision instead of double.
    functions
        own: elementary functions in the file, with the same bits on every processor; libm: those of
        the C library, less code.
    fmu
        Write controller.fmu, too: a functional mock-up unit for co-simulation (FMI 3.0), with its
        library for this machine if there is a C compiler.
    plan_begin
        Write only a plan, from the scenario's start at this time (s) after controller_init, for
        the law planned.
    output.overwrite
        Replace the folder if jaxsat wrote it, including the builds of `make` and CMake in it.
    """
    chosen = load_scenario(scenario, overrides)
    kind = "flight" if plan_begin is None else "plan"
    target = output.out or Path(f"jaxsat-{Path(scenario).stem}-{kind}")

    from jaxsat.compiler.lowering import CannotLower
    from jaxsat.flight.files import export as export_all
    from jaxsat.flight.files import export_plan
    from jaxsat.flight.flight import CannotExport
    from jaxsat.flight.templates import is_built
    from jaxsat.store.folder import OutputFolder

    code: Export | None = None
    try:
        place = OutputFolder(
            target, kind="flight code", overwrite=output.overwrite, is_made_of_it=is_built
        )
        with place as folder:
            show_progress(f"exporting {scenario}")
            request = interruptibly(
                lambda: _request(chosen, float_, functions == "libm", fmu), brief=True
            )
            if plan_begin is None:
                code = interruptibly(lambda: export_all(request), brief=True)
                files = code.files
            else:
                files = interruptibly(lambda: export_plan(request, plan_begin), brief=True)
            for name, content in files.items():
                folder.write(name, content)
    except CannotExport as error:
        raise UserMistake(f"{scenario}: {error}") from None
    except CannotLower as error:
        raise UserMistake(f"{scenario}: cannot be flight code: {error}") from None
    if code is not None:
        _tell(code, target, quiet=output.quiet)
    elif not output.quiet:
        print_stdout(f"written          {target}")
    return SUCCESS


def _tell(code: "Export", target: Path, *, quiet: bool) -> None:
    """Print cautions, sizes and the most instructions."""
    for caution in code.cautions:
        print_warning(caution)
    if quiet:
        return
    print_stdout(f"controller       {code.lines} lines of C, program {code.program.hash[:12]}")
    print_stdout(f"test vectors     {len(code.vectors.given)} samples")
    for processor, use in code.measured.items():
        if use.instructions is not None:
            emulated, count = use.samples, len(code.vectors.given)
            print_stdout(
                f"a step           {use.instructions} instructions at most ({processor}, "
                f"{emulated} of {count} samples emulated)"
            )
    print_stdout(f"written          {target}; `make -C {target} test` builds and checks it")


def _request(scenario: "Scenario", single: bool, libm: bool, unit: bool) -> "Request":
    from jaxsat.flight.request import Request
    from jaxsat.scenario import dump
    from jaxsat.scenario.build.run import build
    from jaxsat.scenario.derived import hold_samples_of
    from jaxsat.store.provenance import provenance

    run = build(scenario)
    return Request(
        run.loop,
        run.start,
        float(run.times[-1]),
        scenario.title,
        dump(scenario),
        provenance(),
        single,
        libm,
        scenario.law.declaration.keys,
        hold_samples_of(scenario),
        unit,
    )
