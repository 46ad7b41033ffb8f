"""What a person says of a text file: its columns, separator, decimal sign, and lines to skip."""

import re
from dataclasses import dataclass, replace
from enum import StrEnum

from pipecore.errors import ReadError
from pipecore.io.columns import parse_columns
from pipecore.io.table import Dialect, has_decimal_commas, sniff_dialect


class Separator(StrEnum):
    """What separates the columns of a text file."""

    AUTO = "auto"
    BLANK = "blank"
    TAB = "tab"
    COMMA = "comma"
    SEMICOLON = "semicolon"

    @property
    def delimiter(self) -> str | None:
        """The character; None for white space of any length."""
        return {"tab": "\t", "comma": ",", "semicolon": ";"}.get(self.value)


class DecimalSign(StrEnum):
    """What stands between whole numbers and decimals."""

    AUTO = "auto"
    POINT = "point"
    COMMA = "comma"


@dataclass(frozen=True)
class TextFormat:
    """How a text file is to be read, as far as a person says it.

    Written as “x,y,z,-,intensity|separator=semicolon|decimal=comma|skip=3”, each part of
    which may be left out.

    Parameters
    ----------
    columns : tuple of str
        Name of each column, "-" for one to be skipped; () to find it out.
    separator : Separator
    decimal : DecimalSign
    skip : int
        Lines at the top that are passed over unread.
    """

    columns: tuple[str, ...] = ()
    separator: Separator = Separator.AUTO
    decimal: DecimalSign = DecimalSign.AUTO
    skip: int = 0

    @classmethod
    def parse(cls, text: str) -> "TextFormat":
        """Return the format that a text describes.

        Parameters
        ----------
        text : str

        Returns
        -------
        TextFormat

        Raises
        ------
        ReadError
            If it is none.
        """
        names, *options = (part.strip() for part in text.split("|"))
        parsed = cls(parse_columns(names) if names else ())
        for option in options:
            name, _, value = (part.strip() for part in option.partition("="))
            try:
                match name:
                    case "separator":
                        parsed = replace(parsed, separator=Separator(value))
                    case "decimal":
                        parsed = replace(parsed, decimal=DecimalSign(value))
                    case "skip" if re.fullmatch(r"\d{1,6}", value):
                        parsed = replace(parsed, skip=int(value))
                    case _:
                        raise ValueError
            except ValueError:
                raise ReadError(
                    "“{option}” says nothing of columns: separator=auto|blank|tab|comma|semicolon, "
                    "decimal=auto|point|comma and skip=3 do.",
                    option=option,
                ) from None
        return parsed

    def __str__(self) -> str:
        """Return the text that describes it, "" if it says nothing."""
        parts = [",".join(self.columns)]
        if self.separator is not Separator.AUTO:
            parts.append(f"separator={self.separator}")
        if self.decimal is not DecimalSign.AUTO:
            parts.append(f"decimal={self.decimal}")
        if self.skip:
            parts.append(f"skip={self.skip}")
        return "|".join(parts)

    def dialect(self, line: str) -> Dialect:
        """Return how the values of a line of data are separated.

        Parameters
        ----------
        line : str

        Returns
        -------
        Dialect
        """
        found = sniff_dialect(line)
        if self.separator is not Separator.AUTO:
            found = _separated_by(self.separator, line)
        match self.decimal:
            case DecimalSign.COMMA if found.delimiter == "," and '"' not in line:
                # Commas cannot be both: what is left to separate values is white space.
                return Dialect(None, has_decimal_commas=True)
            case DecimalSign.COMMA:
                return replace(found, has_decimal_commas=True)
            case DecimalSign.POINT if self.separator is Separator.AUTO and found.is_ambiguous:
                return Dialect(",", closes_lines=line.rstrip().endswith(","))
            case DecimalSign.POINT:
                return replace(found, has_decimal_commas=False)
        return found


def _separated_by(separator: Separator, line: str) -> Dialect:
    delimiter = separator.delimiter
    values = Dialect(delimiter).split(line)
    is_decimal = has_decimal_commas(values) and (delimiter != "," or '"' in line)
    closes = delimiter is not None and line.rstrip(" \r\n").endswith(delimiter)
    return Dialect(delimiter, has_decimal_commas=is_decimal, closes_lines=closes)
