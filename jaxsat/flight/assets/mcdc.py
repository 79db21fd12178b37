# SPDX-License-Identifier: Apache-2.0
"""Modified condition/decision coverage (MC/DC) of controller.c, which gcc 12 cannot measure.

    python3 mcdc.py instrument controller.c > build/mcdc.c
    (build and run it with the test program; it writes build/mcdc.txt)
    python3 mcdc.py report controller.c build/mcdc.txt > controller.c.mcdc

A decision is an expression of conditions with `&&`, `||`, `!` and `!=` or `==` of truth values, or
one condition alone, wherever it stands: in `if`, `for` and `? :`, and in what is assigned, passed
or returned. Every evaluation records which conditions were evaluated, how, and the outcome. A
condition is covered if two evaluations differ in it and in the outcome, and in no other condition
that both evaluated: one that `&&` or `||` left out is masked (CAST-10, masking MC/DC).
"""

import re
import sys
from dataclasses import dataclass, field
from pathlib import Path

TOKEN = re.compile(
    r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*$|[A-Za-z_]\w*|\.?\d(?:[eEpP][+-]|[\w.])*|\s+"
    r"|->|<<|>>|<=|>=|==|!=|&&|\|\||\+\+|--|[-+*/%&|^]=|.",
    re.DOTALL | re.MULTILINE,
)
ENDS = {",", "?", ":", ";", "=", "{", "}", "return", "case"}
RELATIONS = {"<", "<=", ">", ">=", "==", "!="}
CLOSING = {"(": ")", "[": "]"}


class Token(str):
    """A word or sign of the text, and its line."""

    line: int


@dataclass
class Group:
    """What stands in parentheses or brackets, without them."""

    sign: str
    line: int
    parts: list = field(default_factory=list)


@dataclass
class Decision:
    """The line of a decision, and the texts of its conditions."""

    line: int
    conditions: list[str]


class Instrumented:
    """The text with every condition and decision recorded, and the decisions in their order."""

    def __init__(self, text: str):
        self.decisions: list[Decision] = []
        self._tokens = _tokens(re.sub(r"/\*.*?\*/", _blank, text, flags=re.DOTALL))
        self._place = 0
        self.text = self._sequence(self._group("", 1).parts)

    def _group(self, sign: str, line: int) -> Group:
        group = Group(sign, line)
        while self._place < len(self._tokens):
            token = self._tokens[self._place]
            self._place += 1
            if token in CLOSING:
                group.parts.append(self._group(token, token.line))
            elif token == CLOSING.get(sign):
                return group
            else:
                group.parts.append(token)
        return group

    def _sequence(self, parts: list, *, is_decision: bool = False) -> str:
        """Parts in order, cut where one expression ends and another begins."""
        texts, begin = [], 0
        for place, part in enumerate([*parts, ";"]):
            if isinstance(part, Group) or part not in ENDS:
                continue
            forced = is_decision or (part == "?" and place < len(parts))
            texts.append(self._expression(parts[begin:place], forced=forced))
            texts += [part] if place < len(parts) else []
            begin = place + 1
        return "".join(texts)

    def _expression(self, parts: list, *, forced: bool) -> str:
        if not forced and not _is_boolean(parts):
            return self._plain(parts)
        number = len(self.decisions)
        decision = Decision(_whole(parts)[0].line, [])
        self.decisions.append(decision)
        return f" mcdc_decision({number}u, {self._boolean(parts, number, decision)})"

    def _boolean(self, parts: list, number: int, decision: Decision) -> str:
        """An expression whose conditions are recorded as those of a decision."""
        for sign in ("||", "&&"):
            if sign in parts:
                place = parts.index(sign)
                left, right = parts[:place], parts[place + 1 :]
                texts = [self._boolean(one, number, decision) for one in (left, right)]
                return f"{texts[0]} {sign} {texts[1]}"
        whole = _whole(parts)
        if whole[0] == "!":
            return f"!({self._boolean(parts[parts.index('!') + 1 :], number, decision)})"
        if len(whole) == 1 and isinstance(whole[0], Group) and _is_boolean(whole[0].parts):
            return f"({self._boolean(whole[0].parts, number, decision)})"
        for sign in ("!=", "=="):
            if sign in parts:
                place = parts.index(sign)
                sides = parts[:place], parts[place + 1 :]
                if any(_is_enclosed_boolean(side) for side in sides):
                    texts = [self._boolean(side, number, decision) for side in sides]
                    return f"({texts[0]}) {sign} ({texts[1]})"
        place = len(decision.conditions)
        decision.conditions.append(" ".join(_text(parts).split()))
        return f"mcdc_condition({number}u, {place}u, {self._plain(parts)})"

    def _plain(self, parts: list) -> str:
        """Parts that are no decision; what stands in parentheses may have some."""
        texts: list[str] = []
        before: str | Group | None = None
        for part in parts:
            if isinstance(part, Group):
                inside = self._sequence(part.parts, is_decision=before == "if")
                texts.append(f"{part.sign}{inside}{CLOSING[part.sign]}")
            else:
                texts.append(part)
            before = part if not isinstance(part, str) or part.strip() else before
        return "".join(texts)


def _blank(comment: re.Match) -> str:
    return "\n" * comment.group().count("\n") or " "


def _tokens(text: str) -> list[Token]:
    tokens, line = [], 1
    for word in TOKEN.findall(text):
        token = Token(word)
        token.line = line
        tokens.append(token)
        line += word.count("\n")
    return tokens


def _text(parts: list) -> str:
    return "".join(
        part if isinstance(part, str) else f"{part.sign}{_text(part.parts)}{CLOSING[part.sign]}"
        for part in parts
    )


def _whole(parts: list) -> list:
    """The parts without spaces."""
    return [part for part in parts if isinstance(part, Group) or part.strip()]


def _is_boolean(parts: list) -> bool:
    """Whether an expression is a truth value by its operators, selections left aside."""
    if any(part in ENDS for part in parts if isinstance(part, str)):
        return False
    signs = {part for part in parts if isinstance(part, str)}
    return bool(signs & (RELATIONS | {"&&", "||", "!"})) or _is_enclosed_boolean(parts)


def _is_enclosed_boolean(parts: list) -> bool:
    whole = _whole(parts)
    return len(whole) == 1 and isinstance(whole[0], Group) and _is_boolean(whole[0].parts)


RECORDING = """\
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define DECISIONS (%du)
#define LONGEST (64u)
typedef struct {
  uint64_t evaluated;
  uint64_t held;
  bool outcome;
} mcdc_vector;
static mcdc_vector mcdc_now[DECISIONS + 1u];
static mcdc_vector *mcdc_found[DECISIONS + 1u];
static unsigned mcdc_count[DECISIONS + 1u];
static bool mcdc_began;

static void mcdc_write(void)
{
  FILE *file = fopen("build/mcdc.txt", "a");
  for (unsigned number = 0u; (file != NULL) && (number < DECISIONS); number++) {
    for (unsigned i = 0u; i < mcdc_count[number]; i++) {
      const mcdc_vector *one = &mcdc_found[number][i];
      fprintf(file, "%%u %%llu %%llu %%d\\n", number, (unsigned long long)one->evaluated,
              (unsigned long long)one->held, one->outcome ? 1 : 0);
    }
  }
  if (file != NULL) {
    fclose(file);
  }
}

static inline bool mcdc_condition(unsigned number, unsigned place, bool value)
{
  mcdc_now[number].evaluated |= (uint64_t)1u << place;
  mcdc_now[number].held |= (uint64_t)(value ? 1u : 0u) << place;
  return value;
}

static inline bool mcdc_decision(unsigned number, bool outcome)
{
  mcdc_vector *now = &mcdc_now[number];
  unsigned i = 0u;
  now->outcome = outcome;
  while ((i < mcdc_count[number]) && ((mcdc_found[number][i].evaluated != now->evaluated) ||
         (mcdc_found[number][i].held != now->held))) {
    i++;
  }
  if (i == mcdc_count[number]) {
    mcdc_found[number] = realloc(mcdc_found[number], (i + 1u) * sizeof(mcdc_vector));
    if (mcdc_found[number] == NULL) {
      exit(3);
    }
    mcdc_found[number][i] = *now;
    mcdc_count[number]++;
  }
  if (!mcdc_began) {
    mcdc_began = true;
    atexit(mcdc_write);
  }
  *now = (mcdc_vector){0};
  return outcome;
}
"""


def covered(conditions: int, vectors: set[tuple[int, int, int]]) -> list[bool]:
    """Which conditions of a decision are covered by its evaluations (evaluated, held, outcome)."""
    yes = [one for one in vectors if one[2]]
    no = [one for one in vectors if not one[2]]
    coverage = [False] * conditions
    for first in yes:
        for second in no:
            differ = (first[1] ^ second[1]) & first[0] & second[0]
            if differ and not differ & (differ - 1):
                coverage[differ.bit_length() - 1] = True
    return coverage


def report(text: str, recorded: str) -> str:
    """The percentages, then every condition that is not covered, by its line."""
    decisions = Instrumented(text).decisions
    vectors: dict[int, set[tuple[int, int, int]]] = {}
    for line in recorded.splitlines():
        number, *vector = map(int, line.split())
        vectors.setdefault(number, set()).add((vector[0], vector[1], vector[2]))
    lines, total, whole, outcomes = [], [0, 0], 0, 0
    for number, one in enumerate(decisions):
        coverage = covered(len(one.conditions), vectors.get(number, set()))
        outcomes += len({vector[2] for vector in vectors.get(number, ())})
        total[0] += sum(coverage)
        total[1] += len(coverage)
        whole += all(coverage)
        for place, is_covered in enumerate(coverage):
            if not is_covered:
                seen = vectors.get(number, set())
                values = {held >> place & 1 for done, held, _ in seen if done >> place & 1}
                about = {0: "never evaluated", 1: f"always {'true' if 1 in values else 'false'}"}
                why = about.get(len(values), "never decides alone")
                lines.append(f"line {one.line}: {one.conditions[place]}: {why}")
    head = [
        f"Decisions, both outcomes: {_percent(outcomes, 2 * len(decisions))}",
        f"Conditions, independent effect (MC/DC): {_percent(*total)}",
        f"Decisions with MC/DC of all conditions: {_percent(whole, len(decisions))}",
    ]
    return "\n".join([*head, *lines, ""])


def _percent(some: int, every: int) -> str:
    return f"{100 * some / every if every else 100:.2f}% of {every}"


def main(words: list[str]) -> None:
    """`instrument FILE` or `report FILE RECORDED`, on standard output."""
    text = Path(words[1]).read_text()
    if words[0] == "report":
        sys.stdout.write(report(text, Path(words[2]).read_text()))
        return
    program = Instrumented(text)
    assert all(len(one.conditions) <= 64 for one in program.decisions)
    sys.stdout.write(RECORDING % len(program.decisions) + program.text)


if __name__ == "__main__":
    main(sys.argv[1:])
