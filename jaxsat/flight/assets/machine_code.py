# SPDX-License-Identifier: Apache-2.0
"""The machine code of a linked Cortex-M program, as arm-none-eabi-objdump prints it."""

import re
import subprocess
from bisect import bisect_right
from itertools import pairwise
from pathlib import Path

OBJDUMP = "arm-none-eabi-objdump"
COPIES = ("memcpy", "memmove", "memset")

ROW = re.compile(r"^ *([0-9a-f]+):[ \t]+([a-z][\w.]*)[ \t]*([^@;\n]*)", re.M)
LINE = re.compile(r"^(\S+\.c):?\s+(\d+|-)\s+(0x[0-9a-f]+|0)\b", re.M)
CONDITIONS = "eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le|hs|lo"
TABLE = re.compile(r"tb[bh] |(mov|add|ldr)\S* pc, (?!lr|\[sp)")
SEVERAL = r"ldm|pop|ldrd|[us]ml|[us]mull|vmov"  # more results than their first operand
RETURN = re.compile(r"(mov|ldr)\S* pc, |(pop|ldm)\S* .*\bpc\}")
SAVES = re.compile(r"(push|pop) |(stm|ldm)\S* sp!")
BRANCH = re.compile(rf"(b|bl|bx|blx)({CONDITIONS})?(\.[nw])?|(cbn?z)")


class Unbounded(Exception):
    """The instructions of a part of a program have no bound."""


class MachineCode:
    """Instructions by address, as name and operands, with functions and lines of C."""

    def __init__(self, file):
        listing = _printed(OBJDUMP, "-d", "--no-show-raw-insn", file)
        self.rows = {int(a, 16): (name, rest.strip()) for a, name, rest in ROW.findall(listing)}
        addresses = sorted(self.rows)
        self.after = dict(pairwise(addresses))
        self.previous = {after: one for one, after in self.after.items()}
        self.jumps: dict[int, set[int]] = {}
        for address in filter(self._jump, self.rows):
            self.jumps.setdefault(self.target(address), set()).add(address)
        names = re.findall(r"^([0-9a-f]+) <([^>]+)>:$", listing, re.M)
        self.names = {int(address, 16): name for address, name in names}
        self.begins = sorted(self.names)
        self.starts = {name: address for address, name in self.names.items()}
        self.lines = self._lines(_printed(OBJDUMP, "--dwarf=decodedline", file), addresses)

    def _lines(self, listing, addresses):
        """Return the file and line of each address that has them."""
        marks = {}
        for name, line, address in LINE.findall(listing):
            marks[int(address, 16)] = None if line == "-" else (name, int(line))
        lines, now = {}, None
        for address in addresses:
            now = marks.get(address, now)
            if address in self.names and address not in marks:
                now = None
            if now is not None and Path(now[0]).exists():
                lines[address] = now
        return lines

    def reserved(self, address):
        """Return the bytes of stack that an instruction reserves."""
        name, rest = self.rows[address]
        text = f"{name} {rest}"
        saved = re.match(r"v?(?:push\S*|stmdb\S* sp!,) \{(.*)\}", text)
        if saved:
            ranges = re.findall(r"([a-z]+)(\d*)(?:-[a-z]+(\d+))?", saved[1])
            sizes = {"d": 8}
            return sum(
                sizes.get(kind, 4) * (int(last) - int(first) + 1 if last else 1)
                for kind, first, last in ranges
            )
        number = re.match(r"subw?\S* sp, (?:sp, )?#(\d+)|str\S* .*\[sp, #-(\d+)\]!", text)
        if number:
            return int(number[1] or number[2])
        if re.match(r"(sub|mov|bic|and)\S* sp,|add\S* sp, (?:sp, )?(?!sp)[a-z]", text):
            raise Unbounded(f"{self.name(address)} reserves stack by a number that it computes")
        return 0

    def name(self, address):
        """Return the name of the function at an address."""
        return self.names[self.begins[bisect_right(self.begins, address) - 1]]

    def reach(self, begin):
        """Return the possible successors of each instruction of a function; None is the return."""
        nodes, left = {}, [begin]
        while left:
            address = left.pop()
            if address not in nodes:
                nodes[address] = self.next(address)
                left += [one for one in nodes[address] if one is not None]
        return nodes

    def next(self, address):
        """Return the addresses of the instructions that may be next; None is the return."""
        name, rest = self.rows[address]
        after = self.after.get(address)
        match = BRANCH.fullmatch(name)
        if match is None or match[1] == "bl":
            if TABLE.match(f"{name} {rest}"):
                raise Unbounded(f"{self.name(address)} jumps by a table")
            if not RETURN.match(f"{name} {rest}"):
                return [after]
            return [None, after] if self._is_conditional(address) else [None]
        if match[1] in ("bx", "blx"):
            if rest != "lr":
                raise Unbounded(f"{self.name(address)} calls by a pointer")
            return [None, after] if match[2] else [None]
        target = None if self.is_call(address) else self.target(address)
        return [target, after] if match[2] or match[4] else [target]

    def _jump(self, address):
        """Return which jump to an address that it states an instruction is, None for any other."""
        match = BRANCH.fullmatch(self.rows[address][0])
        return None if match is None or match[1] in ("bx", "blx") else match[1] or match[4]

    def target(self, address):
        """Return the address to which an instruction jumps."""
        return int(self.rows[address][1].split(",")[-1].split()[0], 16)

    def is_call(self, address):
        """Whether an instruction calls a function, or ends by a copy in the place of its own."""
        jump = self._jump(address)
        if jump is None:
            return False
        target = self.names.get(self.target(address))
        return jump == "bl" or (target in COPIES and self.name(address) != target)

    def _is_conditional(self, address):
        """Whether an instruction may be one of the at most four after an IT."""
        for distance in range(4):
            address = self.previous.get(address, -1)
            name = self.rows.get(address, ("", ""))[0]
            if re.fullmatch("it[te]{0,3}", name):
                return len(name) - 1 > distance
        return False

    def before(self, address):
        """Return the instructions after which that at an address may be next."""
        places, before = set(self.jumps.get(address, ())), self.previous.get(address)
        if before is not None and address in self.next(before):
            places.add(before)
        return places


def may_write(register, name, rest):
    """Whether an instruction may change a register, but for those that save and restore it."""
    if not re.search(rf"\b{register}\b", rest) or SAVES.match(f"{name} {rest}"):
        return False
    if re.search(rf"\[{register}\b[^]]*\](!|,)|\b{register}!", rest):
        return True
    if re.match(r"str|stm|cmp|cmn|tst|teq|cbn?z", name):
        return False
    return rest.startswith(f"{register},") or bool(re.match(SEVERAL, name))


def added(result, register, name, rest):
    """Return the constant that an instruction adds to a register for a result, None for another."""
    operands = (
        rf"{result}, (?:{register}, )?#(\d+)"
        if result == register
        else rf"{result}, {register}, #(\d+)"
    )
    match = re.fullmatch(rf"add[sw.]* {operands}", f"{name} {rest}")
    return int(match[1]) if match else None


def _printed(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout
