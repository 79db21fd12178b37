"""Scheduling: invariants before loops, cold branches merged, the critical path first.

Programs are in the order of their tracing, array by array, and a processor looks only some dozens
of steps ahead for independent work. So every block is list-scheduled: of the steps with all
operands the next one is that with the longest chain of dependents.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from heapq import heappop, heappush
from itertools import chain

from jaxsat.compiler import ir
from jaxsat.compiler.operations import INT

DEAR = ("div", "sqrt")
"""Operations that cost more than keeping their result through a loop."""


def move_invariants(block: ir.Block) -> None:
    """Hoist expensive operations out of the loops of a block, and of inner blocks.

    LLVM does not hoist them: their operands are rematerialised (`locations`), so they are loaded
    inside the loop, and often under a branch, where LLVM must not load earlier.
    """
    steps: list[ir.Step] = []
    for step in block.steps:
        for inside in ir.blocks_in(step):
            move_invariants(inside)
        if isinstance(step, ir.Loop):
            steps += _moved_out(step)
        steps.append(step)
    block.steps = steps


def _moved_out(loop: ir.Loop) -> list[ir.Step]:
    """Return the expensive invariant operations of a loop, and their invariant operands."""
    blocks = [*_blocks(loop.condition), *_blocks(loop.body)]
    changing = {out.number for block in blocks for s in block.steps for out in ir.definitions(s)}
    changing.update(param.number for param in loop.params)
    alike: dict[int, ir.Operation] = {}  # the invariant ones, in order
    for block in blocks:
        for step in block.steps:
            if isinstance(step, ir.Operation) and changing.isdisjoint(ir.numbers_of(step.args)):
                alike[step.out.number] = step
                changing.discard(step.out.number)
    hoisted: set[int] = set()
    for number, step in reversed(alike.items()):
        if number in hoisted or (step.name in DEAR and not step.out.uniform):
            hoisted |= {number} | (alike.keys() & ir.numbers_of(step.args))
    for block in blocks:
        block.steps = [s for s in block.steps if not _is_in(s, hoisted)]
    return [step for number, step in alike.items() if number in hoisted]


def _is_in(step: ir.Step, numbers: set[int]) -> bool:
    return isinstance(step, ir.Operation) and step.out.number in numbers


def _blocks(block: ir.Block) -> Iterator[ir.Block]:
    yield block
    for step in block.steps:
        for inside in ir.blocks_in(step):
            yield from _blocks(inside)


def merge_cold_branches(block: ir.Block) -> None:
    """Merge the cold switches of a block, and of inner blocks: one jump in place of many.

    At each jump the register allocator spills live values. Cold switches of a block that need no
    results of one another become one, as early as the last of them can be.
    """
    _merge(block, {})


def _merge(block: ir.Block, memo: ir.Memo) -> None:
    for step in block.steps:
        for inside in ir.blocks_in(step):
            _merge(inside, memo)
    if not any(isinstance(step, ir.BlockSwitch) and step.cold for step in block.steps):
        return
    depths: dict[int, int] = {}  # by value and memory: how many switches one after the other
    plain: dict[int, list[ir.Step]] = defaultdict(list)
    cold: dict[int, list[ir.BlockSwitch]] = defaultdict(list)
    for step in block.steps:
        touched = [memory.number for memory in ir.memories(step, memo)]
        depth = max((depths.get(n, 0) for n in chain(ir.uses(step, memo), touched)), default=0)
        is_cold = isinstance(step, ir.BlockSwitch) and step.cold
        (cold if is_cold else plain)[depth].append(step)  # pyright: ignore
        after = [out.number for out in ir.definitions(step)]
        depths.update(dict.fromkeys(chain(after, touched), depth + is_cold))
    block.steps = []
    for depth in range(max([*plain, *cold], default=-1) + 1):
        block.steps += plain[depth]
        block.steps += _together(cold[depth])


def _together(switches: Sequence[ir.BlockSwitch]) -> Sequence[ir.Step]:
    if len(switches) < 2:
        return switches
    index: ir.Scalar = switches[0].index
    steps: list[ir.Step] = []
    for switch in switches[1:]:
        either = ir.Value(INT, True)
        steps.append(ir.Operation("or", (index, switch.index), either))
        index = either
    blocks = [ir.Block(), ir.Block()]
    for number, block in enumerate(blocks):
        block.steps = list(chain(*(switch.blocks[number].steps for switch in switches)))
    yields = [list(chain(*(switch.yields[number] for switch in switches))) for number in (0, 1)]
    outs = list(chain(*(switch.outs for switch in switches)))
    return [*steps, ir.BlockSwitch(index, blocks, yields, outs, cold=True)]


_CYCLES = {"div": 13, "sqrt": 20, "add": 4, "sub": 4, "mul": 4, "round": 8}


def schedule(block: ir.Block, results: Iterable[ir.Scalar]) -> None:
    """Schedule the steps of a block and of inner ones; `results` are used after it."""
    _schedule(block, results, {})


def _schedule(block: ir.Block, results: Iterable[ir.Scalar], memo: ir.Memo) -> None:
    for step in block.steps:
        match step:
            case ir.Loop():
                _schedule(step.condition, [step.active], memo)
                _schedule(step.body, step.after, memo)
            case ir.BlockSwitch():
                for inside, yields in zip(step.blocks, step.yields, strict=True):
                    _schedule(inside, yields, memo)
            case _:
                pass
    outputs = set(ir.numbers_of(results))
    block.steps = _list_scheduled(_nodes(block.steps, outputs, memo))


class _Node:
    """Steps that stay together: the values they read, and the nodes before and after them."""

    __slots__ = ("after", "before", "cycles", "height", "reads", "start", "steps")

    def __init__(self, steps: list[ir.Step], reads: set[int]):
        self.steps, self.reads = steps, reads
        self.before: set[int] = set()
        self.after: list[int] = []
        last = steps[-1]
        self.cycles = _CYCLES.get(last.name, 1) if isinstance(last, ir.Operation) else 4
        self.height = 0.0  # cycles from its begin to the end of the block
        self.start = 0.0  # when its operands are there


def _list_scheduled(nodes: list[_Node]) -> list[ir.Step]:
    for number, node in enumerate(nodes):
        for earlier in node.before:
            nodes[earlier].after.append(number)
    for node in reversed(nodes):
        node.height = node.cycles + max((nodes[n].height for n in node.after), default=0.0)
    missing = [len(node.before) for node in nodes]
    waiting = [(0.0, number) for number, count in enumerate(missing) if not count]
    ready: list[tuple[float, int]] = []
    order: list[ir.Step] = []
    now = 0.0
    while waiting or ready:
        while waiting and waiting[0][0] <= now:
            number = heappop(waiting)[1]
            heappush(ready, (-nodes[number].height, number))
        node = nodes[heappop(ready or waiting)[1]]
        order += node.steps
        begin = max(now, node.start)
        now = begin + 1
        for number in node.after:
            later = nodes[number]
            later.start = max(later.start, begin + node.cycles)
            missing[number] -= 1
            if not missing[number]:
                heappush(waiting, (later.start, number))
    return order


def _nodes(steps: Sequence[ir.Step], outputs: set[int], memo: ir.Memo) -> list[_Node]:
    reads = [set(ir.uses(step, memo)) for step in steps]
    counts = Counter(chain(*reads, outputs, outputs))
    nodes: list[_Node] = []
    maker: dict[int, int] = {}
    touched: dict[int, int] = {}  # the last node by memory
    fused = fused_products(steps, counts)
    products = {id(product) for product in fused.values()}
    for step, needs in zip(steps, reads, strict=True):
        if id(step) in products:
            continue
        product = fused.get(step.out.number) if isinstance(step, ir.Operation) else None
        if product is None:
            node = _Node([step], needs)
        else:
            node = _Node([product, step], (needs - {product.out.number}) | set(ir.uses(product)))
        number = len(nodes)
        nodes.append(node)
        node.before = {maker[n] for n in node.reads if n in maker}
        for memory in ir.memories(step, memo):
            node.before.update({touched[memory.number]} if memory.number in touched else ())
            touched[memory.number] = number
        maker.update((out.number, number) for out in ir.definitions(step))
    return nodes


def fused_products(steps: Sequence[ir.Step], reads: Mapping[int, int]) -> dict[int, ir.Operation]:
    """Return products to be fused with a sum or difference, by the number of the latter.

    The sum alone reads the product, by these `reads` of values; of two products it is the first.
    """
    products: dict[int, ir.Operation] = {}
    fused: dict[int, ir.Operation] = {}
    for step in steps:
        match step:
            case ir.Operation(name="mul", out=out) if out.dtype.kind == "f":
                if reads.get(out.number) == 1:
                    products[out.number] = step
            case ir.Operation(name="add" | "sub", args=args, out=out):
                for arg in args:
                    product = products.get(arg.number) if isinstance(arg, ir.Value) else None
                    if product is not None and product.out.uniform == out.uniform:
                        fused[out.number] = product
                        break
    return fused
