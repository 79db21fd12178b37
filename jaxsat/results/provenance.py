"""What made a result: versions, machine and time."""

import datetime
import importlib.metadata
import platform
from typing import Any

import jaxsat

PACKAGES = ("jax", "jaxlib", "diffrax", "equinox", "numpy")


def provenance() -> dict[str, Any]:
    """Versions of jaxsat and what it computes with, the platform, and the time (UTC, ISO 8601)."""
    versions = {"jaxsat": jaxsat.__version__, "python": platform.python_version()}
    versions |= {name: importlib.metadata.version(name) for name in PACKAGES}
    return {
        "versions": versions,
        "platform": platform.platform(),
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }


def provenance_attributes() -> dict[str, str]:
    """The same as flat text attributes of a dataset, in the words of the CF conventions."""
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
