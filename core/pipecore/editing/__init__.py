"""Changing a result by hand: what a person sees better than the detection did.

Each function returns the next result and leaves the given one as it was. What is
changed in shape is fitted and measured anew on the cloud's points, by the same steps as
in a detection; the others keep their ids, names and measures.

>>> from pipecore.editing import merge_elements
>>> result = merge_elements(cloud, result, [3, 5])
"""

from pipecore.editing.accepting import accept_candidate, dismiss_candidates
from pipecore.editing.changes import (
    delete_elements,
    kinds_of,
    name_element,
    name_run,
    set_nominal_size,
)
from pipecore.editing.judging import answer_for_deformation, answer_for_element, judge_again
from pipecore.editing.redetection import detect_again, points_around, points_in_box
from pipecore.editing.reshaping import STAGES, change_kind, merge_elements, split_element

__all__ = [
    "STAGES",
    "accept_candidate",
    "answer_for_deformation",
    "answer_for_element",
    "change_kind",
    "delete_elements",
    "detect_again",
    "dismiss_candidates",
    "judge_again",
    "kinds_of",
    "merge_elements",
    "name_element",
    "name_run",
    "points_around",
    "points_in_box",
    "set_nominal_size",
    "split_element",
]
