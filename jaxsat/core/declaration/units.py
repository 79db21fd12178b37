"""Units of keys and signals as text: "rad/s²" to read, "rad s-2" in data sets, "rad_s2" in names.

Data sets follow the CF conventions, where a factor is followed by its exponent.
"""

import re

UNITS = ("rad", "rad/s", "rad/s²", "rad/s/√Hz", "rad/s²/√Hz", "s", "m", "m²", "T", "A m²", "N",
         "N m", "N m s", "N m/√Hz", "N m/s/√Hz", "kg m²", "√kg m")  # fmt: skip
"""Units that the name of a key may tell."""


def with_unit(name: str, unit: str) -> str:
    """Return the key of a quantity: name and unit in SI, "rad_s" for rad/s, none for "1"."""
    plain = unit.replace("²", "2").replace("√", "sqrt_")
    return name if unit == "1" else f"{name}_{re.sub(r'[ /]', '_', plain)}"


_BY_ENDING = {with_unit("", unit): unit for unit in UNITS}

_FACTORS = {"1", "deg", "km", "mN"} | {one for unit in UNITS for one in re.split("[ /√²]", unit)}
"""Factors of units; an ending behind one is part of a longer unit, which `UNITS` does not have."""


def unit_of(name: str) -> str:
    """Return the unit with which the name of a key ends; "1" for none."""
    ending = max(filter(name.endswith, _BY_ENDING), key=len, default="")
    longer = name.removesuffix(ending).rpartition("_")[2] in _FACTORS
    return "1" if longer else _BY_ENDING.get(ending, "1")


def data_unit(unit: str) -> str:
    """Return a unit of `UNITS` as data sets have it: "rad s-2" for rad/s²."""
    above, *below = unit.split("/")
    factors = [(one, "") for one in above.split() if one != "1" or not below]
    return " ".join(_data_factor(*one) for one in [*factors, *((one, "-") for one in below)])


def _data_factor(text: str, sign: str) -> str:
    size = "0.5" if text.startswith("√") else "2" if text.endswith("²") else ""
    return text.strip("√²") + sign + (size or "1" * bool(sign))


_DATA_FACTOR = re.compile(r"([A-Za-z]+)(-?)(0\.5|1|2|)")


def shown_unit(unit: str) -> str:
    """Return a unit of a data set for display: "rad/s²" for rad s-2, none for 1, ° for degree.

    Units of other forms stay as they are.
    """
    if unit in ("1", "degree"):
        return "°" if unit == "degree" else ""
    factors = [_DATA_FACTOR.fullmatch(one) for one in unit.split()]
    above, below = [], ""
    for factor in factors:
        if factor is None:
            return unit
        base, sign, size = factor.groups()
        text = f"{'√' * (size == '0.5')}{base}{'²' * (size == '2')}"
        above += [] if sign else [text]
        below += f"/{text}" if sign else ""
    return (" ".join(above) or "1") + below
