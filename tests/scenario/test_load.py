"""Files that are no TOML, not there, empty, or written by another system."""

import pytest

from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.load import load
from scenario.mistakes import THREE_AXIS, problems_of

SYNTAX = [
    (b'title = "a\n[spacecraft]\n', 1, "must be valid TOML"),
    (b'title = "a"\n\n[spacecraft\n', 3, "must be valid TOML"),
    (b"title = 'a'\ntitle = 'b'\n", 2, "must be valid TOML"),
    (b"title = 'a'\nx = [1,\n2,\n", 3, "must be valid TOML"),
    (b"title = 'a'\n# caf\xe9\n", 2, "must be UTF-8 text, got byte 0xe9"),
    ("title = 'a'\n".encode("utf-16"), 1, "must be UTF-8 text"),
    (b"a = " + b"[" * 100_000, 1, "brackets at most 16 deep"),
    (b"a = 1\n\x00", 2, "must be valid TOML"),
]


@pytest.mark.parametrize(("content", "line", "message"), SYNTAX)
def test_not_toml(content, line, message, tmp_path):
    path = tmp_path / "broken.toml"
    path.write_bytes(content)
    with pytest.raises(ScenarioError) as caught:
        load(path)
    (problem,) = caught.value.problems
    assert (problem.line, problem.key) == (line, None)
    assert message in problem.message


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("paper-rats", "no such file, and no scenario of jaxsat, did you mean paper-rate?"),
        ("nothing-like-it", "no such file, and no scenario of jaxsat (`jaxsat scenarios list`"),
        ("missing.toml", "no such file"),
        ("paper-rate.toml", "(jaxsat has a scenario paper-rate)"),
        (".", "got a folder"),
        ("nul\0byte.toml", "no such file"),
    ],
)
def test_no_such_scenario(name, message):
    with pytest.raises(ScenarioError) as caught:
        load(name)
    (problem,) = caught.value.problems
    assert message in str(problem)


def test_empty_file_misses_every_required_table(tmp_path):
    found = problems_of("", tmp_path)
    keys = ["title", "spacecraft", "orbit", "initial", "control", "simulation"]
    assert [(p.line, p.key) for p in found] == [(1, key) for key in keys]


def test_windows_line_ends_and_byte_order_mark(tmp_path):
    path = tmp_path / "windows.toml"
    text = THREE_AXIS.replace("k3 = 0.05", "k3 = -1").replace("\n", "\r\n")
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    with pytest.raises(ScenarioError, match=r"windows\.toml:21: key control\.k3"):
        load(path)
