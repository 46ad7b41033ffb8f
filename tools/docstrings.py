"""Check the docstrings of what the library exports by numpydoc's rules.

    python -m tools.docstrings [MODULE ...]

Exported are the functions and classes of a module's ``__all__``, or all public ones where it
has none, and the public methods of these classes; what a protocol asks for is documented
there, and not again where it is done. pyproject.toml names the checks and the modules, under
``[tool.pipegui.docstrings]``.
"""

import enum
import importlib
import inspect
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from numpydoc.validate import Validator, validate

PYPROJECT = Path(__file__).parents[1] / "pyproject.toml"


def exported(module: Any) -> Iterator[str]:
    """Full names of the functions and classes that a module exports, where they are defined."""
    names = getattr(module, "__all__", None)
    for name in names or [n for n in vars(module) if not n.startswith("_")]:
        thing = getattr(module, name)
        is_own = names is not None or getattr(thing, "__module__", "") == module.__name__
        is_documented_here = inspect.isfunction(thing) or inspect.isclass(thing)
        if is_own and is_documented_here and thing.__module__.startswith("pipecore"):
            yield f"{thing.__module__}.{thing.__qualname__}"
            if inspect.isclass(thing):
                yield from methods(thing)


def methods(kind: type) -> Iterator[str]:
    """Full names of the public methods and properties that a class itself defines."""
    beside = vars(sys.modules[kind.__module__]).values()
    protocols = [other for other in beside if is_protocol(other) and other is not kind]
    for name, member in vars(kind).items():
        if any(hasattr(protocol, name) for protocol in protocols):
            continue
        is_method = inspect.isfunction(member) or isinstance(member, classmethod | staticmethod)
        if not name.startswith("_") and (is_method or isinstance(member, property)):
            yield f"{kind.__module__}.{kind.__qualname__}.{name}"


def is_protocol(thing: Any) -> bool:
    """Return whether something is a class of `typing.Protocol`."""
    return inspect.isclass(thing) and getattr(thing, "_is_protocol", False)


def complaints(name: str, checks: set[str]) -> Iterator[str]:
    """What numpydoc says against the docstring of a function or class."""
    thing = Validator._load_obj(name)
    has_no_call = inspect.isclass(thing) and (
        issubclass(thing, enum.Enum | Exception) or is_protocol(thing)
    )
    for code, text in validate(name)["errors"]:
        # Enumerations and protocols are not called; an error's arguments are those of its base.
        if code in checks and not (has_no_call and code.startswith("PR")):
            yield f"{name}: {code} {text}"


def main(modules: list[str]) -> int:
    """Print all complaints; return how many there are."""
    wanted = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["tool"]["pipegui"]["docstrings"]
    names: dict[str, None] = {}
    for module in modules or wanted["modules"]:
        names |= dict.fromkeys(exported(importlib.import_module(module)))
    found = [line for name in names for line in complaints(name, set(wanted["checks"]))]
    print("\n".join(found) or f"{len(names)} exported functions, classes and methods have docs.")
    return len(found)


if __name__ == "__main__":
    sys.exit(1 if main(sys.argv[1:]) else 0)
