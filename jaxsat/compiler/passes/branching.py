"""Branches for selections of which one side is expensive, so that the other is never computed.

`jnp.where` computes both sides. Where one is expensive and nothing else needs it, the selections of
one predicate become a switch.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from jaxsat.compiler import ir
from jaxsat.compiler.operations import INT

DEAR = 100.0
"""Least number of operations that a branch must save."""

_COSTS = {"div": 5.0, "rem": 20.0, "sqrt": 15.0}
ELEMENTARY = 40.0
"""Approximate operations of an elementary function."""


CHEAP = 24
"""Largest total number of operations of branches that are computed in every lane."""


def are_cheap(blocks: Sequence[ir.Block]) -> bool:
    """Whether branches are cheaper to compute than to jump over."""
    plain = all(isinstance(step, ir.Operation) for block in blocks for step in block.steps)
    return plain and sum(len(block.steps) for block in blocks) <= CHEAP


@dataclass
class _Choice:
    """Selections of one predicate that can be joined, and the steps that each side alone needs."""

    selections: dict[int, ir.Operation]
    sides: tuple[set[int], set[int]]
    cost: float


def with_branches(function: ir.Function) -> None:
    """Put branches into a function, and into the Python functions that it calls."""
    _with_branches(function, set())


def _with_branches(function: ir.Function, visited: set[int]) -> None:
    visited.add(id(function))
    _branched(function.block, function.results)
    for call in function.block.calls():
        source = call.function.source
        if source is not None and not source.loop and id(call.function) not in visited:
            _with_branches(call.function, visited)


def _branched(block: ir.Block, results: Sequence[ir.Scalar]) -> None:
    if any(not memory.elements for step in block.steps for memory in ir.memories(step)):
        return  # what is stored is not moved
    while True:
        choice = max(_choices(block, results), key=lambda one: one.cost, default=None)
        if choice is None or choice.cost < DEAR:
            break
        _put_in(block, choice)
    for step in block.steps:
        if isinstance(step, ir.BlockSwitch):
            for inside, yields in zip(step.blocks, step.yields, strict=True):
                _branched(inside, yields)
        elif isinstance(step, ir.Loop):
            _branched(step.body, step.after)


def _choices(block: ir.Block, results: Sequence[ir.Scalar]) -> Iterable[_Choice]:
    readers: dict[int, set[int]] = {}  # of values, by the numbers of steps; results are read last
    for number, step in enumerate(block.steps):
        for value in ir.uses(step):
            readers.setdefault(value, set()).add(number)
    for value in ir.numbers_of(results):
        readers.setdefault(value, set()).add(len(block.steps))
    predicates: dict[int, dict[int, ir.Operation]] = {}
    for number, step in enumerate(block.steps):
        match step:
            case ir.Operation(name="select", args=(ir.Value(number=predicate), _, _)):
                predicates.setdefault(predicate, {})[number] = step
            case _:
                pass
    for selections in predicates.values():
        for group in _independent(block, selections):
            yield _choice(block, group, readers)


def _independent(
    block: ir.Block, selections: dict[int, ir.Operation]
) -> list[dict[int, ir.Operation]]:
    """Group selections so that none needs another one of its group."""
    depths: dict[int, int] = {}
    groups: list[dict[int, ir.Operation]] = []
    for number, step in enumerate(block.steps):
        depth = max((depths.get(value, 0) for value in ir.uses(step)), default=0)
        if number in selections:
            groups += [{} for _ in range(depth + 1 - len(groups))]
            groups[depth][number] = selections[number]
            depth += 1
        depths.update((out.number, depth) for out in ir.definitions(step))
    return groups


def _choice(
    block: ir.Block, group: dict[int, ir.Operation], readers: dict[int, set[int]]
) -> _Choice:
    """Return the choice with the steps that only one side of these selections needs."""
    sides: list[set[int]] = []
    for side in (1, 2):
        alone: set[int] = set()
        for number in reversed(range(max(group))):
            step = block.steps[number]
            outs = [out.number for out in ir.definitions(step) if readers.get(out.number)]
            if number in group or not outs:
                continue
            if all(
                reader in alone or (reader in group and _reads_on(group[reader], out, side))
                for out in outs
                for reader in readers[out]
            ):
                alone.add(number)
        sides.append(alone)
    side_values = {
        out.number for i in sides[0] | sides[1] for out in ir.definitions(block.steps[i])
    }
    selections = {
        number: one for number, one in group.items() if side_values & set(ir.numbers_of(one.args))
    }
    cost = _total(block.steps[number] for number in sides[0] | sides[1])
    return _Choice(selections, (sides[0], sides[1]), cost)


def _reads_on(selection: ir.Operation, value: int, side: int) -> bool:
    """Whether a selection needs a value on this side alone."""
    return [x.number for x in selection.args if isinstance(x, ir.Value)].count(value) == 1 and (
        getattr(selection.args[side], "number", None) == value
    )


def _put_in(block: ir.Block, choice: _Choice) -> None:
    first = next(iter(choice.selections.values()))
    index = ir.Value(INT, True)
    yes, no = ir.Block(block), ir.Block(block)
    for inside, side in ((yes, choice.sides[0]), (no, choice.sides[1])):
        inside.steps = [block.steps[number] for number in sorted(side)]
    yields = [[one.args[side] for one in choice.selections.values()] for side in (2, 1)]
    outs = [one.out for one in choice.selections.values()]
    gone = choice.sides[0] | choice.sides[1] | choice.selections.keys()
    last = max(choice.selections)
    steps: list[ir.Step] = []
    for number, step in enumerate(block.steps):
        if number not in gone:
            steps.append(step)
        if number == last:
            steps.append(ir.Operation("convert", (first.args[0],), index))
            steps.append(ir.BlockSwitch(index, [no, yes], yields, outs))
    block.steps = _in_order(steps)


def _in_order(steps: Sequence[ir.Step]) -> list[ir.Step]:
    """Sort steps behind what they need, else in their order."""
    makers = {out.number: i for i, step in enumerate(steps) for out in ir.definitions(step)}
    order: list[ir.Step] = []
    visited: set[int] = set()
    for number in range(len(steps)):
        waiting = [number]
        while waiting:
            here = waiting[-1]
            needs = {makers[value] for value in ir.uses(steps[here]) if value in makers} - visited
            if here in visited or not needs:
                waiting.pop()
                if here not in visited:
                    visited.add(here)
                    order.append(steps[here])
            else:
                waiting += sorted(needs, reverse=True)
    return order


def _cost(step: ir.Step) -> float:
    match step:
        case ir.Operation(name=name):
            return _COSTS.get(name, 1.0)
        case ir.Call(function=function):
            if function.source is None:
                return ELEMENTARY
            if function.source.loop:
                return float(len(function.params))
            return _total(function.block.steps)
        case ir.BlockSwitch(blocks=blocks):
            return max(_total(block.steps) for block in blocks)
        case ir.Loop(condition=condition, body=body):
            return 10 * _total([*condition.steps, *body.steps])
        case _:
            return 1.0


def _total(steps: Iterable[ir.Step]) -> float:
    return sum(map(_cost, steps), 0.0)
