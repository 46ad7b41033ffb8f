"""Values that are cached as long as the cloud or result they were computed from is in use."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar, cast
from weakref import WeakKeyDictionary

Owner = TypeVar("Owner")
Others = ParamSpec("Others")
Value = TypeVar("Value")

_caches: WeakKeyDictionary[Any, dict[str, OrderedDict[Hashable, Any]]] = WeakKeyDictionary()
"""By owner and function. An entry goes when its owner does: with the document that held it."""


def cached_with_owner(
    maxsize: int,
) -> Callable[
    [Callable[Concatenate[Owner, Others], Value]], Callable[Concatenate[Owner, Others], Value]
]:
    """Cache the last values of a function for as long as its first argument is in use.

    Unlike `functools.lru_cache` this keeps no closed cloud alive: the values cached for an
    owner go with the owner. A value must not hold the owner itself.

    Parameters
    ----------
    maxsize : int
        Number of values cached for one owner.
    """

    def decorate(
        function: Callable[Concatenate[Owner, Others], Value],
    ) -> Callable[Concatenate[Owner, Others], Value]:
        name = f"{function.__module__}.{function.__qualname__}"

        @wraps(function)
        def cached(owner: Owner, *args: Others.args, **kwargs: Others.kwargs) -> Value:
            kept = _caches.setdefault(owner, {}).setdefault(name, OrderedDict())
            key = (args, tuple(sorted(kwargs.items())))
            if key not in kept:
                kept[key] = function(owner, *args, **kwargs)
            kept.move_to_end(key)
            if len(kept) > maxsize:
                kept.popitem(last=False)
            return cast("Value", kept[key])

        return cast("Callable[Concatenate[Owner, Others], Value]", cached)

    return decorate
