"""List scheduling: independent steps of a block stand together, the critical path first.

Programs come in the order in which they were traced, array by array, and a processor looks only
some dozens of steps ahead for work that need not wait. So every block is put in order again, from
its beginning: of the steps whose operands are there the one goes next on which the longest chain
of others depends.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from heapq import heappop, heappush

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

_CYCLES = {"div": 13, "sqrt": 20, "add": 4, "sub": 4, "mul": 4, "round": 8}


def schedule(block: Block, results: Iterable[Scalar]) -> None:
    """Put the steps of a block in order, and of those inside; `results` are used after it."""
    for step in block.steps:
        match step:
            case Loop():
                schedule(step.condition, [step.active])
                schedule(step.body, step.after)
            case Switch():
                for inside, yields in zip(step.blocks, step.yields, strict=True):
                    schedule(inside, yields)
            case _:
                pass
    kept = {x.number for x in results if isinstance(x, Value)}
    block.steps = _list_scheduled(_nodes(block.steps, kept))


class _Node:
    """Steps that stay together: the values they read, and the nodes before and after them."""

    __slots__ = ("after", "before", "cycles", "height", "reads", "start", "steps")

    def __init__(self, steps: list[Step], reads: set[int]):
        self.steps, self.reads = steps, reads
        self.before: set[int] = set()
        self.after: list[int] = []
        last = steps[-1]
        self.cycles = _CYCLES.get(last.name, 1) if isinstance(last, Operation) else 4
        self.height = 0.0  # cycles from its begin to the end of the block
        self.start = 0.0  # when its operands are there


def _list_scheduled(nodes: list[_Node]) -> list[Step]:
    for number, node in enumerate(nodes):
        for earlier in node.before:
            nodes[earlier].after.append(number)
    for node in reversed(nodes):
        node.height = node.cycles + max((nodes[n].height for n in node.after), default=0.0)
    missing = [len(node.before) for node in nodes]
    waiting = [(0.0, number) for number, count in enumerate(missing) if not count]
    ready: list[tuple[float, int]] = []
    found: list[Step] = []
    now = 0.0
    while waiting or ready:
        while waiting and waiting[0][0] <= now:
            number = heappop(waiting)[1]
            heappush(ready, (-nodes[number].height, number))
        node = nodes[heappop(ready or waiting)[1]]
        found += node.steps
        begin = max(now, node.start)
        now = begin + 1
        for number in node.after:
            later = nodes[number]
            later.start = max(later.start, begin + node.cycles)
            missing[number] -= 1
            if not missing[number]:
                heappush(waiting, (later.start, number))
    return found


def _nodes(steps: Sequence[Step], kept: set[int]) -> list[_Node]:
    reads = [set(uses(step)) for step in steps]
    nodes: list[_Node] = []
    maker: dict[int, int] = {}
    touched: dict[int, int] = {}  # the last node by memory
    fused = _fused(steps, reads, kept)
    products = {id(product) for product in fused.values()}
    for i, (step, needs) in enumerate(zip(steps, reads, strict=True)):
        if id(step) in products:
            continue
        product = fused.get(i)
        if product is None:
            node = _Node([step], needs)
        else:
            node = _Node([product, step], (needs - {product.out.number}) | set(uses(product)))
        number = len(nodes)
        nodes.append(node)
        node.before = {maker[n] for n in node.reads if n in maker}
        for memory in {memory.number for memory in memories(step)}:
            node.before.update({touched[memory]} if memory in touched else ())
            touched[memory] = number
        maker.update((out.number, number) for out in definitions(step))
    return nodes


def _fused(
    steps: Sequence[Step], reads: Sequence[set[int]], kept: set[int]
) -> dict[int, Operation]:
    """Products that are used once, by the place of the sum with which they become one operation."""
    uses: dict[int, int] = defaultdict(int)
    for numbers in reads:
        for number in numbers:
            uses[number] += 1
    products: dict[int, Operation] = {}
    found: dict[int, Operation] = {}
    for i, step in enumerate(steps):
        match step:
            case Operation(name="mul", out=out) if out.dtype.kind == "f" and not out.uniform:
                if uses[out.number] == 1 and out.number not in kept:
                    products[out.number] = step
            case Operation(name="add" | "sub", args=args):
                for arg in args:
                    if isinstance(arg, Value) and arg.number in products:
                        found[i] = products.pop(arg.number)
                        break
    return found
