"""Tables as plain columns: a dict of arrays of one length, with a way to pandas."""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipecore.display import html_table

if TYPE_CHECKING:
    import pandas as pd

ROWS_SHOWN = 10
"""A table of more rows is cut in a notebook."""


class Table(dict[str, NDArray[Any]]):
    """Columns of one length, by name.

    It is a dict: ``table["radius_mm"]`` is an array. Numbers that could not be measured
    are nan, ids of nothing are 0, texts that do not apply are "".

    Parameters
    ----------
    columns : iterable of (str, ndarray, int or None)
        Name, values of shape (n,), and how many digits after the point they have; None
        where they are whole numbers or text.
    """

    def __init__(self, columns: Iterable[tuple[str, NDArray[Any], int | None]]) -> None:
        triples = list(columns)
        super().__init__((name, values) for name, values, _ in triples)
        self.decimals = {name: digits for name, _, digits in triples if digits is not None}

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self.values()), ()))

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield each row as a dict of its values, by column."""
        for values in zip(*self.values(), strict=True):
            yield dict(zip(self, values, strict=True))

    def to_pandas(self) -> "pd.DataFrame":
        """Return the table as a data frame.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        try:
            import pandas as pd  # noqa: PLC0415 - not needed for anything else
        except ImportError as error:
            raise ImportError(
                "pandas is not installed; install it (pip install pandas), or use the table "
                "as it is, a dict of numpy arrays"
            ) from error
        return pd.DataFrame(dict(self))

    def __repr__(self) -> str:
        return f"<Table: {self.n_rows:,} rows of {', '.join(self)}>"

    def _repr_html_(self) -> str:
        n_shown = min(self.n_rows, ROWS_SHOWN)
        columns = [values[:n_shown].tolist() for values in self.values()]
        rows = [
            [self._text(name, value) for name, value in zip(self, row, strict=True)]
            for row in zip(*columns, strict=True)
        ]
        more = f"{n_shown} of {self.n_rows:,} rows" if n_shown < self.n_rows else ""
        return html_table(rows, list(self), more)

    def _text(self, name: str, value: Any) -> str:
        if name not in self.decimals:
            return str(value)
        return f"{value:.{self.decimals[name]}f}" if np.isfinite(value) else ""
