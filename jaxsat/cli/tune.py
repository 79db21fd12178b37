"""`jaxsat tune`: better gains, with gradients through the simulator or without, verified."""

from pathlib import Path

from jaxsat.cli.computing import interruptibly
from jaxsat.cli.listening import listener, resumed_later
from jaxsat.cli.loading import load_scenario
from jaxsat.cli.options import BatchSize, Flag, Overrides, Resumable
from jaxsat.cli.report import planned_report, present
from jaxsat.cli.terminal import SUCCESS, UserMistake


def tune(
    scenario: str,
    /,
    *,
    overrides: Overrides = (),
    batch_size: BatchSize = 32,
    baselines: Flag = False,
    results: Resumable = Resumable(),
) -> int:
    """Tune gains of a scenario's control law over its dispersions, as its [tuning] table says.

    Writes tuned.toml, ready to run, a summary that begins with the check of the gradients, the
    verdict on cases not used for tuning, the history and figures. The same command resumes an
    interrupted run, with the same result.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file, with [dispersion] and [tuning] tables.
    batch_size
        Cases per pass of the compiled loop.
    baselines
        Then run Nelder-Mead, random search, CMA-ES and BFGS with the same number of trajectories,
        or the number in [tuning].
    results.out
        Output folder; by default jaxsat-NAME-tuned in the current folder.
    results.engine
        native: machine code compiled for the program; scan: a plain loop in XLA; diffrax: the
        method of a single run; auto: native if possible, else scan.
    results.workers
        Threads that share a batch; by default the number of processors.
    """
    chosen = load_scenario(scenario, overrides, "tuning")
    target = results.out or Path(f"jaxsat-{Path(scenario).stem}-tuned")
    report = planned_report(results, target)

    import jaxsat
    from jaxsat.synthesis.tuning.run import TUNED

    try:
        with resumed_later(target / TUNED, "the best gains so far are in {}"):
            outcome = interruptibly(
                lambda: jaxsat.tune(
                    chosen,
                    engine=results.engine,
                    batch_size=batch_size,
                    workers=results.workers,
                    baselines=baselines,
                    out=target,
                    elsewhere=results.elsewhere,
                    listener=listener(target, results),
                )
            )
    except ValueError as error:
        raise UserMistake(str(error)) from None
    already = "" if outcome.kept is None else "already "
    present(outcome.document, target, results, report, already)
    return SUCCESS
