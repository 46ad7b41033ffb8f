"""Colours that mean the same in every part of the window, as "#rrggbb". Qt-free.

Verdicts use Okabe and Ito's colours, which colour-blind people can tell apart; an icon
always says the same.
"""

from pipecore.types import Verdict

ACCENT = "#7a4fd6"
"""Whatever is selected, everywhere. Neither in the deviation's blue and red nor a verdict."""

VERDICT = {
    Verdict.ACCEPT: "#009e73",
    Verdict.ACCEPT_IF: "#56b4e9",
    Verdict.REVIEW: "#e69f00",
    Verdict.REJECT: "#d55e00",
    Verdict.NOT_MEASURABLE: "#8a8a8a",
}
