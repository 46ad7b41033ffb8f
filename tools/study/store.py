"""Where the study keeps what it has measured, so that a run can be resumed, and its page."""

import hashlib
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

ROOT = Path(__file__).parents[2]
OUT = ROOT / "out" / "study"
PAGE = ROOT / "docs" / "accuracy.md"
IMAGES = ROOT / "docs" / "images"


@cache
def sources_digest() -> str:
    """Name of the core's sources: what was measured with others does not count."""
    digest = hashlib.sha256()
    for path in sorted((ROOT / "core" / "pipecore").rglob("*.py")):
        digest.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:8]


def measured(name: str, measure: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """What `measure` returned for these sources, now or in an earlier run."""
    path = OUT / sources_digest() / f"{name}.json"
    if not path.exists():
        print(name, flush=True)
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_suffix(".part")
        unfinished.write_text(json.dumps(measure()), encoding="utf-8")
        unfinished.rename(path)
    values: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return values


def put_section(name: str, text: str) -> None:
    """Replace one section of the page; the others stay as they are."""
    start, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
    page = PAGE.read_text(encoding="utf-8")
    if start not in page:
        raise SystemExit(f"{PAGE.name} has lost its place for “{name}”: {start.strip()}")
    before, rest = page.split(start)
    _, after = rest.split(end)
    whole = f"{before}{start}\n{text.strip()}\n\n{end}{after}"
    PAGE.write_text(whole, encoding="utf-8")


def put_image(name: str, figure: Figure, caption: str) -> str:
    """Save a figure; return the line that shows it."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    path = IMAGES / f"accuracy-{name}.png"
    # Without a date and a version, the same figures make the same file.
    figure.savefig(path, dpi=110, metadata={"Software": None})
    return f"![{caption}](images/{path.name})"


def table(head: list[str], rows: list[list[str]]) -> str:
    """A Markdown table, numbers to the right."""
    lines = [head, ["---", *["--:"] * (len(head) - 1)], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
