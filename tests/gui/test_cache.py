"""What the app keeps of clouds and results goes with them."""

import gc
import weakref

from pipegui.model.cache import cached_with_owner


class Cloud:
    """Something that is kept by identity, as clouds and results are."""


def test_that_an_answer_is_found_once_for_each_owner_and_question():
    asked = []

    @cached_with_owner(maxsize=8)
    def answer(owner: Cloud, number: int) -> list[int]:
        asked.append(number)
        return [number]

    first, second = Cloud(), Cloud()
    assert answer(first, 1) is answer(first, 1)
    assert answer(first, 1) is not answer(second, 1)
    assert answer(first, 2) == [2]
    assert asked == [1, 1, 2]


def test_that_only_the_last_answers_of_an_owner_are_kept():
    asked = []

    @cached_with_owner(maxsize=2)
    def answer(owner: Cloud, number: int) -> int:
        asked.append(number)
        return number

    owner = Cloud()
    for number in (1, 2, 1, 3, 1, 2):
        assert answer(owner, number) == number
    assert asked == [1, 2, 3, 2]


def test_that_what_is_kept_goes_with_its_owner():
    @cached_with_owner(maxsize=2)
    def answer(owner: Cloud, number: int) -> Cloud:
        return Cloud()

    owner = Cloud()
    kept = weakref.ref(answer(owner, 1))
    assert kept() is not None
    del owner
    gc.collect()
    assert kept() is None
