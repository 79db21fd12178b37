"""Spacecraft files of 42, the simulator (github.com/ericstoneking/42), as scenarios.

Values are identified by the comment after "!" in each line of such a file, because files of several
versions of 42 differ in the order of their lines.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from jaxsat.core.errors import JaxsatError
from jaxsat.scenario.toml_text import toml_document, toml_value

AXES = str.maketrans("123", "xyz")

SENSORS = ("Gyro", "Magnetometer", "Coarse Sun Sensor", "Fine Sun Sensor", "Star Tracker", "GPS")
"""Sections of which only the number of devices is reported."""


class SpacecraftFileError(JaxsatError, ValueError):
    """A file that does not describe one rigid spacecraft for 42."""


class Converted(NamedTuple):
    """A scenario file, and the properties of the spacecraft that it omits."""

    text: str
    left_out: list[str]


class _Line(NamedTuple):
    number: int
    words: list[str]
    comment: str


@dataclass(frozen=True)
class _Section:
    """Lines of a device, a body or a section."""

    name: str
    lines: list[_Line]

    def find(self, comment: str) -> _Line | None:
        """Line whose comment matches."""
        matches = (line for line in self.lines if re.match(comment, line.comment, re.IGNORECASE))
        return next(matches, None)

    def words(self, comment: str) -> list[str]:
        """Words of that line; raises `SpacecraftFileError` if there is no such line."""
        line = self.find(comment)
        if line is None or not line.words:
            raise SpacecraftFileError(f'must have a line "! {comment}" in {self.name}, got none')
        return line.words

    def numbers(self, comment: str, count: int) -> list[float]:
        """Numbers of that line; raises `SpacecraftFileError` if there are fewer."""
        words = self.words(comment)
        try:
            numbers = [float(word) for word in words[:count]]
        except ValueError:
            numbers = []
        if len(numbers) < count:
            line = self.find(comment)
            assert line is not None
            what = f"{count} numbers" if count > 1 else "a number"
            got = " ".join(words)
            raise SpacecraftFileError(f"line {line.number}: must have {what}, got {got}")
        return numbers


def scenario_of_42(text: str, read_beside: Callable[[str], str]) -> Converted:
    """Convert the vehicle of a file SC_....txt: inertia, wheels, magnetorquers, thrusters.

    `read_beside` returns the text of another file by its name, here of the nodes at which thrusters
    are. Raises `SpacecraftFileError` for an unreadable text, and for several bodies.
    """
    sections = _sections(text)
    general, bodies = sections["42"], _devices(sections, "Body Parameters")
    if len(bodies) != 1:
        raise SpacecraftFileError(f"must describe one rigid body, got {len(bodies)} with joints")
    (body,) = bodies
    tables: dict[str, Any] = {
        "title": " ".join(general.words("Description")),
        "spacecraft": {"inertia_kg_m2": _inertia(body, sections["Dynamics Flags"])},
    }
    centre = body.numbers("Location of mass center", 3)
    thrusters = _devices(sections, "Thruster Parameters")
    if any(centre) and thrusters:
        tables["spacecraft"]["centre_of_mass_m"] = centre
    nodes = _nodes(body, read_beside) if thrusters else []
    devices = {
        "wheel": [_wheel(one) for one in _devices(sections, "Wheel Parameters")],
        "magnetorquer": [_magnetorquer(one) for one in _devices(sections, "MTB Parameters")],
        "thruster": [_thruster(one, nodes, centre) for one in thrusters],
    }
    tables |= {name: entries for name, entries in devices.items() if entries}
    modes = [one.words("Mode")[0] for one in thrusters if one.find("Mode")]
    if modes and set(modes) == {"PROPORTIONAL"}:
        tables["modulation"] = {"kind": "ideal"}
    left_out = list(_left_out(sections, body))
    comments = "".join(f"# Not in this file: {line}\n" for line in left_out)
    return Converted(comments + toml_document(tables), left_out)


def _sections(text: str) -> dict[str, _Section]:
    """Sections of the file by heading, each with the headings of its devices in it."""
    sections = {"42": _Section("the first lines", [])}
    current = sections["42"]
    if "42: Spacecraft Description File" not in text.partition("\n")[0]:
        raise SpacecraftFileError('must begin with "42: Spacecraft Description File"')
    for number, line in enumerate(text.splitlines()[1:], 2):
        heading = re.fullmatch(r"\*+\s*([^*]*?)\s*\**", line.strip())
        if heading and heading[1]:
            current = sections[heading[1]] = _Section(heading[1], [])
        elif not heading:
            values, _, comment = line.partition("!")
            current.lines.append(_Line(number, values.split(), comment.strip()))
    missing = {"Body Parameters", "Dynamics Flags"} - sections.keys()
    if missing:
        raise SpacecraftFileError(f"must have a section {min(missing)}, got none")
    return sections


def _devices(sections: dict[str, _Section], name: str) -> list[_Section]:
    section = sections.get(name)
    if section is None:
        return []
    count = int(section.numbers("Number of", 1)[0])
    devices: list[_Section] = []
    for line in section.lines:
        if line.words and line.words[0].startswith("==="):
            devices.append(_Section(" ".join(line.words[1:-1]), []))
        elif devices:
            devices[-1].lines.append(line)
    if len(devices) < count:
        raise SpacecraftFileError(f"must have {count} parts in {name}, got {len(devices)}")
    return devices[:count]


def _inertia(body: _Section, flags: _Section) -> list[float] | list[list[float]]:
    """Inertia about the centre of mass; products have the sign convention of 42."""
    inertia = np.diag(body.numbers("Moments of Inertia", 3))
    xy, xz, yz = body.numbers("Products of Inertia", 3)
    inertia -= np.array([[0, xy, xz], [xy, 0, yz], [xz, yz, 0]])
    if flags.words("Mass Props referenced to")[0] == "REFPT_JOINT":
        mass, centre = body.numbers("Mass$", 1)[0], np.array(body.numbers("Location of mass", 3))
        inertia -= mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    if not np.any(inertia - np.diag(np.diag(inertia))):
        return np.diag(inertia).tolist()
    return inertia.tolist()


def _wheel(wheel: _Section) -> dict[str, Any]:
    torque, momentum = wheel.numbers("Max Torque", 2)
    return {
        "axis": wheel.numbers("(Body, )?Wheel Axis", 3),
        "torque_limit_N_m": torque,
        "momentum_limit_N_m_s": momentum,
        "momentum_N_m_s": wheel.numbers("Initial Momentum", 1)[0],
    }


def _magnetorquer(rod: _Section) -> dict[str, Any]:
    return {
        "axis": rod.numbers("MTB Axis", 3),
        "dipole_limit_A_m2": rod.numbers("Saturation", 1)[0],
    }


def _thruster(
    thruster: _Section, nodes: Sequence[list[float]], centre: list[float]
) -> dict[str, Any]:
    if thruster.find("Location"):
        position = thruster.numbers("Location", 3)
    else:
        node = int(thruster.numbers("(Flex )?Node", 1)[0])
        if not nodes and node:
            raise SpacecraftFileError(f"must have a node file for node {node} of {thruster.name}")
        if nodes and not 0 <= node < len(nodes):
            rule = f"must have a node from 0 to {len(nodes) - 1} in {thruster.name}"
            raise SpacecraftFileError(f"{rule}, got {node}")
        position = nodes[node] if nodes else centre
    return {
        "position_m": position,
        "direction": thruster.numbers("Thrust Axis", 3),
        "force_N": thruster.numbers("Thrust Force", 1)[0],
    }


def _nodes(body: _Section, read_beside: Callable[[str], str]) -> list[list[float]]:
    """Positions of the nodes of a body; none without a node file."""
    line = body.find("Node File Name")
    if line is None or line.words == ["NONE"]:
        return []
    nodes = re.findall(r'^\s*(\S+)\s+(\S+)\s+(\S+)\s+"', read_beside(line.words[0]), re.MULTILINE)
    try:
        return [[float(word) for word in node] for node in nodes]
    except ValueError:
        raise SpacecraftFileError(f"must have numbers in {line.words[0]}") from None


def _left_out(sections: dict[str, _Section], body: _Section) -> Iterator[str]:
    """Properties for which a scenario has no key, or which need an orbit or a law."""
    yield f"mass {body.words('Mass$')[0]} kg, which only translation needs"
    yield from _start(sections.get("Initial Attitude"))
    momentum = body.numbers("Constant Embedded Momentum", 3)
    if any(momentum):
        yield f"the constant momentum {toml_value(momentum)} N m s of the body"
    dipole = body.find("Constant Embedded Magnetic Dipole")
    if dipole and any(body.numbers("Constant Embedded Magnetic Dipole", 3)):
        values = toml_value(body.numbers("Constant Embedded Magnetic Dipole", 3))
        yield f"[disturbance] residual_dipole_A_m2 = {values}, which needs an [orbit]"
    for what, comment in (("shape", "Geometry"), ("flexible modes", "Flex File")):
        line = body.find(comment)
        if line and line.words != ["NONE"]:
            yield f"the {what} in {' '.join(line.words)}"
    if _devices(sections, "Wheel Parameters"):
        yield "rotor inertia of wheels, which 42 needs for drag and jitter alone, and these"
    if _devices(sections, "MTB Parameters"):
        yield "an [orbit], which magnetorquers need"
    for name in SENSORS:
        devices = _devices(sections, name)
        if devices:
            yield f"{len(devices)} of {name}"


def _start(start: _Section | None) -> Iterator[str]:
    """Initial attitude and rate, as keys of `[initial]` where their frames allow."""
    frames = start.find(".*wrt") if start else None
    if start is None or frames is None or not re.fullmatch("[NL][QA][NLFE]", frames.words[0]):
        return
    rate_frame, form, attitude_frame = frames.words[0]
    if attitude_frame == "L" and form == "A":
        *angles, sequence = start.numbers("Angles", 4)
        names = f"{sequence:.0f}".translate(AXES)
        yield f'[initial] euler_deg = {toml_value(angles)}, euler_sequence = "{names}"'
    elif attitude_frame == "L":
        *vector, scalar = start.numbers("Quaternion", 4)
        yield f"[initial] quaternion = {toml_value([scalar, *vector])}"
    else:
        yield "the attitude at the start, which is not relative to the orbit frame"
    if rate_frame == "N":
        yield f"[initial] omega_deg_s = {toml_value(start.numbers('Ang Vel .deg', 3))}"
    else:
        yield "the rate at the start, which is relative to the orbit frame"
