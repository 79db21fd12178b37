"""The flags of every command, and how long its function is."""

import ast
import inspect
from pathlib import Path

import pytest

import jaxsat
from jaxsat.cli.app import app

FLAGS = {
    "simulate": "--set --out --report --overwrite --digits --quiet",
    "montecarlo": (
        "--count -n --seed --out --set --engine --workers --batch-size --chunk --until-ci --case "
        "--overwrite --processes --scheduler --devices --figures --csv --report --history --yes "
        "--elsewhere --controller --digits --quiet"
    ),
    "compare": (
        "--set --level --torque-limit --law --count -n --seed --out --engine --workers --bounds "
        "--end --csv --report --overwrite --yes --elsewhere --digits --quiet"
    ),
    "bound": "--objective --target --end --starts --longest --seed --set --out --overwrite --quiet",
    "front": "--law --torque-limit --guesses --end --set --out --overwrite --quiet",
    "tune": (
        "--out --set --engine --workers --batch-size --baselines --report --overwrite --yes "
        "--elsewhere --digits --quiet"
    ),
    "design": (
        "--out --set --law --settled --cases --steps --seed --attitude --goal --engine --workers "
        "--report --overwrite --yes --elsewhere --digits --quiet"
    ),
    "verify": (
        "--set --fraction --confidence --cases --no-failures --pairs --out --engine --workers "
        "--report --overwrite --yes --elsewhere --digits --quiet"
    ),
    "rare": (
        "--set --requirement --cases --replications --least --confidence --case --out --engine "
        "--workers --report --overwrite --yes --elsewhere --digits --quiet"
    ),
    "worst": (
        "--set --requirement --flights --within --out --engine --workers --report --overwrite "
        "--yes --elsewhere --digits --quiet"
    ),
    "controllability": (
        "--set --out --report --overwrite --digits --quiet --failures --drift --tolerance"
    ),
    "export": "--set --out --float --functions --fmu --plan-begin --overwrite --quiet",
    "reproduce": "--out --report --overwrite --digits --quiet",
    "report": "--out --overwrite --quiet",
    "convert": "--to --out --epoch --frame --object-name --object-id --overwrite --quiet",
    "scenarios list": "--quiet",
    "scenarios show": "--quiet",
    "scenarios schema": "--quiet",
    "scenarios check": "--set --quiet",
    "completion": "--quiet",
}

MOST_LINES, MOST_PARAMETERS = 80, 12


def commands(group, before=""):
    for name in group:
        if name.startswith("-"):
            continue
        command = group[name]
        if command.default_command is None:
            yield from commands(command, f"{before}{name} ")
        else:
            yield f"{before}{name}", command


def described(command):
    return command.assemble_argument_collection(parse_docstring=True)


def test_the_commands_have_these_flags_each_with_a_text():
    found = {}
    for name, command in commands(app):
        options = [one for one in described(command) if one.parse]
        given = [one for one in options if one.names[0].startswith("-")]
        found[name] = {flag for one in given for flag in one.names}
        assert all(one.parameter.help for one in given), name
    assert found == {name: set(flags.split()) for name, flags in FLAGS.items()}


def test_no_command_switches_a_flag_off():
    """A flag is given or not: there is no --no-quiet."""
    for name, command in commands(app):
        for one in command.assemble_argument_collection():
            assert not one.negatives, (name, one.names)


@pytest.mark.parametrize("tokens", [["--quiet"], ["--quiet=true"]])
def test_quiet_commands_print_results_and_nothing_else(command_line, tokens):
    assert command_line("scenarios", "check", "paper-rate", *tokens) == (0, "", "")
    status, out, err = command_line("scenarios", "list", *tokens)
    assert (status, err) == (0, "")
    assert "paper-rate" in out
    status, out, err = command_line("scenarios", "check", "no-such-file", *tokens)
    assert (status, out) == (2, "")
    assert "no-such-file" in err


def functions():
    root = Path(jaxsat.__file__).parent / "cli"
    for path in sorted(root.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                yield f"{path.relative_to(root)}: {node.name}", node


def test_no_command_is_long_or_has_many_parameters():
    for name, node in functions():
        assert node.end_lineno - node.lineno + 1 <= MOST_LINES, name
        own = [one for one in node.args.kwonlyargs if one.arg not in ("results", "output")]
        assert len(node.args.args) + len(own) <= MOST_PARAMETERS, name


@pytest.mark.parametrize(
    "function", ["bound", "compare", "compare_in_scenario", "design", "front", "run_study", "tune"]
)
def test_what_a_command_calls_has_few_parameters(function):
    assert len(inspect.signature(getattr(jaxsat, function)).parameters) <= MOST_PARAMETERS
