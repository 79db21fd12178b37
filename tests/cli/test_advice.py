"""Every option that a message names is one of the command that may print it."""

import ast
import functools
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

import jaxsat
from jaxsat.cli.app import app
from jaxsat.report.results import Flight
from jaxsat.store.labelled import LabelledArrays

COMMANDS = [
    ("simulate",),
    ("montecarlo",),
    ("compare",),
    ("bound",),
    ("front",),
    ("tune",),
    ("verify",),
    ("rare",),
    ("worst",),
    ("controllability",),
    ("design",),
    ("export",),
    ("reproduce",),
    ("report",),
    ("convert",),
    ("scenarios", "list"),
    ("scenarios", "show"),
    ("scenarios", "schema"),
    ("scenarios", "check"),
    ("completion",),
]
PACKAGE = Path(jaxsat.__file__).parent
ROOMS = ("jaxsat.cli", "jaxsat.store")
"""Where messages may name options."""

OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
QUOTED = re.compile(r"(?:`|^(?:    )?)jaxsat (\w+)([^`\n]*)", re.MULTILINE)
"""A whole command, as pages that are written tell it."""

TOLD_OTHERS = "flight"
"""The room that also writes options of compilers."""

FUNCTIONS = ast.FunctionDef | ast.ClassDef


def command_of(chain):
    return functools.reduce(lambda found, name: found[name], chain, app)


@functools.cache
def options_of(chain):
    arguments = command_of(chain).assemble_argument_collection()
    return {name for argument in arguments for name in argument.names} | {"--help", "--version"}


@functools.cache
def parsed(module):
    """A module's functions, classes and constants, and where its names are imported from."""
    place = PACKAGE.parent / module.replace(".", "/")
    origin = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    tree = ast.parse(origin.read_text())
    defined = {node.name: node for node in tree.body if isinstance(node, FUNCTIONS)}
    for node in tree.body:
        if isinstance(node, ast.Assign):
            defined |= {name.id: node.value for name in node.targets if isinstance(name, ast.Name)}
    return defined, imported(tree)


def imported(tree):
    return {
        alias.asname or alias.name: (node.module, alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(ROOMS)
        for alias in node.names
    }


@functools.cache
def referred(module, name):
    """The names that a function refers to, and its texts."""
    tree = parsed(module)[0][name]
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    return names, texts_of(tree)


def reached(module, name, known):
    """What a function refers to in jaxsat, and what that does, to the end."""
    defined, sources = parsed(module)
    if name not in defined:
        return reached(*sources[name], known) if name in sources else known
    if (module, name) not in known:
        known.add((module, name))
        for other in referred(module, name)[0]:
            reached(module, other, known)
    return known


def texts_within_reach(function):
    found = reached(function.__module__, function.__name__, set())
    return [text for one in found for text in referred(*one)[1]]


def texts_of(tree):
    """The texts in some code, but for docstrings; what is formatted into them is left out."""
    found, parts = [], set()
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            constants = [part for part in node.values if isinstance(part, ast.Constant)]
            parts |= set(map(id, constants))
            found.append("".join(part.value for part in constants))
    documented = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    return found + [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        if id(node) not in parts | documented
    ]


def advised(text):
    """The options that a text sends its reader to: not those that it begins with, as a place."""
    place = re.match(r"(--[a-z-]+( (and|or) )?)*", text).end()
    return OPTION.findall(text[place:])


@pytest.mark.parametrize("chain", COMMANDS, ids=" ".join)
def test_options_in_messages_are_those_of_the_command(chain):
    function = command_of(chain).default_command
    texts = texts_within_reach(function)
    wrong = [text for text in texts if not set(advised(text)) <= options_of(chain)]
    assert not wrong


def test_no_other_room_advises_options_but_in_whole_commands():
    for path in PACKAGE.rglob("*.py"):
        room = path.relative_to(PACKAGE).parts[0]
        if room in ("cli", "store") or "--" not in (code := path.read_text()):
            continue
        for text in texts_of(ast.parse(code)):
            assert room == TOLD_OTHERS or not advised(QUOTED.sub("", text))
            for name, options in QUOTED.findall(text):
                words = (name, *options.split())
                chain = next(one for one in COMMANDS if words[: len(one)] == one)
                assert set(OPTION.findall(options)) <= options_of(chain)


def test_all_commands_are_among_them_and_their_messages_are_found():
    names = {name for name in app if not name.startswith("-")}
    assert names == {chain[0] for chain in COMMANDS}
    texts = texts_within_reach(command_of(("simulate",)).default_command)
    assert "--overwrite" in {option for text in texts for option in advised(text)}


@pytest.mark.parametrize("chain", COMMANDS, ids=" ".join)
def test_options_told_for_a_stray_word_are_those_of_the_command(command_line, chain):
    seed = ["--seed", "1"] if chain == ("compare",) else []
    status, _, err = command_line(*chain, "paper-rate", *seed, "stray", "control.k1=1")
    assert status == 2
    assert set(OPTION.findall(err)) <= options_of(chain)


def test_one_case_replaces_its_folder_if_asked(command_line, monkeypatch):
    about = {"scenario": "", "outcome_explanation": "told"}
    found = (Flight(jaxsat.load("paper-rate"), LabelledArrays({}, {}, about)), [])
    monkeypatch.setattr("jaxsat.cli.study_files.replayed", lambda *_: found)
    monkeypatch.setattr("jaxsat.report.figures.trajectory_drawings", lambda _: {})
    study = SimpleNamespace(remark=None)
    monkeypatch.setattr(
        "jaxsat.scenario.build.study.refined_study", lambda scenario, *_, **__: (scenario, study)
    )
    status, _, err = command_line("montecarlo", "paper-rate", "--overwrite")
    assert (status, "--overwrite: must be given with --case" in err) == (2, True)
    case = ["montecarlo", "paper-rate", "--case", "3", "--quiet"]
    assert command_line(*case)[0] == 0
    status, _, err = command_line(*case)
    assert (status, "give --overwrite to replace it" in err) == (2, True)
    assert command_line(*case, "--overwrite")[0] == 0
