"""The pages that teach: their commands are those of the program, their pictures are there."""

import importlib.util
import re
import shlex
from pathlib import Path

import pytest

from jaxsat.cli.app import app
from jaxsat.scenario import json_schema, library

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
pytestmark = pytest.mark.skipif(not DOCS.is_dir(), reason="no docs beside the package")

COMMAND = re.compile(r"^ {4,7}(jaxsat .+)$", re.MULTILINE)
FIGURE = re.compile(r"`([\w-]+\.png)`")


def tool(name):
    spec = importlib.util.spec_from_file_location(name, DOCS / "tools" / f"{name}.py")
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def commands_of(page):
    return COMMAND.findall((DOCS / page).read_text(encoding="utf-8"))


PAGES = (
    *("quick-start.md", "your-spacecraft.md", "gallery.md", "formats.md", "report.md"),
    "../AGENTS.md",
)


@pytest.mark.parametrize("page", PAGES)
def test_commands_can_be_given_as_they_are_written(page):
    found, files = commands_of(page), []
    assert found
    for command in found:
        words = shlex.split(command)[1:]
        app.parse_args(words, exit_on_error=False, print_error=False)
        if words[0] == "simulate":
            assert words[1] in (*library(), "mine.toml", *files), command
        if words[0] == "design" and "--out" in words:
            files.append(f"{words[words.index('--out') + 1]}/designed.toml")


def test_every_picture_of_the_gallery_stands_below_a_command_that_makes_it():
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    for part in text.split("\n## ")[1:]:
        assert COMMAND.search(part), part
        pictures = re.findall(r"\]\((images/[\w-]+\.png)\)", part)
        assert pictures
        assert all((DOCS / picture).is_file() for picture in pictures)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["two-torque-free", "one-torque-damping"])
def test_a_command_of_the_gallery_writes_the_picture(scenario, command_line, tmp_path):
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    part = next(one for one in text.split("\n## ") if f"simulate {scenario}" in one)
    status, _, _ = command_line(*shlex.split(COMMAND.search(part).group(1))[1:], "--quiet")
    assert status == 0
    for name in FIGURE.findall(part):
        assert (tmp_path / f"jaxsat-{scenario}" / name).is_file()


@pytest.mark.slow
def test_the_quick_start_does_what_it_says(command_line, tmp_path):
    for command in commands_of("quick-start.md"):
        status, _, err = command_line(*shlex.split(command)[1:])
        assert status == 0, (command, err)
    page = (tmp_path / "jaxsat-thruster-dies" / "report.html").read_text(encoding="utf-8")
    told = re.search(r"settled at (\d+) s", (DOCS / "quick-start.md").read_text(encoding="utf-8"))
    found = re.search(r"Settled at ([\d.]+) s", page)
    assert round(float(found.group(1))) == int(told.group(1))
    assert (tmp_path / "both.html").is_file()


SPACECRAFT = "your-spacecraft.md"


def files_of_the_spacecraft(folder):
    """Write the files of the page: the spacecraft, that with wheels, and the designed one.

    Returns the text of the page in one line.
    """
    text = (DOCS / SPACECRAFT).read_text(encoding="utf-8")
    vehicle, designed, requirements, wheels = re.findall(r"```toml\n(.+?)```", text, re.DOTALL)
    (folder / "sixteen.toml").write_text(vehicle, encoding="utf-8")
    (folder / "mine.toml").write_text("\n".join((vehicle, designed, requirements)), "utf-8")
    thrusters = vehicle.partition("[[failure]]")[0]
    (folder / "wheels.toml").write_text(thrusters + wheels, encoding="utf-8")
    return " ".join(re.sub(r"^> ", "", text, flags=re.MULTILINE).replace("\\", "").split())


def test_the_files_of_the_spacecraft_are_valid(command_line, tmp_path):
    files_of_the_spacecraft(tmp_path)
    for file in ("sixteen.toml", "wheels.toml"):
        status, out, _ = command_line("scenarios", "check", file)
        assert (status, out.split(" (")[0]) == (0, f"{file}: valid for controllability and design")
    status, out, err = command_line("scenarios", "check", "mine.toml")
    assert (status, err) == (0, "")


@pytest.mark.slow
def test_the_spacecraft_flies_as_its_page_says(command_line, tmp_path):
    text = files_of_the_spacecraft(tmp_path)
    status, out, _ = command_line("controllability", "sixteen.toml", "--failures", "1")
    assert status == 0
    for begin in ("Survives", "- One thruster stuck on"):
        assert next(one for one in out.splitlines() if one.startswith(begin)).strip("- ") in text
    status, out, err = command_line("simulate", "mine.toml", "--out", "flight")
    assert status == 0, err
    assert re.search(r"Settled at (\d+)", out).group(1) == re.search(r"settles at (\d+) s", text)[1]
    assert (tmp_path / "flight" / "failure.png").is_file()


def test_notebooks_have_the_outputs_of_their_code():
    notebooks = tool("notebooks")
    found = [
        one for path in sorted(notebooks.FOLDER.glob("*.ipynb")) for one in notebooks.problems(path)
    ]
    assert found == []


def test_the_page_of_keys_has_every_table_and_key_of_the_schema():
    schema = json_schema()
    page = tool("scenario_keys").page(schema)
    for definition in schema["$defs"].values():
        for key, entry in definition.get("properties", {}).items():
            assert (f"| `{key}` |" in page) == ("in_place_of" not in entry)
    for heading in ("[orbit]", "[[thruster]]", "[simulation.solver]", '[control] law = "rate"'):
        assert f"## `{heading}`" in page
    assert "| `altitude_km` | km | number, > 0, ≤ 1.5e+06 | none |" in page
    assert "| `omega_rad_s` | rad/s | list of 3: number | required |" in page
