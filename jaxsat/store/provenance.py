"""Provenance of a result: versions, machine and time."""

import datetime
import importlib.metadata
import platform
import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jaxsat
from jaxsat.core.once import once
from jaxsat.core.text import clean

PACKAGES = ("jax", "jaxlib", "diffrax", "equinox", "numpy", "scipy")


def command_line() -> str:
    """Return the running program and its arguments, in characters that every file can hold."""
    program = Path(sys.argv[0]).name
    return clean(shlex.join(["jaxsat" if program == "__main__.py" else program, *sys.argv[1:]]))


def provenance() -> dict[str, Any]:
    """Return versions of jaxsat and its libraries, the platform, and the time (UTC, ISO 8601)."""
    return {
        "versions": dict(_versions()),
        "platform": platform.platform(),
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }


def record_of(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the record of a result: the command, its data, and `provenance`."""
    return {"command": command_line(), **data, **provenance()}


@once
def _versions() -> dict[str, str]:
    versions = {"jaxsat": jaxsat.__version__, "python": platform.python_version()}
    return versions | {name: importlib.metadata.version(name) for name in PACKAGES}


def machine() -> dict[str, Any]:
    """Return versions, processor and precision, on which bits of a result depend besides inputs.

    Two runs of one study are guaranteed equal bits only on equal machines in this sense.
    """
    import jax

    return {
        "versions": {k: v for k, v in _versions().items() if k != "python"},
        "processor": _processor(),
        "backend": jax.default_backend(),
        "device": jax.local_devices()[0].device_kind,
        "double_precision": jax.dtypes.canonicalize_dtype(float) == "float64",
    }


@once
def _processor() -> str:
    """Return the processor's name; on Linux its model, which `platform` does not give."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if "model name" in line)
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def provenance_attributes() -> dict[str, str]:
    """Return `provenance` as flat text attributes of a dataset, named by CF conventions."""
    made_by = provenance()
    versions = {f"{name}_version": version for name, version in made_by["versions"].items()}
    return {
        "Conventions": "CF-1.11",
        "source": f"jaxsat {made_by['versions']['jaxsat']}",
        "history": f"{made_by['created']} made by jaxsat",
        "platform": made_by["platform"],
        "created": made_by["created"],
        **versions,
    }
