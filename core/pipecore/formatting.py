"""How numbers are written: for people with their uncertainty, for machines plainly."""

import math

NOT_MEASURABLE = "not measurable"
THIN_SPACE = "\u2009"
MINUS = "\u2212"


def format_measure(value: float, sd: float = math.nan, unit: str = "", *, decimals: int = 1) -> str:
    """Return a value with its standard deviation, such as "109.52 ± 0.04 mm".

    Parameters
    ----------
    value : float
        In the unit to be shown; nan gives "not measurable".
    sd : float
        Decides the digits: one significant digit, two if the first is a 1. Where it is
        nan the value stands alone.
    unit : str
    decimals : int
        Digits after the point where there is no standard deviation.

    Returns
    -------
    str
    """
    if not math.isfinite(value):
        return NOT_MEASURABLE
    text = _plain(value, decimals)
    if math.isfinite(sd) and sd > 0:
        digits = _decimals_of(sd)
        text = f"{_plain(value, digits)} ± {sd:.{digits}f}"
    return f"{text} {unit}" if unit else text


def _decimals_of(sd: float) -> int:
    mantissa, exponent = f"{sd:.1e}".split("e")
    decimals = -int(exponent)
    if float(mantissa) < 1.95:
        decimals += 1
    return min(max(decimals, 0), 6)


def _plain(value: float, decimals: int) -> str:
    text = f"{value:.{decimals}f}"
    negative = text.startswith("-") and any(c in "123456789" for c in text)
    return (MINUS if negative else "") + text.lstrip("-")


def format_clock(clock: float) -> str:
    """Return a clock angle in radians as h:mm; 0 is 12:00, half an hour later 12:30.

    Parameters
    ----------
    clock : float
        Radians; 0 is 12:00, clockwise looking along the chainage.

    Returns
    -------
    str
        "" for nan.
    """
    if not math.isfinite(clock):
        return ""
    minutes = round(clock / (2 * math.pi) * 720) % 720
    return f"{minutes // 60 or 12}:{minutes % 60:02d}"


def format_coordinate(value: float, decimals: int = 3) -> str:
    """Return a coordinate for people, with thin spaces: "6 201 877.530".

    Parameters
    ----------
    value : float
        In the unit to be shown; nan gives "not measurable".
    decimals : int
        Digits after the point.

    Returns
    -------
    str
    """
    if not math.isfinite(value):
        return NOT_MEASURABLE
    text = f"{abs(value):,.{decimals}f}".replace(",", THIN_SPACE)
    return (MINUS if value < 0 else "") + text


def format_count(number: int, singular: str, plural: str = "") -> str:
    """Return a count with its noun: "1 pipe", "23 pipes".

    Parameters
    ----------
    number : int
    singular : str
    plural : str, optional
        By default the singular with an s.

    Returns
    -------
    str
    """
    return f"{number:,} {singular if number == 1 else plural or singular + 's'}"


def cell(value: float, decimals: int) -> str:
    """Return a number for a machine: plain decimals, "" for what is not measurable.

    Parameters
    ----------
    value : float
    decimals : int
        Digits after the point.

    Returns
    -------
    str
    """
    if not math.isfinite(value):
        return ""
    text = f"{value:.{decimals}f}"
    return text if any(c in "123456789" for c in text) else text.lstrip("-")


def text_cell(text: str) -> str:
    """Return text that no spreadsheet takes for a formula.

    Parameters
    ----------
    text : str

    Returns
    -------
    str
        With a quote before it if it would be a formula.
    """
    return f"'{text}" if text[:1] in tuple("=+-@\t\r") else text
