"""The control laws that a scenario can name: jaxsat's own and others."""

from typing import Any

from jaxsat.core.declaration.laws import LAWS, Law
from jaxsat.scenario.plugins import LAW, PluginError, find_class, installed, require_constants


def law_names() -> tuple[str, ...]:
    """The laws that have a name of their own; no other takes one of jaxsat's."""
    return (*LAWS, *sorted(set(installed(LAW)) - set(LAWS)))


def is_plugin(name: str) -> bool:
    """Whether this is the name of a law that does not come with jaxsat."""
    return name not in LAWS and (":" in name or name in installed(LAW))


def find_law(name: str) -> Law:
    """The law that a scenario names.

    Raises `PluginError` for one that does not come with jaxsat and cannot be used, and `KeyError`
    for a name that there is not.
    """
    if name in LAWS:
        return LAWS[name]
    if not is_plugin(name):
        raise KeyError(name)
    controller, place = find_class(LAW, name)
    law = Law(name, controller.declaration, place)
    _require_true(law)
    require_constants(LAW, law)
    return law


def known_law(name: Any) -> Law | None:
    """The law of that name; None where there is none that can be used."""
    try:
        return find_law(name) if isinstance(name, str) else None
    except (KeyError, PluginError):
        return None


def _require_true(law: Law) -> None:
    """Raise `PluginError` where a class is not what it declares."""
    from jaxsat.control import AbstractBacksteppingLaw, AbstractSampledController

    sampled = issubclass(law.controller, AbstractSampledController)
    if sampled and not law.declaration.sampled:
        raise PluginError(
            LAW, f"must name a sampled law that declares the key period_s, got {law.name} without"
        )
    if law.declaration.sampled and not sampled:
        raise PluginError(
            LAW,
            "must name a law that declares the key period_s only if it is a subclass of "
            f"AbstractSampledController, got {law.name} with it",
        )
    tracks = issubclass(law.controller, AbstractBacksteppingLaw)
    if law.declaration.tracks_rates and not tracks:
        raise PluginError(
            LAW,
            "must name a law that declares tracks_rates only if it is a subclass of "
            f"AbstractBacksteppingLaw, got {law.name} with it",
        )
