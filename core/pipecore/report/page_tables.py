"""Tables on the report's page."""

from dataclasses import dataclass


@dataclass(frozen=True)
class PageColumn:
    """A column of a table on the page."""

    title: str
    numeric: bool = True
