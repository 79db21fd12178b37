# SPDX-License-Identifier: Apache-2.0
"""The most instructions and stack of functions of a Cortex-M program, whatever they are given.

    python3 longest_path.py PROGRAM FUNCTION...

PROGRAM is a linked program whose C, in this folder, was compiled with debug information (-g). Its
instructions are those that arm-none-eabi-objdump prints. The bound is that of the longest path
through them: of two branches the longer one, and for a call the bound of what is called. A loop
runs as often as the `for` of the C says that the line of the loop's exit has. One that the compiler
makes for a copy ends where a register has grown by a constant to another one. Loops of the
compiler's own functions and of the square root shift numbers of at most 64 bits; those of memcpy,
memmove and memset store the bytes that the call says. If there is anything else, such as a loop
without a `for`, recursion, or a call by a pointer, there is no bound. The stack is what functions
reserve along the deepest chain of calls.
"""

import argparse
import re
from pathlib import Path

from loop_bounds import loop_bounds
from machine_code import COPIES, MachineCode, Unbounded, added, may_write

CALLER, PASS = -1, -2
BITS = 64
LIBRARY = re.compile(
    r"__aeabi_(?!mem)\w+|__u?(div|mod|divmod)[sd]i\d|__(ieee754_)?sqrtf?|(sqrt|floor|ceil|rint)f?"
    r"|__(add|sub|mul|div|fix|fixuns|float|floatun|trunc|extend|neg|cmp|unord)[sd][if]\w*"
)
STORED = {"strb": 1, "strh": 2, "str": 4, "strd": 8}
FLAGS = re.compile(r"\w+s|cmp|cmn|tst|teq")  # may set flags, by their names


class Program:
    """A linked program, and bounds of the instructions and the stack of its functions."""

    def __init__(self, file):
        self.code = MachineCode(file)
        self.loops: dict[tuple[str, int], int] = {}
        for name in {name for name, _ in self.code.lines.values()}:
            bounds = loop_bounds(Path(name).read_text())
            self.loops |= {(name, line): most for line, most in bounds.items()}
        self.known: dict[tuple[int, int | None], int] = {}
        self.open: list[tuple[int, int | None]] = []
        self.deep: dict[int, int] = {}
        self.open_stacks: list[int] = []

    def bound(self, begin: int, size: int | None = None) -> int:
        """Return the most instructions of a call of a function; `size` is that of a copy."""
        key = begin, size
        if key in self.open:
            raise Unbounded(f"{self.code.name(begin)} calls itself")
        if key not in self.known:
            self.open.append(key)
            nodes = self.code.reach(begin) | {CALLER: [begin]}
            done, _ = self._paths(CALLER, set(nodes), nodes, size)
            ends = [done[one] for one, after in nodes.items() if None in after]
            self.known[key] = max(ends, default=0)
            self.open.pop()
        return self.known[key]

    def stack(self, begin: int) -> int:
        """Return the most bytes of stack of a call of a function: all that it and the deepest chain
        of calls from it ever reserve."""
        if begin not in self.deep:
            if begin in self.open_stacks:
                raise Unbounded(f"{self.code.name(begin)} calls itself")
            self.open_stacks.append(begin)
            nodes = self.code.reach(begin)
            calls = {self.code.target(one) for one in nodes if self.code.is_call(one)}
            own = sum(self.code.reserved(one) for one in nodes)
            self.deep[begin] = own + max(map(self.stack, calls), default=0)
            self.open_stacks.pop()
        return self.deep[begin]

    def _cost(self, address, size) -> int:
        if address in (CALLER, PASS):
            return 0
        if not self.code.is_call(address):
            return 1
        target = self.code.target(address)
        copies = self.code.name(target) in COPIES
        return 1 + self.bound(target, self._size(address) if copies else None)

    def _size(self, call):
        """Return the number of bytes of a copy: the largest constant that r2 has at its call, on
        any way from the begin of the function."""
        sizes, seen, left = [], {call}, [call]
        while left:
            place = left.pop()
            before = self.code.before(place)
            if place in self.code.names or not before:
                raise Unbounded(f"{self.code.name(call)} copies an unknown number of bytes")
            for address in before - seen:
                name, rest = self.code.rows[address]
                match = re.fullmatch(r"mov[sw.]* r2, (?:#(\d+)|(r\d+|sl|fp))", f"{name} {rest}")
                if match:
                    sizes.append(int(match[1]) if match[1] else self._constant(match[2], call))
                elif self.code.is_call(address) or may_write("r2", name, rest):
                    raise Unbounded(f"{self.code.name(call)} copies an unknown number of bytes")
                else:
                    left.append(address)
            seen |= before
        return max(sizes)

    def _constant(self, register, call):
        """Return the largest constant in a register that calls preserve and that has no other."""
        numbers = []
        for address, (name, rest) in self.code.rows.items():
            if may_write(register, name, rest) and self.code.name(address) == self.code.name(call):
                match = re.fullmatch(rf"mov[sw.]* {register}, #(\d+)", f"{name} {rest}")
                numbers.append(int(match[1]) if match else None)
        if not numbers or None in numbers or register in ("r0", "r1", "r3"):
            raise Unbounded(f"{self.code.name(call)} copies an unknown number of bytes")
        return max(numbers)

    def _paths(self, begin, inside, nodes, size):
        """Return the longest paths from one of some nodes, without edges back to it: to the end of
        each node, and along each edge that leaves them."""
        arrive: dict[int | None, int] = {begin: 0}
        leave: dict[tuple[int, int | None], int] = {}
        done: dict[int, int] = {}
        for part in _in_order(begin, inside, nodes, begin):
            first = max(arrive.get(one, -1) for one in part)
            if part[0] == begin or (len(part) == 1 and part[0] not in nodes[part[0]]):
                done[part[0]] = first + self._cost(part[0], size)
                exits = {(part[0], one): done[part[0]] for one in nodes[part[0]]}
            else:
                ends, exits = self._loop(part, arrive, nodes, size)
                done |= {one: first + cost for one, cost in ends.items()}
                exits = {edge: first + cost for edge, cost in exits.items()}
            for (one, other), cost in exits.items():
                if other in inside and other != begin:
                    arrive[other] = max(arrive.get(other, 0), cost)
                else:
                    leave[one, other] = max(leave.get((one, other), 0), cost)
        return done, leave

    def _loop(self, part, arrive, nodes, size):
        """Return the longest paths through a loop from its head, as `_paths`."""
        inside = set(part)
        heads = [one for one in part if one in arrive]
        if len(heads) > 1:
            return self._loop_of_heads(heads, inside, nodes, size)
        head = heads[0]
        done, leave = self._paths(head, inside, nodes, size)
        cycle = max(cost for (_, other), cost in leave.items() if other == head)
        most = self._times(head, inside, nodes, size) * cycle
        ends = {one: most + cost for one, cost in done.items()}
        exits = {edge: most + cost for edge, cost in leave.items() if edge[1] not in inside}
        return ends, exits

    def _loop_of_heads(self, heads, inside, nodes, size):
        """Return the same for a loop with several heads: each way from one of its tests to the
        next, or to an end, counts as the longest, and a pass may have all tests."""
        line, tests = self._tests(heads, inside, nodes)
        if line is None:
            raise Unbounded(f"{self.code.name(heads[0])} has a loop with several heads")
        after = [other for one in tests for other in nodes[one]]
        rest = inside - tests
        begins = {PASS: [one for one in (*heads, *after) if one in rest]}
        done, _ = self._paths(PASS, rest | {PASS}, nodes | begins, size)
        most = (self.loops[line] + 2) * (max(done.values()) + 1) * len(tests)
        edges = [(one, other) for one in inside for other in nodes[one] if other not in inside]
        return dict.fromkeys(inside, most), dict.fromkeys(edges, most)

    def _tests(self, heads, inside, nodes):
        """Return the line of a `for` and its tests, which are on every way back to the heads."""
        tests = {}
        for one in inside:
            line = self.code.lines.get(one)
            if line in self.loops and any(other not in inside for other in nodes[one]):
                tests.setdefault(line, set()).add(one)
        cuts = [
            line
            for line, every in tests.items()
            if all(self._cut(head, inside, nodes, every) for head in heads)
        ]
        line = max(cuts, key=lambda one: self.loops[one], default=None)
        return line, tests.get(line, set())

    def _times(self, head, inside, nodes, size):
        """Return how often a loop goes back to its head at most."""
        line, _ = self._tests([head], inside, nodes)
        if line is not None:
            return self.loops[line]
        copied = self._passes_of_copy(head, inside, nodes)
        if copied is not None:
            return copied - 1
        places = {self.code.lines[one][1] for one in inside if one in self.code.lines}
        if places:
            why = f"has a loop without a bound, C lines {sorted(places)}"
            raise Unbounded(f"{self.code.name(head)} {why}")
        if size is None and not LIBRARY.fullmatch(self.code.name(head)):
            raise Unbounded(f"{self.code.name(head)} has a loop and no debug information")
        if size is None:
            return BITS
        stored = [STORED.get(self.code.rows[one][0].split(".")[0], 0) for one in inside]
        if not any(stored) or any(len(inside.intersection(nodes[one])) > 1 for one in inside):
            raise Unbounded(f"{self.code.name(head)} has a loop that does not store in each pass")
        return size // sum(stored)

    def _passes_of_copy(self, head, inside, nodes):
        """Return the passes of a loop without branches that ends where a register, to which it adds
        a constant, equals another one; None for any other loop."""
        tests = [one for one in inside if self.code.rows[one][0].split(".")[0] == "cmp"]
        ends = [
            self.code.rows[one][0] for one in inside if nodes[one] != [self.code.after.get(one)]
        ]
        if len(tests) != 1 or len(ends) != 1 or ends[0].split(".")[0] != "bne":
            return None
        registers = re.fullmatch(r"(\w+), (\w+)", self.code.rows[tests[0]][1])
        later = [self.code.rows[one] for one in inside if one > tests[0]]
        if registers is None or any(FLAGS.fullmatch(name.split(".")[0]) for name, _ in later):
            return None
        for counter, end in (registers.groups(), registers.groups()[::-1]):
            writes = [
                self.code.rows[one] for one in inside if may_write(counter, *self.code.rows[one])
            ]
            steps = [step for one in writes if (step := added(counter, counter, *one))]
            if not steps or len(steps) < len(writes):
                continue
            if any(may_write(end, *self.code.rows[one]) for one in inside):
                continue
            if any(may_write(counter, *code) for code in later):
                continue
            ahead = self._ahead(head, inside, counter, end)
            if ahead is not None and ahead % sum(steps) == 0:
                return ahead // sum(steps)
        return None

    def _ahead(self, head, inside, counter, end):
        """Return the largest constant by which a register is ahead of another before a loop, None
        if it is anything else."""
        constants, moves = [], {}
        left = [(one, 0) for one in self.code.before(head) if one not in inside]
        while left:
            address, moved = left.pop()
            if moves.setdefault(address, moved) != moved:
                return None
            code = self.code.rows[address]
            if may_write(end, *code):
                constants.append((added(end, counter, *code) or moved) - moved)
                continue
            step = added(counter, counter, *code) if may_write(counter, *code) else 0
            if step is None or self.code.is_call(address) or address in self.code.names:
                return None
            before = [one for one in self.code.before(address) if one not in inside]
            left += [(one, moved + step) for one in before if moves.get(one) != moved + step]
        return max(constants) if constants and min(constants) > 0 else None

    def _cut(self, head, inside, nodes, tests):
        """Whether every way back to the head of a loop has one of some tests."""
        if head in tests:
            return True
        parts = _in_order(head, inside - tests, nodes)
        return not any(head in part and (len(part) > 1 or head in nodes[head]) for part in parts)


def _in_order(begin, inside, nodes, without=None):
    """Return the strongly connected parts of some nodes, without edges to one of them, in the order
    of their edges (Tarjan, Depth-first search and linear graph algorithms, 1972)."""
    number, low, stack, on_stack, parts = {begin: 0}, {begin: 0}, [begin], {begin}, []
    work = [(begin, iter(nodes[begin]))]
    while work:
        one, edges = work[-1]
        for other in edges:
            if other not in inside or other == without:
                continue
            if other not in number:
                number[other] = low[other] = len(number)
                stack.append(other)
                on_stack.add(other)
                work.append((other, iter(nodes[other])))
                break
            if other in on_stack:
                low[one] = min(low[one], number[other])
        else:
            work.pop()
            if work:
                low[work[-1][0]] = min(low[work[-1][0]], low[one])
            if low[one] == number[one]:
                place = stack.index(one)
                parts.append(stack[place:])
                on_stack.difference_update(stack[place:])
                del stack[place:]
    return parts[::-1]


def main():
    """Print the bounds of the functions of a program, or why there are none."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("functions", nargs="+")
    arguments = parser.parse_args()
    program = Program(arguments.program)
    bounds = {"instructions": program.bound, "bytes of stack": program.stack}
    for name in arguments.functions:
        for what, bound in bounds.items():
            try:
                print(f"{name}: {bound(program.code.starts[name])} {what} at most")
            except Unbounded as error:
                print(f"{name}: no bound of {what}: {error}")
                program.open.clear()
                program.open_stacks.clear()


if __name__ == "__main__":
    main()
