"""Mistakes in the keys of an outage, of any sensor."""

from collections.abc import Iterator, Mapping

from jaxsat.scenario.wording import shown


def outage_mistakes(
    values: Mapping[str, float | None], prefix: str = ""
) -> Iterator[tuple[str, str, bool]]:
    """Yield name, message, and whether the key is absent, for each mistake.

    Names of keys in `values` begin with `prefix`.
    """
    start, length, every = (f"{prefix}outage{end}" for end in ("_start_s", "_s", "_every_s"))
    for one, other in ((start, length), (length, start)):
        if values[one] is None and values[other] is not None:
            yield one, f"must be given with {other}, got nothing", True
    period, duration = values[every], values[length]
    if period is None:
        return
    if duration is None:
        yield every, f"must be left out without {length}, got {shown(period)}", False
    elif period <= duration:
        message = f"must be above {length} = {shown(duration)}, got {shown(period)}"
        yield every, message, False
