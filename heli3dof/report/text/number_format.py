"""Format numbers for tables and sentences: with a true minus sign, undefined ones as a dash."""

from __future__ import annotations

import math

import numpy as np

NONE = "–"
"""Text in place of an undefined number: an en dash"""
MINUS = "−"


def fixed(value: float | None, digits: int = 2, unit: str = "", *, sign: bool = False) -> str:
    """Format a number with ``digits`` decimals, a true minus sign, and a dash for NaN or None.

    >>> fixed(-0.001, sign=True), fixed(-1.5, 1, "°"), fixed(2.0, 1, sign=True), fixed(np.nan)
    ('0.00', '−1.5°', '+2.0', '–')
    """
    if value is None or not np.isfinite(value):
        return NONE
    rounded = round(value, digits) + 0.0
    text = f"{rounded:{'+' if sign and rounded else ''}.{digits}f}"
    return text.replace("-", MINUS) + unit


def significant(value: float | None, std: float | None = None) -> str:
    """Format a value so that two digits of its standard deviation ``std`` show.

    Without ``std``, four significant digits show. A missing value is a dash.

    >>> significant(0.030123, 0.00042), significant(1234.5, 20.0), significant(None)
    ('0.03012', '1234', '–')
    """
    if value is None or not math.isfinite(value):
        return NONE
    if std is None or not math.isfinite(std) or std <= 0:
        return f"{value:.4g}".replace("-", "−")
    digits = max(0, 1 - math.floor(math.log10(std)))
    return fixed(value, digits)


def short(value: float, unit: str = "") -> str:
    """Format a number and its unit for a sentence: one decimal, without a trailing zero.

    >>> short(10.04, "°"), short(-27.5)
    ('10°', '−27.5')
    """
    text = fixed(value, 1)
    return text if text == NONE else text.removesuffix(".0") + unit
