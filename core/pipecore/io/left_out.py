"""Why points are left out, and the notes that count them."""

from collections.abc import Mapping

from pipecore.notes import Note

WITHHELD, NOISE, NO_RETURN, NO_NUMBER, ABSURD, SATURATED, STRAY, ZERO = (
    *("withheld", "noise", "no return", "no number", "absurd", "saturated", "stray", "zero"),
)
_TEMPLATES = {
    WITHHELD: Note("Left out of “{name}”: {n:,} of its points, which it marks as withheld."),
    NOISE: Note("Left out of “{name}”: {n:,} of its points, which it classes as noise."),
    NO_RETURN: Note("Left out of “{name}”: {n:,} of its directions, without a return."),
    NO_NUMBER: Note("Left out of “{name}”: {n:,} of its points, whose coordinates are no numbers."),
    ABSURD: Note(
        "Left out of “{name}”: {n:,} of its points, whose coordinates are beyond any map."
    ),
    SATURATED: Note(
        "Left out of “{name}”: {n:,} of its points, at the end of the range that it can store."
    ),
    STRAY: Note("Left out of “{name}”: {n:,} of its points, stray and far away from all others."),
    ZERO: Note(
        "Left out of “{name}”: {n:,} of its points, at 0, 0, 0, which stands for no measurement."
    ),
}


def left_out_notes(name: str, counts: Mapping[str, int]) -> tuple[Note, ...]:
    """Return a note for each reason for which points of a file were left out.

    Parameters
    ----------
    name : str
        The file's.
    counts : mapping of str to int
        How many, by the reasons of this module.
    """
    return tuple(
        Note(_TEMPLATES[reason].template, name=name, n=counts[reason])
        for reason in _TEMPLATES
        if counts.get(reason)
    )
