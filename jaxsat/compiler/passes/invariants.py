"""Loop-invariant code motion of divisions and square roots.

LLVM does not hoist them: their operands are rematerialised (`locations`), so they are loaded inside
the loop, and often under a branch, where LLVM must not load earlier.
"""

from collections.abc import Iterator

from jaxsat.compiler.ir import Block, Loop, Operation, Step, Switch, Value, definitions

DEAR = ("div", "sqrt")
"""Operations that cost more than keeping their result through a loop."""


def move_invariants(block: Block) -> None:
    """Hoist dear operations out of the loops of a block, and of the blocks inside."""
    steps: list[Step] = []
    for step in block.steps:
        match step:
            case Loop(condition=condition, body=body):
                move_invariants(condition)
                move_invariants(body)
                steps += _moved_out(step)
            case Switch(blocks=blocks):
                for inside in blocks:
                    move_invariants(inside)
            case _:
                pass
        steps.append(step)
    block.steps = steps


def _moved_out(loop: Loop) -> list[Step]:
    """The dear invariant operations of a loop, and the invariant ones that they need."""
    blocks = [*_blocks(loop.condition), *_blocks(loop.body)]
    inside = {out.number for block in blocks for s in block.steps for out in definitions(s)}
    inside.update(param.number for param in loop.params)
    alike: dict[int, Operation] = {}  # the invariant ones, in order
    for block in blocks:
        for step in block.steps:
            if isinstance(step, Operation) and _needs(step) & inside <= alike.keys():
                alike[step.out.number] = step
    wanted: set[int] = set()
    for number, step in reversed(alike.items()):
        if number in wanted or (step.name in DEAR and not step.out.uniform):
            wanted |= {number} | (_needs(step) & alike.keys())
    for block in blocks:
        block.steps = [s for s in block.steps if not _is_in(s, wanted)]
    return [step for number, step in alike.items() if number in wanted]


def _is_in(step: Step, wanted: set[int]) -> bool:
    return isinstance(step, Operation) and step.out.number in wanted


def _blocks(block: Block) -> Iterator[Block]:
    """A block and those inside, each after what it may read."""
    yield block
    for step in block.steps:
        match step:
            case Loop(condition=condition, body=body):
                yield from _blocks(condition)
                yield from _blocks(body)
            case Switch(blocks=blocks):
                for inside in blocks:
                    yield from _blocks(inside)
            case _:
                pass


def _needs(step: Operation) -> set[int]:
    return {x.number for x in step.args if isinstance(x, Value)}
