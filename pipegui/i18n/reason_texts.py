"""Why the core could not measure something, in the language of the window. Qt-free."""

from pipecore.reasons import Reason
from pipegui.i18n.texts import tr

TRANSLATED_VALUES = ("unit", "height_unit")
"""What reasons call values that are texts of the core too; the others are names."""


def reason_text(reason: str) -> str:
    """Return a reason of the core's in the language in use.

    Parameters
    ----------
    reason : Reason or str
        A plain string, as projects of older versions hold it, is translated as it stands.
    """
    if isinstance(reason, Reason) and reason.values:
        return tr(reason.template).format(**{k: _shown(k, v) for k, v in reason.values.items()})
    return tr(reason)


def _shown(name: str, value: object) -> object:
    return tr(value) if isinstance(value, str) and name in TRANSLATED_VALUES else value
