"""Statements of C in which the number of a mode stands without its name."""

import re

_ENUMERATED = re.compile(r"The numbers of ((?:controller_\w+\.\w+,?\s*)+)")
_FLOAT = re.compile(r"\d+\.\d*(?:e[+-]?\d+)?F?|\d+e[+-]?\d+F?")
_BARE = re.compile(r"(?:[=?:]|add_i32\() ?-?\d+\b")


def enumerated(header: str) -> set[str]:
    """The fields that the header tells to have numbers with names."""
    told = " ".join(_ENUMERATED.findall(header))
    return set(re.findall(r"\.(\w+)", told))


def bare_modes(header: str, code: str) -> list[str]:
    """Statements that assign, choose or compare a whole number where such a field is."""
    of_mode = re.compile(rf"->(?:{'|'.join(sorted(enumerated(header)))})\b")
    statements = (one for one in re.split("[;{}]", code) if of_mode.search(one))
    return [one for one in statements if _BARE.search(_FLOAT.sub("x", one))]
