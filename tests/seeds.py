"""The seed of a session, and names of tests that stay as they are when it is a parameter."""

import os

SEED_VARIABLE = "PIPEGUI_TEST_SEED"
SEED = 20261201
"""Of every session that is given no other, so that what passed once goes on passing."""


def given_seed() -> int:
    """Return the seed that the environment names, or else the fixed one."""
    return int(os.environ.get(SEED_VARIABLE, SEED))


def without_seed(name: str) -> str:
    """Return the name of a test without the parameter that `tools.explore` adds."""
    test, _, ids = name.partition("[")
    kept = "-".join(i for i in ids.removesuffix("]").split("-") if not i.startswith("seed="))
    return f"{test}[{kept}]" if kept else test
