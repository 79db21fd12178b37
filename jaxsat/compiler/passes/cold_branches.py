"""Cold branches of a block, merged: one jump over all of them in place of many.

At each jump the register allocator spills what is live. The cold switches of a block that need no
results of one another become one, as early as the last of them can be.
"""

from collections import defaultdict
from collections.abc import Sequence
from itertools import chain

import numpy as np

from jaxsat.compiler.ir import (
    Block,
    Loop,
    Operation,
    Scalar,
    Step,
    Switch,
    Value,
    definitions,
    memories,
    uses,
)

INT = np.dtype(np.int32)


def merge_cold_branches(block: Block) -> None:
    """Merge the cold switches of a block, and of the blocks inside."""
    depths: dict[int, int] = {}  # by value and memory: how many switches one after the other
    plain: dict[int, list[Step]] = defaultdict(list)
    cold: dict[int, list[Switch]] = defaultdict(list)
    for step in block.steps:
        _merge_inside(step)
        touched = [memory.number for memory in memories(step)]
        depth = max((depths.get(n, 0) for n in chain(uses(step), touched)), default=0)
        is_cold = isinstance(step, Switch) and step.cold
        (cold if is_cold else plain)[depth].append(step)  # pyright: ignore
        after = [out.number for out in definitions(step)]
        depths.update(dict.fromkeys(chain(after, touched), depth + is_cold))
    block.steps = []
    for depth in range(max([*plain, *cold], default=-1) + 1):
        block.steps += plain[depth]
        block.steps += _together(cold[depth])


def _merge_inside(step: Step) -> None:
    match step:
        case Loop(condition=condition, body=body):
            merge_cold_branches(condition)
            merge_cold_branches(body)
        case Switch(blocks=blocks):
            for inside in blocks:
                merge_cold_branches(inside)
        case _:
            pass


def _together(switches: Sequence[Switch]) -> Sequence[Step]:
    if len(switches) < 2:
        return switches
    index: Scalar = switches[0].index
    steps: list[Step] = []
    for switch in switches[1:]:
        either = Value(INT, True)
        steps.append(Operation("or", (index, switch.index), either))
        index = either
    blocks = [Block(), Block()]
    for number, block in enumerate(blocks):
        block.steps = list(chain(*(switch.blocks[number].steps for switch in switches)))
    yields = [list(chain(*(switch.yields[number] for switch in switches))) for number in (0, 1)]
    outs = list(chain(*(switch.outs for switch in switches)))
    return [*steps, Switch(index, blocks, yields, outs, cold=True)]
