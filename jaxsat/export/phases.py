"""A long program cut into functions, as the Python code that it comes from is cut."""

from collections.abc import Sequence
from dataclasses import dataclass

from jaxsat.engine.native.builder import Trace
from jaxsat.engine.native.ir import Step, definitions, memories

LONGEST, SHORTEST = 420, 30
"""Steps of a function: one of more is cut where it calls others, fewer go with their neighbours."""


@dataclass
class Phase:
    """Steps that follow one another: the Python function they are of."""

    name: str
    caller: str
    steps: list[Step]


def phases_of(steps: Sequence[Step], trace: Trace, root: str) -> list[Phase]:
    """The steps in the same order, in phases."""
    frames, before = [], ()
    for step in steps:
        made = definitions(step)
        before = trace.places.get(made[0].number, before) if made else before
        frames.append(before)
    return _without_short(_with_whole_memories(_cut(list(steps), frames, 0, root, root)))


def _without_short(phases: list[Phase]) -> list[Phase]:
    """Short phases as part of the one before, or at the begin of the one after."""
    found: list[Phase] = []
    for phase in phases:
        if found and len(phase.steps) < SHORTEST:
            found[-1].steps += phase.steps
        elif found and len(found[-1].steps) < SHORTEST:
            found[-1] = Phase(phase.name, phase.caller, found[-1].steps + phase.steps)
        else:
            found.append(phase)
    return found


def _with_whole_memories(phases: list[Phase]) -> list[Phase]:
    """The same with every array used in one phase alone: those from its first use to its last."""
    first: dict[int, int] = {}
    last: dict[int, int] = {}
    for number, phase in enumerate(phases):
        for step in phase.steps:
            for memory in memories(step):
                first.setdefault(memory.number, number)
                last[memory.number] = number
    found: list[Phase] = []
    end = -1
    for number, phase in enumerate(phases):
        if number <= end:
            found[-1].steps += phase.steps
        else:
            found.append(phase)
            end = number
        end = max([end, *(last[m] for m, begin in first.items() if begin == number)])
    return found


def _cut(steps: list[Step], frames: list[tuple], depth: int, name: str, caller: str) -> list[Phase]:
    if len(steps) <= LONGEST or all(len(one) <= depth for one in frames):
        return [Phase(name, caller, steps)]
    runs: list[tuple[object, str, list[Step], list[tuple]]] = []
    for step, one in zip(steps, frames, strict=True):
        inside = len(one) > depth + 1
        line = one[depth].line if len(one) > depth else 0
        key = (one[depth + 1].function, line) if inside else None
        word = one[depth + 1].function if inside else name
        if runs and runs[-1][0] == key:
            runs[-1][2].append(step)
            runs[-1][3].append(one)
        else:
            runs.append((key, word, [step], [one]))
    found: list[Phase] = []
    for _, word, inside, places in _merged(runs, name):
        if len(inside) == len(steps):
            found += _cut(inside, places, depth + 1, word, name)
        else:
            found += _cut(inside, places, depth + 1, word, name if word != name else caller)
    return found


def _merged(runs: list[tuple], name: str) -> list[tuple]:
    """Short runs put together with the next, as part of the function that calls them."""
    found: list[tuple] = []
    for run in runs:
        short = len(run[2]) < SHORTEST
        if short and found and found[-1][0] is None:
            _, word, steps, frames = found[-1]
            found[-1] = (None, word, steps + run[2], frames + run[3])
        elif short:
            found.append((None, name, run[2], run[3]))
        else:
            found.append(run)
    return found
