"""The script of an export that records conditions and computes their MC/DC."""

import importlib.util
import subprocess
from importlib.resources import files
from itertools import product
from pathlib import Path

import pytest

from helpers.tools import needs


@pytest.fixture(scope="module")
def mcdc():
    """The script as a module."""
    place = str(files("jaxsat.flight") / "assets" / "mcdc.py")
    spec = importlib.util.spec_from_file_location("mcdc", place)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


CODE = """\
#include <stdbool.h>
#define LESS(x) ((x) < 0) /* (a && b) */
static const double table[2] = {1.0, 2.0};
bool law(double x, double y, bool flag);
bool law(double x, double y, bool flag)
{
  /* x < 7 */
  const bool both = flag && !(x < 0.5 ||
                              (y >= -1e-3));
  double z = both ? table[x > 1.0 ? 1 : 0] : -y;
  bool other = (x != x) != flag;
  for (int i = 0; i < 3; i++) {
    z += 1.0;
  }
  if (flag) {
    z = z - 1.0;
  }
  return (x << 1 >> 1) > (y - z) && law_of(x < y, z) ? flag : other;
}
""".replace("x << 1 >> 1", "(double)((int)x << 1 >> 1)").replace("law_of", "fine")


def test_every_decision_and_condition_is_found_with_its_line(mcdc):
    found = [(one.line, one.conditions) for one in mcdc.Instrumented(CODE).decisions]
    assert found == [
        (8, ["flag", "x < 0.5", "y >= -1e-3"]),
        (10, ["both"]),
        (10, ["x > 1.0"]),
        (11, ["x != x", "flag"]),
        (12, ["i < 3"]),
        (15, ["flag"]),
        (18, ["((double)((int)x << 1 >> 1)) > (y - z)", "fine(x < y, z)"]),
        (18, ["x < y"]),
    ]


@pytest.mark.parametrize(
    ("chosen", "expected"),
    [
        # a && (b || c): the four evaluations that the textbook needs, and fewer
        ([(1, 1, 0), (0, 1, 0), (1, 0, 1), (1, 0, 0)], [True, True, True]),
        ([(1, 1, 0), (0, 1, 0), (1, 0, 0)], [True, True, False]),
        ([(1, 1, 0), (1, 0, 0)], [False, True, False]),
        ([(1, 1, 1), (0, 0, 0)], [True, False, False]),  # b and c were not evaluated
        ([], [False, False, False]),
    ],
)
def test_coverage_is_that_of_the_textbook(mcdc, chosen, expected):
    vectors = set()
    for a, b, c in chosen:
        done = 1 | (2 if a else 0) | (4 if a and not b else 0)
        held = (a | b << 1 | c << 2) & done
        vectors.add((done, held, int(a and (b or c))))
    assert mcdc.covered(3, vectors) == expected


@needs("cc")
@pytest.mark.parametrize("masked", [False, True])
def test_instrumented_code_gives_the_same_and_records_all_of_it(mcdc, tmp_path: Path, masked):
    """Over all truth values every condition is covered; over those without some bit, one is not."""
    code = "#include <stdbool.h>\nint f(int a, int b, int c);\nint f(int a, int b, int c)\n{\n"
    code += "  return ((a > 0) && ((b > 0) || (c > 0))) ? 1 : 0;\n}\n"
    cases = [one for one in product((0, 1), repeat=3) if not masked or one[2] == 0]
    calls = "".join(f'  printf("%d ", f({a}, {b}, {c}));\n' for a, b, c in cases)
    (tmp_path / "build").mkdir()
    made = mcdc.Instrumented(code)
    main = f"int main(void)\n{{\n{calls}  return 0;\n}}\n"
    (tmp_path / "x.c").write_text(mcdc.RECORDING % len(made.decisions) + made.text + main)
    subprocess.run(["cc", "-Wall", "-Werror", "x.c", "-o", "x"], cwd=tmp_path, check=True)
    told = subprocess.run(["./x"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    assert told.split() == [str(int(a and (b or c))) for a, b, c in cases]
    lines = mcdc.report(code, (tmp_path / "build/mcdc.txt").read_text()).splitlines()
    assert lines[0] == "Decisions, both outcomes: 100.00% of 2"
    if masked:
        assert lines[1] == "Conditions, independent effect (MC/DC): 66.67% of 3"
        assert lines[3:] == ["line 5: c > 0: always false"]
    else:
        assert lines[1:] == [
            "Conditions, independent effect (MC/DC): 100.00% of 3",
            "Decisions with MC/DC of all conditions: 100.00% of 1",
        ]
