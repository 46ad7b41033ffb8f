"""The name of a coordinate reference system, without a library of all of them."""

import re


def name_in_wkt(text: str) -> str:
    """Return the outermost name in a well-known text, or the text if it is a plain name."""
    text = text.strip("\0 \t\r\n")
    match = re.match(r"[A-Za-z_]+\s*[\[(]\s*\"([^\"]*)\"", text)
    if match:
        return match.group(1).strip()
    return text if len(text) <= 80 and text.isprintable() else ""
