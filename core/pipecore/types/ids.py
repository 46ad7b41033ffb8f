"""Ids of stacks, segments, elements, runs and deformations."""

from bisect import bisect_left
from operator import attrgetter
from typing import TypeVar

NO_ID = 0
"""The id of "none": ids of stacks, segments, elements, runs and deformations start at 1."""

Numbered = TypeVar("Numbered")


def find_by_id(items: tuple[Numbered, ...], name: str, wanted: int) -> Numbered:
    """Find an item by its id among items in the order of their ids."""
    place = bisect_left(items, wanted, key=attrgetter(name))
    if place == len(items) or getattr(items[place], name) != wanted:
        raise KeyError(f"there is no {name} {wanted}")
    return items[place]
