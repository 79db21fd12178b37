# SPDX-License-Identifier: Apache-2.0
"""The most passes of the loops of a C text."""

import re

LITERAL = re.compile(r"(-?)(?:U?INT\d+_C\((\d+)\)|(\d+)u?)")
FOR = re.compile(r"\bfor \((?:int\w+ \w+ = (\d+))?; ([\w>.-]+) < (\w+); [\w>.-]+\+\+\)")
HEAD = re.compile(r"^[a-z]\w*[^;{}=#/]*?\b(\w+)\([^;{}]*\)\s*\{", re.M)


def loop_bounds(text):
    """Return the most passes of each `for` of a C text, by its line."""
    bounds = {}
    for match in FOR.finditer(text):
        begin, end, before = match[1], match[3], text[: match.start()]
        if begin is None:
            begin = _least_start(before, match[2])
        if not end.isdecimal():
            end = _largest_count(text, before, end)
        if begin is not None and end is not None:
            bounds[before.count("\n") + 1] = max(0, int(end) - int(begin))
    return bounds


def _least_start(before, counter):
    """Return the least constant that the function before a place gives a counter; None if it gives
    it anything else."""
    heads = list(HEAD.finditer(before))
    own = before[heads[-1].end() :] if heads else before
    least = None
    for start in re.findall(rf"(?<![\w>.]){re.escape(counter)} = ([^;]*);", own):
        number = LITERAL.fullmatch(start)
        if number is None:
            return None
        value = int(number[1] + (number[2] or number[3]))
        least = value if least is None else min(least, value)
    return least


def _largest_count(text, before, count):
    """Return the largest first argument in calls of the function around a place."""
    heads = HEAD.findall(before)
    if not heads:
        return None
    calls = re.findall(rf"\b{heads[-1]}\((int32_t \w+|[^,()]*)", text)
    numbers = [one for one in calls if one != f"int32_t {count}"]
    if len(numbers) == len(calls) or not all(one.isdecimal() for one in numbers):
        return None
    return max(map(int, numbers), default=None)
