"""Files and options that are far too large, or hold what no terminal should see."""

import os
import time
import tracemalloc

import pytest

from jaxsat.scenario import ScenarioError, library
from jaxsat.scenario.build.load import load
from jaxsat.scenario.errors import MAX_LISTED, MAX_MESSAGE_LENGTH, MAX_PLACE_LENGTH
from jaxsat.scenario.limits import MAX_FILE_SIZE, Excess, require_modest

MAX_LINE_LENGTH = 2 * MAX_PLACE_LENGTH + MAX_MESSAGE_LENGTH + 50

HUGE = {
    "parts": "a." * 20_000 + "a = 1\n",
    "quoted parts": '"a".' * 5_000 + "a = 1\n",
    "heading": "[" + "a . " * 20_000 + "a]\n",
    "entries": "[spacecraft]\nfailed_thrusters = [" + "1, " * 300_000 + "1]\n",
    "rows": "x = [" + "[1],\n" * 150_000 + "]\n",
    "brackets": "x = " + "[" * 400_000,
    "tables": "x = " + "{a = " * 100_000,
    "digits": "x = " + "1" * 5_000,
    "hexadecimal": "x = 0x" + "f" * 900_000,
    "word": "a" * 900_000 + " = 1",
    "keys": "".join(f"k{i} = 1\n" for i in range(70_000)),
    "headings": "".join(f"[t{i}]\n" for i in range(80_000)),
    "array of tables": "[[a]]\n" * 150_000,
    "escapes": 'x = """' + '\\"""' * 200_000,
    "quotes": "x = " + '"' * 900_000,
    "text": 'title = "' + "a" * 900_000 + '"',
    "too large": "#" * (MAX_FILE_SIZE + 1),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", HUGE)
def test_what_is_huge_is_refused_at_once(name, tmp_path):
    path = tmp_path / "huge.toml"
    path.write_text(HUGE[name], encoding="utf-8")
    tracemalloc.start()
    begin = time.process_time()
    with pytest.raises(ScenarioError) as caught:
        load(path)
    seconds, (_, peak) = time.process_time() - begin, tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert seconds < 20  # under tracemalloc; minutes before
    assert peak < 100e6
    assert str(caught.value).startswith(str(path))
    assert all(len(line) < MAX_LINE_LENGTH for line in str(caught.value).split("\n"))


@pytest.mark.parametrize("name", ["parts", "entries", "brackets", "digits", "word", "keys"])
def test_the_line_of_an_excess_is_told(name):
    with pytest.raises(Excess) as caught:
        require_modest("# one\n'''two\nthree'''\n" + HUGE[name])
    assert caught.value.line >= 4


def test_the_library_is_modest():
    for file in library().values():
        require_modest(file.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "text",
    ['x = ""\n', "x = ''\n", 'x = """a"b""c"""""\n', "x = '''it''s'''\n", 'x = "[[[\\" # . ="\n']
)  # fmt: skip
def test_what_stands_in_texts_is_not_counted(text):
    require_modest(text * 50)
    with pytest.raises(Excess):  # nor does a text hide what follows it
        require_modest(text + HUGE["parts"])


OVERRIDES = [
    "a." * 20_000 + "a=1",
    "spacecraft.failed_thrusters=[" + "1," * 40_000 + "1]",
    "simulation.seed=" + "1" * 5_000,
    "simulation.seed=0x" + "f" * 90_000,
    "simulation.seed=" + "9" * 99,
    "control.k1=" + "9" * 99,
    "title=" + "[" * 90_000,
    "x=" + "y " * 200_000,
    "title=" + "word " * 1000,
    "title=a\0b",
    "title=\x1b[31mred",
    "title=\udcff",
    "title='a\u202eb'",
    "title='a\ufffeb'",
    'title="two\\nlines"',
    'title="\\u001b[2J"',
    'description="\\u0000"',
    "\udcff=1",
    "\x1b]0;x\x07=1",
    "simulation.duration_s=1979-05-27",
    "",
    "=",
    "\0",
]


@pytest.mark.parametrize("text", OVERRIDES, ids=range(len(OVERRIDES)))
def test_overrides_are_refused_in_one_line_that_is_safe_to_print(text):
    with pytest.raises(ScenarioError) as caught:
        load("paper-rate", [text])
    lines = str(caught.value).split("\n")
    assert all(line.startswith("--set ") or line == "" for line in lines[:1])
    assert all(line.isprintable() and len(line) < MAX_LINE_LENGTH for line in lines)


def test_too_many_overrides_and_too_many_mistakes():
    with pytest.raises(ScenarioError, match="at most 1000 times, got 5000"):
        load("paper-rate", ["simulation.seed=1"] * 5000)
    with pytest.raises(ScenarioError) as caught:
        load("paper-rate", [f"k{i}=1" for i in range(200)])
    assert len(caught.value.problems) == 200
    lines = str(caught.value).split("\n")
    assert len(lines) == MAX_LISTED + 1
    assert lines[-1].endswith("and 180 more mistakes")


def test_titles_may_have_any_letters():
    scenario = load("paper-rate", ["title=Ünïcode – 角運動量 𝛺 №1 (100 %) $x_1$"])
    assert scenario.title.startswith("Ünïcode")


@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to(path), os.mkdir])
def test_what_is_no_file_is_not_waited_for(make, tmp_path):
    path = tmp_path / "odd.toml"
    make(path)
    with pytest.raises(ScenarioError, match=r"odd\.toml: (must be|no such file)"):
        load(path)


def test_names_that_no_text_can_hold_are_refused(tmp_path):
    path = os.fsdecode(bytes(tmp_path) + b"/bad\xff.toml")
    with open(path, "wb") as file:
        file.write(library()["paper-rate"].read_bytes())
    with pytest.raises(ScenarioError) as caught:
        load(path)
    assert "bad\\xff.toml: must be a name of valid characters" in str(caught.value)
    with pytest.raises(ScenarioError) as caught:
        load("two\nlines\x1b[0m.toml")
    assert str(caught.value).startswith("two\\nlines\\x1b[0m.toml: no such file")
