"""What a prompt and a notebook show of a thing."""

from collections.abc import Iterable, Iterator, Sequence
from html import escape


def html_table(rows: Iterable[Sequence[str]], header: Sequence[str] = (), caption: str = "") -> str:
    """Return rows of text as an HTML table; a header and a caption stand where given.

    Parameters
    ----------
    rows : iterable of sequences of str
        Escaped here.
    header : sequence of str, optional
    caption : str, optional

    Returns
    -------
    str
    """
    return "".join(_html_parts(rows, header, caption))


def _html_parts(
    rows: Iterable[Sequence[str]], header: Sequence[str], caption: str
) -> Iterator[str]:
    yield "<table>"
    if caption:
        yield f"<caption>{escape(caption)}</caption>"
    if header:
        yield "<tr>" + "".join(f"<th>{escape(name)}</th>" for name in header) + "</tr>"
    for row in rows:
        yield "<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>"
    yield "</table>"


class Summarised:
    """Gives a class a short text for the prompt, and the same as a table for a notebook."""

    def _title(self) -> str:
        """What it is, such as "Pipe 3"."""
        raise NotImplementedError

    def _facts(self) -> dict[str, str]:
        """What is to be known of it first: values as text, by name."""
        raise NotImplementedError

    def __repr__(self) -> str:
        facts = ", ".join(f"{name} {text}" for name, text in self._facts().items())
        return f"<{self._title()}: {facts}>"

    def _repr_html_(self) -> str:
        return html_table(self._facts().items(), caption=self._title())
