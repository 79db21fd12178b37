"""Files beside jaxsat's modules: texts, templates and data."""

import re
import tomllib
from importlib import resources
from typing import Any


def text_of(package: str, name: str) -> str:
    """Return the text of a file in the folder of a package."""
    return (resources.files(package) / name).read_text("utf-8")


def data_of(package: str, name: str) -> dict[str, Any]:
    """Return the content of a TOML file in the folder of a package."""
    return tomllib.loads(text_of(package, name))


def template(package: str, name: str, **values: object) -> str:
    """Return the text of a file with each `@NAME@` in it replaced by the value of that name."""
    return re.sub(r"@([A-Z_]+)@", lambda match: str(values[match[1]]), text_of(package, name))
