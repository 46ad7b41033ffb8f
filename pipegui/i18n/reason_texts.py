"""Why the core could not measure something, in the language of the window. Qt-free.

A result keeps the reasons as English sentences, since reports and projects hold them.
"""

import re
from functools import cache

from pipegui.i18n.texts import mark, tr

REASONS = (
    mark("too few points"),
    mark("too few points at its peak"),
    mark("the wall thickness is not set"),
    mark("the depth is less than {least} standard deviations"),
    mark("less than {needed}° of arc seen over {share} % of the length"),
    mark("{seen}° of arc seen, {needed}° are needed"),
    mark("the noise allows no better than ± {sd} %"),
    mark("the centre line is known to ± {sd} mm only"),
    mark("only {n} points, {needed} are needed"),
    mark("{seen}° of arc, {needed}° are needed"),
)
"""The core's sentences, with fields for their numbers."""


def reason_text(reason: str) -> str:
    """Return a reason of the core's in the language in use."""
    for template in REASONS:
        if found := _pattern(template).fullmatch(reason):
            return tr(template).format(**found.groupdict())
    return reason


@cache
def _pattern(template: str) -> re.Pattern[str]:
    parts = re.split(r"\{(\w+)\}", template)
    texts, names = parts[::2], [*parts[1::2], ""]
    return re.compile(
        "".join(
            re.escape(text) + (rf"(?P<{name}>[\d.]+)" if name else "")
            for text, name in zip(texts, names, strict=True)
        )
    )
