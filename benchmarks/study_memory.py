"""How memory and the time of a summary grow with the number of cases of a study.

    PYTHONPATH=tests python benchmarks/study_memory.py 2000 200000

The studies are short tumbles without control, so that what is kept of the cases, not computing
them, costs memory. The peak of each run includes those of the runs before it.
"""

import resource
import sys
import tempfile
import time
from pathlib import Path

import jax

from jaxsat.store.tables import open_study
from jaxsat.studies.executors import Threads
from jaxsat.studies.run import run_study
from jaxsat.studies.summary import summarise


def peak() -> float:
    """Largest memory of this process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    """Run studies of these sizes one after the other."""
    jax.config.update("jax_enable_x64", True)
    from montecarlo.studies import tumbling

    print("cases    run s  cases/s   peak MB after run, after summary   summary s")
    for count in map(int, sys.argv[1:]):
        with tempfile.TemporaryDirectory() as folder:
            study = tumbling(count, chunk=2000, batch_size=250, duration=2.0)
            begin = time.perf_counter()
            run_study(study, Path(folder) / "s", executor=Threads(2))
            ran, ran_peak = time.perf_counter() - begin, peak()
            begin = time.perf_counter()
            summarise(open_study(Path(folder) / "s"))
            told = time.perf_counter() - begin
        pace = count / ran
        print(f"{count:7} {ran:6.1f} {pace:8.0f} {ran_peak:9.0f} {peak():8.0f} {told:10.2f}")


if __name__ == "__main__":
    main()
