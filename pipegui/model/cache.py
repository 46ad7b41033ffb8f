"""Answers that are kept as long as the cloud or the result they were drawn from. Qt-free."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar, cast
from weakref import WeakKeyDictionary

Owner = TypeVar("Owner")
Others = ParamSpec("Others")
Answer = TypeVar("Answer")

_answers: WeakKeyDictionary[Any, dict[str, OrderedDict[Hashable, Any]]] = WeakKeyDictionary()
"""By owner and function. An entry goes when its owner does: with the document that held it."""


def cached_with_owner(
    maxsize: int,
) -> Callable[
    [Callable[Concatenate[Owner, Others], Answer]], Callable[Concatenate[Owner, Others], Answer]
]:
    """Keep the last answers of a function for as long as its first argument is in use.

    Unlike `functools.lru_cache` this keeps no closed cloud alive: what it holds of an owner
    goes with the owner. An answer must not hold the owner itself.

    Parameters
    ----------
    maxsize : int
        Number of answers kept for one owner.
    """

    def decorate(
        function: Callable[Concatenate[Owner, Others], Answer],
    ) -> Callable[Concatenate[Owner, Others], Answer]:
        name = f"{function.__module__}.{function.__qualname__}"

        @wraps(function)
        def answer(owner: Owner, *args: Others.args, **kwargs: Others.kwargs) -> Answer:
            kept = _answers.setdefault(owner, {}).setdefault(name, OrderedDict())
            key = (args, tuple(sorted(kwargs.items())))
            if key not in kept:
                kept[key] = function(owner, *args, **kwargs)
            kept.move_to_end(key)
            if len(kept) > maxsize:
                kept.popitem(last=False)
            return cast("Answer", kept[key])

        return cast("Callable[Concatenate[Owner, Others], Answer]", answer)

    return decorate
