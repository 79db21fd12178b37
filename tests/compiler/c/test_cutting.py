"""Long functions in parts: no part is too large, and they compute what the function did."""

import random
import subprocess

import pytest

from helpers.tools import needs
from jaxsat.compiler.c.cutting import Text, in_parts, lines_of
from jaxsat.compiler.c.functions import Unit
from jaxsat.compiler.c.naming import Names
from jaxsat.compiler.c.workspace import declared
from tests.flight.sizes import sizes

HEAD = "#include <stdbool.h>\n#include <stdint.h>\n#include <stdio.h>\n\n"
MAIN = """
int main(void)
{
  const double given[3] = {0.7, -0.3, 0.1};
  double found[40];
  long_one(given, found);
  for (int32_t i = 0; i < 40; i++) {
    (void)printf("%a\\n", found[i]);
  }
  return 0;
}
"""


def _statements(draw: random.Random) -> list[str]:
    """Statements of all kinds that the printer writes, which read what was made before."""
    lines = ["  const double rows[2][2] = {{0.5, 0.25}, {given[0], given[1]}};"]
    names = ["given[0]", "given[1]", "given[2]"]
    for number in range(40):
        a, b, c = (draw.choice(names) for _ in range(3))
        x = f"x_{number}"
        kind = draw.randrange(7)
        if kind == 0:
            lines.append(f"  const double {x} = ({a} > {b}) ? {c} : 0.5;")
            names.append(x)
        elif kind == 1:
            lines += [f"  double {x}[3];", "  for (int32_t i = 0; i < 3; i++) {"]
            lines += [f"    {x}[i] = given[i] * {a} - {b};", "  }"]
            names += [f"{x}[0]", f"{x}[2]"]
        elif kind == 2:
            lines.append(f"  const double {x}[2][2] = {{{{{a}, {b}}}, {{{c}, {a} - 0.25}}}};")
            lines.append(f"  const double y_{number} = trace({x}, {b});")
            names += [f"{x}[1][1]", f"y_{number}"]
        elif kind == 3:
            lines += [f"  double {x} = {a};", f"  int32_t n_{number} = 0;"]
            lines.append(f"  for (; n_{number} < 30; n_{number}++) {{")
            lines += [f"    if (!({x} < 0.9)) {{", "      break;", "    }"]
            for turn in range(draw.choice([1, 70])):
                lines.append(f"    const double t_{number}_{turn} = 0.5 * {x} + {b};")
                lines.append(f"    {x} = t_{number}_{turn} * 0.5;")
            lines.append("  }")
            names.append(x)
        elif kind == 4:
            lines += ["  /* Law.step: a comment that names x_1 */", f"  double {x}, z_{number};"]
            lines += [f"  if (({a} < {b}) && ({c} > 0.0)) {{", f"    {x} = 0.1 * {a};"]
            lines += [f"    z_{number} = {x};", "  } else {", f"    {x} = -0.5;"]
            lines += [f"    z_{number} = {b} * 0.5;", "  }"]
            names += [x, f"z_{number}"]
        elif kind == 5:
            lines.append(f"  const law_arguments given_{number} = {{.x = {a}, .rows = rows}};")
            lines.append(f"  const double {x} = law(&given_{number});")
            names.append(x)
        else:
            lines += [f"  double {x};", f"  split({a}, &{x});"]
            names.append(x)
        lines.append(f"  found[{number}] = {names[-1]} + 0.125;")
    return lines


HELPERS = """static double trace(const double m[2][2], double x);
static double trace(const double m[2][2], double x)
{
  return m[0][0] + m[1][1] * x;
}

typedef struct {
  double x;
  const double (*rows)[2];
} law_arguments;

static double law(const law_arguments *given)
{
  return given->x * given->rows[1][0];
}

static void split(double x, double *half)
{
  *half = 0.5 * x;
}

"""


def _printed(folder, text: str) -> str:
    source, program = folder / "long.c", folder / "long"
    source.write_text(HEAD + HELPERS + text + MAIN)
    strict = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-ffp-contract=off"]
    subprocess.run(["gcc", *strict, "-O1", source, "-o", program], check=True)
    return subprocess.run([program], check=True, capture_output=True, text=True).stdout


@needs("gcc")
@pytest.mark.parametrize("seed", range(3))
def test_a_function_in_parts_computes_what_it_did(tmp_path, seed):
    lines = _statements(random.Random(seed))
    parameters = {"given": "const double given[3]", "found": "double found[40]"}
    long_one = Text("static void @", parameters, lines, "What is long.")
    whole = "\n".join(lines_of(long_one)).replace("@", "long_one")
    assert sizes(whole)["long_one"].lines > 100
    unit = Unit(False, {}, {})
    assert unit.write(long_one, unit.scope(), lambda: "long_one") == "long_one"
    text = "\n".join(line for function in unit.functions for line in function)
    found = sizes(text)
    assert len(found) > 2
    assert max(one.complexity for one in found.values()) <= 15
    assert max(one.parameters for one in found.values()) <= 10
    assert max(one.lines for one in found.values()) <= 60
    assert _printed(tmp_path, text) == _printed(tmp_path, whole)


def test_a_short_function_stays_as_it_is():
    short = Text("static double @", {"x": "double x"}, ["  return 2.0 * x;"], "Twice.")
    parts = in_parts(short, Names())
    assert parts.functions == (short,)
    assert parts.wishes == {}


def test_the_label_of_a_case_declares_no_variable():
    """Its name looks like one behind a type."""
    assert declared("case CONTROLLER_MODE_STOP: {") == ("", [], "")
    assert declared("return ready;") == ("", [], "")
    assert declared("cases first, second[2];") == ("cases", ["first", "second"], "[2]")
