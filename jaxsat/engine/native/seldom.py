"""Switches to what is seldom needed, put together: one jump over all of it in place of many.

Between jumps a compiler shares out the registers anew and stores all that is alive. The switches of
a block that need no results of one another become one, as early as the last of them can be.
"""

from collections import defaultdict
from collections.abc import Sequence
from itertools import chain

import numpy as np

from jaxsat.engine.native.ir import (
    Block,
    Loop,
    Operation,
    Scalar,
    Step,
    Switch,
    Value,
    made,
    memories,
    read,
)

INT = np.dtype(np.int32)


def gather(block: Block) -> None:
    """Put seldom switches of a block together, and of the blocks inside."""
    depths: dict[int, int] = {}  # by value and memory: how many switches one after the other
    plain: dict[int, list[Step]] = defaultdict(list)
    seldom: dict[int, list[Switch]] = defaultdict(list)
    for step in block.steps:
        _gather_inside(step)
        touched = [memory.number for memory in memories(step)]
        depth = max((depths.get(n, 0) for n in chain(read(step), touched)), default=0)
        is_seldom = isinstance(step, Switch) and step.seldom
        (seldom if is_seldom else plain)[depth].append(step)  # pyright: ignore
        after = [out.number for out in made(step)]
        depths.update(dict.fromkeys(chain(after, touched), depth + is_seldom))
    block.steps = []
    for depth in range(max([*plain, *seldom], default=-1) + 1):
        block.steps += plain[depth]
        block.steps += _together(seldom[depth])


def _gather_inside(step: Step) -> None:
    match step:
        case Loop(condition=condition, body=body):
            gather(condition)
            gather(body)
        case Switch(blocks=blocks):
            for inside in blocks:
                gather(inside)
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
    return [*steps, Switch(index, blocks, yields, outs, seldom=True)]
