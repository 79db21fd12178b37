"""controller_guard.h: protection of a controller from invalid measurements.

The guard is the same for every law. It judges the measurements of a sample, and calls the
controller only with valid ones. All its fields are those of the program's structures. Its actions
without a step are those of `jaxsat.control.sampled.Guard` in simulation.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from jaxsat.compiler.c.expressions import literal
from jaxsat.compiler.c.layout import Field
from jaxsat.compiler.c.naming import comment
from jaxsat.flight.measurements import MAX_MEASUREMENTS
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.templates import template

RATE_LIMIT = 100.0
"""Default of the largest valid rate about an axis, rad/s."""

NORM_TOLERANCE = 1e-3
"""Default tolerance on the square of a unit quaternion's norm."""

EVENTS = {
    "SKIPPED": "sample numbers are missing before this one",
    "REPEATED": "the sample number is not later than the last one",
    "REJECTED": "a command or the next state was not a finite number, and was not used",
    "HELD": "the controller made no step: the commands are those of the last step",
    "ZERO": "the controller made no step: the commands are zero",
}
"""Bits of a status above those of the measurements, and their meanings."""

FIRST_EVENT = MAX_MEASUREMENTS


@dataclass(frozen=True)
class Group:
    """Fields of one measurement, which are valid or invalid together.

    `seen` is the field that tells whether there is a new one, None for what is always measured.
    """

    name: str
    fields: tuple[Field, ...]
    seen: str | None = None

    @property
    def bit(self) -> str:
        """Name of the status bit."""
        return f"CONTROLLER_STATUS_INVALID_{self.name.upper()}"


def groups(program: FlightProgram) -> list[Group]:
    """Return the measurements of an input."""
    fields_of_name: dict[str, list[Field]] = {}
    seen: dict[str, str] = {}
    for field in program.structs["input"].fields:
        name = field.path.split(".")[0]
        if field.path.split(".")[-1] == "seen":
            seen["attitude" if name == "seen" else name] = field.name
        elif name != "sample":
            fields_of_name.setdefault(name, []).append(field)
    return [Group(name, tuple(fields), seen.get(name)) for name, fields in fields_of_name.items()]


def is_quaternion(field: Field) -> bool:
    """Whether a field of an input is a unit quaternion."""
    return field.path in ("attitude", "attitude.q") and field.shape == (4,)


def is_vector(field: Field) -> bool:
    """Whether a field of an input is a vector with a direction: measured, or its reference."""
    return field.path.rpartition(".")[2] in ("measured", "reference")


def is_rate(field: Field) -> bool:
    """Whether a field of an input is an angular velocity."""
    return field.path in ("rate", "omega")


def status_bits(program: FlightProgram) -> dict[str, tuple[int, str]]:
    """Return the names of status bits, with their numbers and meanings."""
    bits = {
        group.bit: (1 << place, f"{group.name} was flagged or found invalid")
        for place, group in enumerate(groups(program))
    }
    events = enumerate(EVENTS.items(), FIRST_EVENT)
    return bits | {f"CONTROLLER_STATUS_{name}": (1 << n, words) for n, (name, words) in events}


def guard_header(program: FlightProgram, intro: Sequence[str]) -> str:
    """Return the text of controller_guard.h."""
    real, bits = real_type(program), status_bits(program).items()
    defines = [[*comment(words), f"#define {name} ({bit}u)"] for name, (bit, words) in bits]
    seen = (
        f"  {real} rate[3]; /* the last valid one (rad/s) */\n"
        f"  {real} attitude[4]; /* the first estimate */\n"
    )
    attitude = comment(
        "attitude is the first estimate (unit quaternion, scalar first, relative to the orbit "
        f"frame). If it is not valid, the controller {_without_estimate(program)}."
    )
    text = template(
        "controller_guard.h",
        STATUS="\n".join(line for lines in defines for line in lines),
        VALIDITY="\n".join(f"  bool {group.name};" for group in groups(program)),
        REAL=real,
        SEEN=seen * program.estimates,
        ATTITUDE="".join(f"{line}\n" for line in attitude) * program.estimates,
        INIT=init_head(program),
        STEP="\n".join(step_head(";")),
    )
    return "\n".join([*intro, text])


def _without_estimate(program: FlightProgram) -> str:
    """Return what a controller does without a valid first estimate of the attitude."""
    if has_tracker(program):
        return "begins with the first valid measurement of the attitude"
    return "does not begin"


def has_tracker(program: FlightProgram) -> bool:
    """Whether attitudes are measured."""
    return any(group.name == "attitude" for group in groups(program))


def first_attitude(program: FlightProgram) -> tuple[str, str]:
    """Return the numbers of a first estimate of the attitude, and what they are.

    Without a star tracker it is the attitude of the scenario's start.
    """
    if has_tracker(program):
        return "{0}", "begin with the first that is measured"
    numbers = ", ".join(literal(x).text for x in program.attitude)
    return f"{{{numbers}}}", "the attitude of the scenario's start"


def real_type(program: FlightProgram) -> str:
    """Return the C type of floats."""
    return "float" if program.single else "double"


def init_head(program: FlightProgram) -> str:
    """Return the signature of the guard's initialisation."""
    attitude = f"const {real_type(program)} attitude[4], " if program.estimates else ""
    return f"void controller_guard_init({attitude}controller_guard *guard)"


def step_head(end: str) -> list[str]:
    """Return the signature of the guard's step, with its `end`."""
    return [
        "uint32_t controller_guard_step(const controller_parameters *p,",
        "                               const controller_guard_parameters *limits,",
        "                               const controller_input *in,",
        "                               const controller_validity *valid,",
        f"                               controller_guard *guard, controller_output *out){end}",
    ]
