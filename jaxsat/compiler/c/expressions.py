"""Operations of the scalar program as C expressions, every one rounded as the program says."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from jaxsat.compiler.c.helpers import TYPES, least, unsigned
from jaxsat.compiler.ir import NamedNumber, NativeBug

PRIMARY, UNARY, PRODUCT, SUM, RELATION, EQUALITY, BOTH, EITHER, CHOICE = range(9)
"""Precedences of expressions, the tightest first."""


@dataclass(frozen=True)
class Expression:
    """C text and its precedence."""

    text: str
    level: int = PRIMARY

    def inside(self, level: int) -> str:
        """Return the text as an operand of an operator of this level, in parentheses where due."""
        return self.text if self.level <= level else f"({self.text})"


Need = Callable[[str, np.dtype, np.dtype | None], str]
"""Function that returns a helper's name, and has it printed."""

_INFIX = {
    "add": ("+", SUM), "sub": ("-", SUM), "mul": ("*", PRODUCT), "div": ("/", PRODUCT),
    "lt": ("<", RELATION), "le": ("<=", RELATION), "gt": (">", RELATION), "ge": (">=", RELATION),
    "eq": ("==", EQUALITY), "ne": ("!=", EQUALITY),
}  # fmt: skip
_COMPARES = frozenset(("lt", "le", "gt", "ge", "eq", "ne"))
_LOGIC = {"and": ("&&", BOTH), "or": ("||", EITHER), "mul": ("&&", BOTH), "min": ("&&", BOTH),
          "max": ("||", EITHER), "xor": ("!=", EQUALITY), "add": ("!=", EQUALITY),
          "sub": ("!=", EQUALITY)}  # fmt: skip
_BITS = {"and": "&", "or": "|", "xor": "^"}
_LIBRARY = {
    "abs": "fabs", "sqrt": "sqrt", "floor": "floor", "ceil": "ceil", "trunc": "trunc",
    "round_even": "rint", "copysign": "copysign", "rem": "fmod",
}  # fmt: skip


def literal(x: Any) -> Expression:
    """Return a constant: the shortest decimal that is read back to the same bits."""
    if isinstance(x, NamedNumber):
        return Expression(x.name)
    dtype = x.dtype
    if dtype.kind == "b":
        return Expression("true" if x else "false")
    if dtype.kind == "f":
        suffix = "F" if dtype.itemsize == 4 else ""
        if np.isnan(x):
            return Expression(f"({TYPES[dtype]})NAN", UNARY)
        if np.isinf(x):
            return Expression(f"{'-' if x < 0 else ''}({TYPES[dtype]})INFINITY", UNARY)
        text = str(x) if "." in str(x) or "e" in str(x) else f"{x}.0"
        return Expression(text + suffix, UNARY if text.startswith("-") else PRIMARY)
    number, bits = int(x), 8 * dtype.itemsize
    if dtype.kind == "u":
        return Expression(f"UINT{bits}_C({number})" if bits > 16 else f"({TYPES[dtype]}){number}u")
    if number == np.iinfo(dtype).min:
        return Expression(least(dtype), UNARY)
    text = str(number) if bits <= 32 else f"INT64_C({abs(number)})"
    text = f"-{text}" if bits > 32 and number < 0 else text
    return Expression(text, UNARY if number < 0 else PRIMARY)


def called(name: str, *args: Expression) -> Expression:
    """Return a call of a function of C."""
    return Expression(f"{name}({', '.join(arg.text for arg in args)})")


def infix(sign: str, level: int, x: Expression, y: Expression) -> Expression:
    """Return a binary operation; operators of one level associate from left to right."""
    mixed = level in (BOTH, EITHER)
    left = x.inside(level) if not mixed or x.level in (PRIMARY, UNARY, level) else f"({x.text})"
    if level in (RELATION, EQUALITY):
        left = x.inside(SUM)
    right = y.inside(SUM if level in (RELATION, EQUALITY) else level - 1)
    if mixed and y.level not in (PRIMARY, UNARY):
        right = f"({y.text})"
    return Expression(f"{left} {sign} {right}", level)


def operation(
    name: str, args: list[Expression], kinds: list[np.dtype], out: np.dtype, need: Need
) -> Expression:
    """Return an operation of the table in `jaxsat.compiler.operations`."""
    dtype = kinds[-1] if name == "select" else kinds[0]
    match name:
        case "select":
            first, yes, no = (arg.inside(UNARY) for arg in args)
            yes, no = _chosen(yes, first, 0), _chosen(no, first, 1)
            return Expression(f"{first} ? {yes} : {no}", CHOICE)
        case "convert":
            return _converted(args[0], dtype, out, need)
        case "bitcast":
            return _bitcast(args[0], dtype, out, need)
        case "any":
            return args[0]
    if name in _COMPARES:
        if dtype.kind == "b" and name not in ("eq", "ne"):
            args = [Expression(f"(int32_t){arg.inside(UNARY)}", UNARY) for arg in args]
        return infix(*_INFIX[name], *args)
    expression = {"f": _floating, "b": _logical}.get(dtype.kind, _whole)(name, args, dtype, need)
    if expression is None:
        raise NativeBug("printing C", f"no {name} of {dtype} numbers")
    return expression


_PLACE = re.compile(r"[\w>.\-\[\]]+")
_WHOLE_NUMBER = re.compile(r"-?(\d+|INT64_C\(\d+\))")
_NUMBER = re.compile(r"-?[\d.]+(e[+-]?\d+)?F?|true|false|[A-Z][A-Z0-9_]*")


def _chosen(text: str, predicate: str, which: int) -> str:
    """Return the side that a predicate selects, without selections by it of this or of a number."""
    begin = text.find(f"({predicate} ? ") if _PLACE.fullmatch(predicate) else -1
    if begin < 0:
        return text
    end, depth = begin, 0
    parts = [begin + len(predicate) + 4]
    while depth or end == begin:
        depth += (text[end] == "(") - (text[end] == ")")
        if depth == 1 and text.startswith(" : ", end):
            parts += [end, end + 3]
        end += 1
    branches = [text[parts[0] : parts[1]], text[parts[2] : end - 1]]
    if not _NUMBER.fullmatch(branches[1 - which]):
        return text
    is_call = re.search(r"\w$", text[:begin])
    part = f"({branches[which]})" if is_call else branches[which]
    return text[:begin] + part + text[end:]


def _floating(name, args, dtype, need) -> Expression | None:
    if name in _INFIX:
        return infix(*_INFIX[name], *args)
    if name == "neg":
        text = args[0].inside(UNARY)
        return Expression(f"-({text})" if text.startswith("-") else f"-{text}", UNARY)
    if name in ("max", "min"):
        return called(need(f"{name}imum", dtype, None), *args)
    if name in _LIBRARY:
        return called(_LIBRARY[name] + ("f" if dtype.itemsize == 4 else ""), *args)
    return None


def _logical(name, args, dtype, need) -> Expression | None:
    del dtype, need
    if name == "xor" and "true" in (args[0].text, args[1].text):
        x = args[0] if args[1].text == "true" else args[1]
        return Expression(f"!{x.inside(UNARY)}", UNARY)
    return infix(*_LOGIC[name], *args) if name in _LOGIC else None


def _whole(name, args, dtype, need) -> Expression | None:
    if name in ("max", "min"):
        return called(need(f"{name}imum", dtype, None), *args)
    if name == "neg":
        return _whole("sub", [literal(dtype.type(0)), args[0]], dtype, need)
    if name == "abs":
        zero = literal(dtype.type(0))
        less = infix("<", RELATION, args[0], zero)
        negated = called(need("sub", dtype, None), zero, args[0])
        return Expression(f"({less.text}) ? {negated.text} : {args[0].inside(UNARY)}", CHOICE)
    signed = dtype.kind == "i"
    if signed and name in ("add", "sub", "mul", "shift_left", "shift_right_logical",
                           "shift_right_arithmetic", "population_count"):  # fmt: skip
        return called(need(name, dtype, None), *args)
    if name == "population_count":
        return called(need(name, dtype, None), *args)
    if signed and name in ("div", "rem") and not _WHOLE_NUMBER.fullmatch(args[1].text):
        return called(need("quotient" if name == "div" else "remainder", dtype, None), *args)
    shifts = {"shift_left": "<<", "shift_right_logical": ">>"}
    if name in ("add", "sub", "mul", "div", "rem"):
        sign, level = _INFIX.get(name, ("%", PRODUCT))
        expression = infix(sign, level, *args)
    elif name in _BITS or name in shifts:
        sign = _BITS.get(name) or shifts[name]
        expression = Expression(f"{args[0].inside(UNARY)} {sign} {args[1].inside(UNARY)}", CHOICE)
    elif name == "shift_right_arithmetic":
        word = np.dtype(f"i{dtype.itemsize}")
        signed_args = [called(need("signed_of", dtype, None), arg) for arg in args]
        call = called(need(name, word, None), *signed_args)
        return Expression(f"({TYPES[dtype]}){call.text}", UNARY)
    else:
        return None
    narrow = dtype.itemsize < 4
    return Expression(f"({TYPES[dtype]})({expression.text})", UNARY) if narrow else expression


def _converted(x: Expression, old: np.dtype, new: np.dtype, need: Need) -> Expression:
    if old == new:
        return x
    if new.kind == "b":
        return infix("!=", EQUALITY, x, literal(old.type(0)))
    if old.kind == "b":
        one, zero = (literal(new.type(n)) for n in (1, 0))
        return Expression(f"{x.inside(UNARY)} ? {one.text} : {zero.text}", CHOICE)
    if old.kind == "f" and new.kind in "iu":
        return called(need("whole", old, new), x)
    if new.kind == "i" and old.kind in "iu" and (old.kind == "u" or new.itemsize < old.itemsize):
        word = unsigned(new)
        return called(
            need("signed_of", word, None), Expression(f"({TYPES[word]}){x.inside(UNARY)}", UNARY)
        )
    return Expression(f"({TYPES[new]}){x.inside(UNARY)}", UNARY)


def _bitcast(x: Expression, old: np.dtype, new: np.dtype, need: Need) -> Expression:
    if "f" in (old.kind, new.kind):
        return called(need("bits", old, new), x)
    return _converted(x, old, new, need)
