"""`jaxsat export`: the controller of a scenario as C99 for a flight computer."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from jaxsat.cli.computing import interruptibly
from jaxsat.cli.loading import load_scenario
from jaxsat.cli.options import Output, Overrides
from jaxsat.cli.progress import show_progress
from jaxsat.cli.terminal import SUCCESS, UserMistake, print_stdout, print_warning

if TYPE_CHECKING:
    from jaxsat.flight.files import Export
    from jaxsat.scenario import Scenario

Float = Annotated[bool, Parameter(name="--float", negative="")]


def export(
    scenario: str,
    /,
    *,
    overrides: Overrides = (),
    float_: Float = False,
    functions: Literal["own", "libm"] = "own",
    output: Output = Output(),
) -> int:
    """Write the controller of a scenario as C99, with test vectors, a test program and build files.

    The law must be a sampled law. The export includes its estimator, the allocation and the
    modulation, also from plug-ins.

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
    output.overwrite
        Replace the folder if jaxsat wrote it, including the builds of `make` and CMake in it.
    """
    chosen = load_scenario(scenario, overrides)
    target = output.out or Path(f"jaxsat-{Path(scenario).stem}-flight")

    from jaxsat.compiler.lowering import CannotLower
    from jaxsat.flight.flight import CannotExport
    from jaxsat.flight.templates import is_built
    from jaxsat.store.folder import OutputFolder

    try:
        place = OutputFolder(
            target, kind="flight code", overwrite=output.overwrite, is_made_of_it=is_built
        )
        with place as folder:
            show_progress(f"exporting {scenario}")
            code = interruptibly(lambda: _export(chosen, single=float_, libm=functions == "libm"))
            for name, content in code.files.items():
                folder.write(name, content)
    except CannotExport as error:
        raise UserMistake(f"{scenario}: {error}") from None
    except CannotLower as error:
        raise UserMistake(f"{scenario}: cannot be flight code: {error}") from None
    for caution in code.cautions:
        print_warning(caution)
    if not output.quiet:
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
    return SUCCESS


def _export(scenario: "Scenario", *, single: bool, libm: bool) -> "Export":
    from jaxsat.flight.files import Request, export
    from jaxsat.scenario import dump
    from jaxsat.scenario.build.run import build
    from jaxsat.scenario.derived import hold_samples_of
    from jaxsat.store.provenance import provenance

    run = build(scenario)
    request = Request(
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
    )
    return export(request)
