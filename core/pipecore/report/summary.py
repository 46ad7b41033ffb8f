"""A result in one line, and its deformations in the order in which to look at them."""

from collections import Counter

from pipecore.formatting import format_count
from pipecore.types import Deformation, ElementKind, Result, Verdict

VERDICT_ORDER = (
    Verdict.REJECT,
    Verdict.REVIEW,
    Verdict.NOT_MEASURABLE,
    Verdict.ACCEPT_IF,
    Verdict.ACCEPT,
)


def summarise(result: Result) -> str:
    """Return a line such as "23 pipes in 7 runs, 5 deformations, 2 to reject".

    Parameters
    ----------
    result : Result

    Returns
    -------
    str
    """
    if not result.elements:
        return "No pipes found"
    n_pipes = sum(e.kind is ElementKind.CYLINDER for e in result.elements)
    n_runs = len({e.run_id for e in result.elements})
    parts = [f"{format_count(n_pipes, 'pipe')} in {format_count(n_runs, 'run')}"]
    if not result.deformations:
        return f"{parts[0]}, no deformations"
    parts.append(format_count(len(result.deformations), "deformation"))
    verdicts = Counter(d.verdict for d in result.deformations)
    parts += [
        f"{verdicts[verdict]} to {verdict}"
        for verdict in (Verdict.REJECT, Verdict.REVIEW)
        if verdicts[verdict]
    ]
    return ", ".join(parts)


def by_verdict(result: Result) -> list[Deformation]:
    """Return the deformations, the worst verdict first, the deepest first within it.

    Parameters
    ----------
    result : Result

    Returns
    -------
    list of Deformation
    """
    # A nan depth sorts last: it compares as minus infinity would.
    return sorted(
        result.deformations,
        key=lambda d: (VERDICT_ORDER.index(d.verdict), -d.depth if d.depth == d.depth else 0.0),
    )
