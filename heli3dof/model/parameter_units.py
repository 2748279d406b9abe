"""The unit at the end of a parameter's name: ``torque_Nm`` is in N·m, ``sag_per_V`` in 1/V."""

from __future__ import annotations

import re

UNITS = ("Hz", "rad", "deg", "kg", "N", "m", "s", "V", "A", "W")
"""Units in the spelling of parameter names. A parser tries them in this order, so no unit
may begin with an earlier unit of the list."""
_ONE = rf"(?:{'|'.join(UNITS)})(?:[2-9]|[1-9]\d+)?"
NAMED = re.compile(rf"_((?:{_ONE})+(?:_per_(?:{_ONE})+)?|per_(?:{_ONE})+)$")
DIGITS, SUPERSCRIPTS = "0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻"


def split_unit(key: str) -> tuple[str, str]:
    """Split a parameter's name into the quantity and the unit; the unit may be empty.

    >>> split_unit("torque_Nm"), split_unit("drag_Nms2_per_rad2"), split_unit("ratio")
    (('torque', 'N·m'), ('drag', 'N·m·s²/rad²'), ('ratio', ''))
    """
    found = NAMED.search(key)
    if found is None:
        return key, ""
    above, _, below = f"_{found[1]}".partition("_per_")
    unit = _product(above.removeprefix("_")) or "1"
    return key[: found.start()], f"{unit}/{_product(below)}" if below else unit


def _product(units: str) -> str:
    each = re.findall(_ONE, units)
    return "·".join(
        u.replace("deg", "°").translate(str.maketrans(DIGITS, SUPERSCRIPTS)) for u in each
    )


def torque_per(unit: str) -> str:
    """Return the unit of a torque per ``unit``, which may be empty.

    >>> torque_per("V"), torque_per("rad/s"), torque_per("")
    ('N·m/V', 'N·m/(rad/s)', 'N·m')
    """
    is_product = "·" in unit or "/" in unit
    return f"N·m/({unit})" if is_product else f"N·m/{unit}" if unit else "N·m"


def named_unit(unit: str) -> str:
    """Return a unit as it is spelled at the end of parameter names.

    >>> named_unit("N·m·s²/rad²"), named_unit("1/V"), named_unit("°")
    ('Nms2_per_rad2', 'per_V', 'deg')
    """
    plain = unit.replace("°", "deg").replace("–", "")
    above, _, below = re.sub("[·()]", "", plain).partition("/")
    name = f"{above}_per_{below}".removeprefix("1_") if below else above
    return name.translate(str.maketrans(SUPERSCRIPTS, DIGITS))
