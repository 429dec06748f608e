"""Numbers as pages show them."""

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
LARGE, SMALL = 1e6, 1e-3
"""Sizes from which, and below which, a number is written with a power of ten."""


def number(value: float, digits: int = 3) -> str:
    """A number to significant digits; whole ones in full, others large or small with a power of ten, 1.2·10⁻⁹."""
    if value != value or value in (float("inf"), float("-inf")):
        return {"inf": "∞", "-inf": "-∞"}.get(str(value), "not a number")
    if isinstance(value, int) and abs(value) < LARGE * 10:
        return f"{value:,}" if abs(value) >= 10000 else str(value)
    mantissa, exponent = f"{value + 0.0:.{digits - 1}e}".split("e")  # + 0.0: -0 becomes 0
    power = int(exponent)
    if value and not SMALL <= abs(value) < LARGE:
        mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
        ten = "10" + str(power).translate(_SUPERSCRIPT)
        return ten if mantissa == "1" else f"{mantissa}·{ten}"
    text = f"{float(mantissa + 'e' + exponent):.{max(0, digits - 1 - power)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def digits3(value: float) -> str:
    """A number to three digits, its zeros too, so that those beside each other are as exact: 85.0, 1.20."""
    return f"{value:#.3g}".removesuffix(".") if SMALL <= abs(value) < 1000 else number(value)


def per_cent(ratio: float, digits: int = 3, sign: bool = False) -> str:
    """A ratio in per cent."""
    return f"{'+' if sign and ratio > 0 else ''}{number(100 * ratio, digits)}\u00a0%"


def changed(ratio: float) -> str:
    """A relative change in words, for sentences: 3.7 % higher, 0.2 % lower, unchanged, higher by a factor of 4.0."""
    if ratio >= 1:
        return f"higher by a factor of {1 + ratio:.1f}"
    size = f"{abs(ratio):.1%}"
    return "unchanged" if size == "0.0%" else f"{size} {'higher' if ratio > 0 else 'lower'}"
