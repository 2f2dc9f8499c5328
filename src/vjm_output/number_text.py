"""Numbers and lists as people write them, on pages and in the terminal."""

from __future__ import annotations

import math

DASH = "\u2013"
"""What stands where there is no value."""


def missing(value: object) -> bool:
    """Whether a value is absent: None or not a finite number."""
    return value is None or (isinstance(value, float) and not math.isfinite(value))


def number(value: object, digits: int = 4) -> str:
    """A number with significant digits as people write it: 8849, 0.1544, 3.0×10⁻¹²; a dash for none.

    Booleans become words, texts and whole numbers stay as they are.
    """
    if missing(value):
        return DASH
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return _real(float(value), digits)
    return str(value).replace("-", "−") if isinstance(value, int) else str(value)


def _real(value: float, digits: int) -> str:
    if value == 0.0:
        return "0"
    # the exponent of the rounded value: 9.9996 has the exponent of 10.00
    exponent = int(f"{value:.{digits - 1}e}".partition("e")[2])
    if -4 <= exponent < 7:
        return f"{value:.{max(0, digits - 1 - exponent)}f}".replace("-", "−")
    mantissa, _, power = f"{value:.{min(digits, 3) - 1}e}".partition("e")
    raised = str(int(power)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{mantissa}×10{raised}".replace("-", "−")


def percent(fraction: float, digits: int = 2) -> str:
    """A fraction as a percentage, without sign: 0.13 %; below 0.001 % said so."""
    return "less than 0.001 %" if abs(fraction) < 1e-5 else f"{number(100.0 * abs(fraction), digits)} %"


def listed(words: list[str]) -> str:
    """Words as a sentence lists them: A, B and C."""
    return " and ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))
