"""The order of a block's steps in which few values wait for their use at the same time.

What does not fit into the processor's registers is written to memory and read again, and storing a
whole vector takes as long as several operations. Programs come in the order in which they were
traced, array by array; here every block is put in order again, from its end: of the steps whose
results are all spoken for, the one goes last that leaves the fewest values waiting.
"""

from collections.abc import Iterable, Iterator

from jaxsat.engine.native.ir import Block, Call, Load, Loop, Operation, Scalar, Step, Store, Switch
from jaxsat.engine.native.ir import Value

FUSED = ("add", "sub")
"""What a product that is used once becomes one operation with."""


def in_order(block: Block, results: Iterable[Scalar]) -> None:
    """Put the steps of a block in order, and of the blocks inside; `results` are used after it."""
    for step in block.steps:
        match step:
            case Loop():
                in_order(step.condition, [step.active])
                in_order(step.body, step.after)
            case Switch():
                for inside, yields in zip(step.blocks, step.yields, strict=True):
                    in_order(inside, yields)
    block.steps = _ordered(block.steps, [x for x in results if isinstance(x, Value)])


def _weight(value: Value) -> float:
    """What a waiting value takes of the vector registers."""
    if value.uniform:
        return 0.0
    return 0.1 if value.dtype.kind == "b" else 1.0


class _Node:
    """Steps that stay together: what they read and make, and how many others wait for that."""

    __slots__ = ("before", "makes", "number", "reads", "steps", "users")

    def __init__(self, number: int):
        self.number = number
        self.steps: list[Step] = []
        self.reads: dict[int, float] = {}
        self.makes: list[tuple[int, float]] = []
        self.before: set[int] = set()
        self.users = 0


LATENCY = {"div": 13, "sqrt": 20}
import os
LIMIT = float(os.environ.get("LIMIT", "20"))
PER = float(os.environ.get("PER", "1"))


def _latency(step: Step) -> float:
    match step:
        case Operation(name=name, out=out):
            if name in LATENCY:
                return LATENCY[name]
            return 4.0 if out.dtype.kind == "f" and name in ("add", "sub", "mul") else 1.0 if name not in ("round",) else 8.0
    return 4.0


def _ordered(steps: list[Step], results: list[Value]) -> list[Step]:
    nodes = _nodes(steps, {x.number for x in results})
    after: list[list[int]] = [[] for _ in nodes]
    missing = [len(node.before) for node in nodes]
    for node in nodes:
        for number in node.before:
            after[number].append(node.number)
    height = [0.0] * len(nodes)
    late = [sum(_latency(s) for s in node.steps[-1:]) for node in nodes]
    for node in reversed(nodes):
        height[node.number] = late[node.number] + max((height[n] for n in after[node.number]), default=0.0)
    kept = {x.number for x in results}
    users: dict[int, int] = {}
    weight: dict[int, float] = {}
    for node in nodes:
        for n in node.reads:
            users[n] = users.get(n, 0) + 1
        for n, w in node.makes:
            weight[n] = w
    ready = {n for n, m in enumerate(missing) if not m}
    start = [0.0] * len(nodes)
    now = pressure = 0.0
    placed: list[_Node] = []

    def delta(node):
        made = sum(w for n, w in node.makes if users.get(n) or n in kept)
        return made - sum(weight.get(n, 0.0) for n in node.reads if users[n] == 1 and n not in kept)

    while ready:
        if pressure < LIMIT:
            best = min(ready, key=lambda n: (max(start[n] - now, 0.0), -height[n], n))
        else:
            best = min(ready, key=lambda n: (delta(nodes[n]), max(start[n] - now, 0.0), -height[n], n))
        node = nodes[best]
        pressure += delta(node)
        ready.discard(best)
        placed.append(node)
        for n in node.reads:
            users[n] -= 1
        now = max(now, start[best]) + PER
        for n in after[best]:
            start[n] = max(start[n], now - PER + late[best])
            missing[n] -= 1
            if not missing[n]:
                ready.add(n)
    assert len(placed) == len(nodes)
    return [step for node in placed for step in node.steps]


def _nodes(steps: list[Step], results: set[int]) -> list[_Node]:
    uses: dict[int, int] = {}
    read = [dict(_read(step)) for step in steps]
    for values in read:
        for number in values:
            uses[number] = uses.get(number, 0) + 1
    products = {
        step.out.number: step
        for step in steps
        if isinstance(step, Operation)
        and step.name == "mul"
        and uses.get(step.out.number) == 1
        and step.out.number not in results
        and not step.out.uniform and step.out.dtype.kind=="f"
    }
    taken: dict[int, Operation] = {}  # product by the sum it goes with
    for i, step in enumerate(steps):
        if isinstance(step, Operation) and step.name in FUSED:
            for arg in step.args:
                if isinstance(arg, Value) and arg.number in products:
                    taken[i] = products.pop(arg.number)
                    break
    gone = {id(step) for step in taken.values()}
    nodes: list[_Node] = []
    maker: dict[int, _Node] = {}
    memory: dict[int, list[_Node]] = {}
    for i, step in enumerate(steps):
        if id(step) in gone:
            continue
        node = _Node(len(nodes))
        nodes.append(node)
        inner = set()
        if i in taken:
            node.steps.append(taken[i])
            inner.add(taken[i].out.number)
            for n, w in _read(taken[i]):
                node.reads[n] = w
        node.steps.append(step)
        node.reads |= {n: w for n, w in read[i].items() if n not in inner}
        for out in _made(step):
            node.makes.append((out.number, _weight(out)))
            maker[out.number] = node
        for n in node.reads:
            if n in maker:
                node.before.add(maker[n].number)
        for number, writes in _touched(step):
            for other in memory.get(number, []):
                node.before.add(other.number)
            memory.setdefault(number, []).append(node)
    for node in nodes:
        node.before.discard(node.number)
        for number in node.before:
            nodes[number].users += 1
    return nodes


def _made(step: Step) -> Iterator[Value]:
    match step:
        case Operation(out=out) | Load(out=out):
            yield out
        case Switch(outs=outs) | Call(outs=outs) | Loop(params=outs):
            yield from outs


def _scalars(scalars) -> Iterator[tuple[int, float]]:
    for x in scalars:
        if isinstance(x, Value):
            yield x.number, _weight(x)


def _read(step: Step) -> Iterator[tuple[int, float]]:
    match step:
        case Operation(args=args) | Call(args=args):
            yield from _scalars(args)
        case Load(index=index):
            yield from _scalars([index])
        case Store(index=index, value=value):
            yield from _scalars([index, value])
        case Switch():
            yield from _scalars([step.index])
            for block, results in zip(step.blocks, step.yields, strict=True):
                yield from _inside(block, results)
        case Loop():
            yield from _scalars(step.before)
            inner = {p.number for p in step.params}
            for block, results in ((step.condition, [step.active]), (step.body, step.after)):
                yield from ((n, w) for n, w in _inside(block, results) if n not in inner)


def _inside(block: Block, results) -> Iterator[tuple[int, float]]:
    made: set[int] = set()
    for step in block.steps:
        yield from ((n, w) for n, w in _read(step) if n not in made)
        made.update(out.number for out in _made(step))
    yield from ((n, w) for n, w in _scalars(results) if n not in made)


def _touched(step: Step) -> Iterator[tuple[int, bool]]:
    match step:
        case Load(memory=memory):
            yield memory.number, False
        case Store(memory=memory):
            yield memory.number, True
        case Call(function=function):
            yield from _touched_in(function.block)
        case Switch(blocks=blocks):
            for block in blocks:
                yield from _touched_in(block)
        case Loop(condition=condition, body=body):
            yield from _touched_in(condition)
            yield from _touched_in(body)


def _touched_in(block: Block) -> Iterator[tuple[int, bool]]:
    for step in block.steps:
        yield from _touched(step)
