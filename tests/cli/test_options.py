"""Every option of every command: absurd values are one clear message, before anything is done."""

from pathlib import Path
from typing import get_args

import pytest

from jaxsat.cli import options
from jaxsat.cli.app import app

STUDY = ["--set", "simulation.duration_s=5"]
MONTECARLO = ["montecarlo", "acceptance-mc", *STUDY]
WHOLE = [
    "0",
    "-1",
    "1.5",
    "1e20",
    "1e-3",
    "9" * 5000,
    "nan",
    "inf",
    "",
    " ",
    "x",
    "0x10",
    "٣",
    "1_0",
]
CASES = {
    ("montecarlo", "acceptance-mc"): {
        "--digits": WHOLE,
        "-n": WHOLE,
        "--count": WHOLE,
        "--seed": ["-1", "3.7", str(2**64), "1e20", "", "none"],
        "--batch-size": WHOLE,
        "--chunk": WHOLE,
        "--history": [*WHOLE, "1"],
        "--workers": WHOLE,
        "--processes": WHOLE,
        "--devices": WHOLE,
        "--case": ["-1", "0.5", str(2**32), "", "last"],
        "--scheduler": ["", " "],
        "--until-ci": ["", "0", "-1%", "100%", "nan", "1e999", "5 percent", "٣%"],
        "--engine": ["", "Native", "gpu"],
        "--out": ["", "x" * 300, "x/" * 3000],
        "--figures": ["", "x" * 300],
        "--csv": ["", "x" * 300],
        "--controller": ["", "x" * 300],
    },
    ("export", "switching"): {
        "--functions": ["", "fast"],
        "--plan-begin": ["", "-1", "nan", "later"],
        "--out": ["", "x" * 300],
    },
    ("tune", "benchmark-three-axis"): {
        "--digits": WHOLE,
        "--workers": WHOLE,
        "--batch-size": WHOLE,
        "--out": ["", "x" * 300],
        "--engine": ["", "x"],
    },
    ("design", "two-torque-free"): {
        "--digits": WHOLE,
        "--cases": WHOLE,
        "--steps": [one for one in WHOLE if one != "0"],
        "--settled": ["0", "1.5", "-1", "nan", "", "all"],
        "--seed": ["-1", "0.5", ""],
        "--law": ["", " "],
        "--attitude": ["", "x"],
        "--engine": ["", "x"],
        "--workers": WHOLE,
        "--out": ["", "x" * 300],
    },
    ("bound", "two-torque-free"): {
        "--starts": WHOLE,
        "--longest": ["1e-9", "0", "-1", "nan", "inf", "1e300", "", "long"],
        "--seed": ["-1", "0.5", ""],
        "--objective": ["", "fuel"],
        "--end": ["", "near"],
        "--out": ["", "x" * 300],
    },
    ("front", "acceptance-nominal"): {
        "--guesses": WHOLE,
        "--torque-limit": ["0", "-5", "nan", "inf", "1e-300", "1e300", "", "some"],
        "--law": ["", "best"],
        "--out": ["", "x" * 300],
    },
    ("compare", "--seed", "1"): {
        "--digits": WHOLE,
        "--count": WHOLE,
        "--bounds": ["-1", "0.5", "1e9", ""],
        "--workers": WHOLE,
        "--torque-limit": ["0", "-5", "nan", "inf", "1e-300", "1e300", "", "some"],
        "--law": ["", "best"],
        "--level": ["", "easy"],
        "--csv": ["", "x" * 300],
        "--out": ["", "x" * 300],
    },
    ("compare",): {"--seed": ["", "-1", "1.5", str(2**64)]},
    ("controllability", "paper-rate"): {
        "--digits": WHOLE,
        "--tolerance": ["0", "1", "-1", "nan", "inf", "", "small"],
        "--failures": [one for one in WHOLE if one != "0"],
        "--out": ["", "x" * 300],
    },
    ("simulate", "paper-rate"): {"--digits": [*WHOLE, "18"], "--out": ["", "x" * 300]},
    ("reproduce",): {"--digits": WHOLE, "--out": ["", "x" * 300]},
    ("report", "run"): {"--out": ["", "x" * 300]},
}


@pytest.mark.slow
@pytest.mark.parametrize("command", CASES, ids=" ".join)
def test_absurd_values_are_refused_at_once(command_line, tmp_path, command):
    for option, values in CASES[command].items():
        for value in values:
            status, out, err = command_line(*command, f"{option}={value}")
            assert (status, out) == (2, ""), (option, value, err)
            assert option in err, (option, value, err)
            assert len(err) < 300
    assert list(tmp_path.iterdir()) == []


def test_all_options_with_numbers_or_places_are_among_them():
    """An option that is added must be given a range and stand above."""
    for command in CASES:
        tried = {option for key in CASES if key[0] == command[0] for option in CASES[key]}
        for argument in app[command[0]].assemble_argument_collection():
            kinds = {argument.hint, *get_args(argument.hint)}
            if {int, float, Path} & kinds and bool not in kinds:
                assert tried & set(argument.names), (command, argument.names)


@pytest.mark.parametrize(
    ("text", "value"), [("1", 1), ("+7", 7), ("1e6", 10**6), ("2.5e1", 25), ("3.0", 3), ("007", 7)]
)
def test_whole_numbers_may_be_written_in_several_ways(text, value):
    class Token:
        keyword = "-n"

    Token.value = text
    assert options.whole(1, 10**6)(int, (Token,)) == value


@pytest.mark.parametrize(
    "tokens",
    [
        ["-n", "3", "--count", "4"],
        ["--quiet", "--quiet"],
        ["--out", "a", "--out", "b"],
        ["--seed", "1", "--seed", "1"],
    ],
)
def test_options_given_twice_are_refused(command_line, tokens):
    status, _, err = command_line(*MONTECARLO, *tokens)
    assert status == 2
    assert ": must be given once, got it again" in err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tokens", "message"),
    [
        (["--figures", "file.txt"], "file.txt is a file"),
        (["--figures", "file.txt/f"], "file.txt is a file"),
        (["--figures", "s/f", "--out", "s"], "--figures and --out: must be apart"),
        (["--figures", "s", "--out", "./s"], "--figures and --out: must be apart"),
        (["--csv", "s/t.csv", "--out", "s"], "--csv and --out: must be apart"),
        (["--csv", "no/t.csv"], "is not a folder"),
        (["--csv", "file.txt"], "file.txt already exists; give --overwrite"),
        (["--case", "3", "--csv", "t.csv"], "--case: must be given without --csv"),
        (["--overwrite"], "--overwrite: must be given with --case, --csv or --report"),
        (["--case", "3", "--figures", "f"], "--case: must be given without --figures"),
        (["--out", "file.txt", "--engine", "scan"], "file.txt is a file"),
    ],
)
def test_places_are_judged_before_the_study_runs(
    command_line, monkeypatch, tmp_path, tokens, message
):
    monkeypatch.setattr("jaxsat.studies.ensemble.Study.evaluate", None)  # not reached
    (tmp_path / "file.txt").write_text("mine")
    status, _, err = command_line(*MONTECARLO, *tokens)
    assert status == 2
    assert message in err
    assert [entry.name for entry in tmp_path.iterdir()] == ["file.txt"]
    assert (tmp_path / "file.txt").read_text() == "mine"


def test_too_much_work_is_refused_without_yes(command_line, monkeypatch, tmp_path):
    whole = [*MONTECARLO, "--engine", "scan", "-n"]
    status, _, err = command_line(*whole, "1e9")
    assert status == 2
    assert "too much work (1,000,000,000 trajectories" in err
    assert "give --yes" in err
    status, _, err = command_line(*whole, "1e6", "--chunk", "1")
    assert status == 2
    assert "files above 1,000,000 (larger chunks make fewer)" in err
    started = []
    monkeypatch.setattr("jaxsat.cli.montecarlo._run", lambda *_: started.append(1) or 1 / 0)
    assert command_line(*whole, "1e9", "--yes")[0] == 1
    assert command_line(*whole, "1e9", "--until-ci", "20%")[0] == 1
    assert len(started) == 2
    status, _, err = command_line("compare", "--seed", "1", "-n", "1e9")
    assert (status, "too much work" in err) == (2, True)
    assert list(tmp_path.iterdir()) == []
