"""Why the core could not measure something, in the language of the window. Qt-free."""

from pipecore.reasons import Reason
from pipegui.i18n.texts import tr


def reason_text(reason: str) -> str:
    """Return a reason of the core's in the language in use.

    Parameters
    ----------
    reason : Reason or str
        A plain string, as projects of older versions hold it, is translated as it stands.
    """
    if isinstance(reason, Reason) and reason.values:
        return tr(reason.template).format(**reason.values)
    return tr(reason)
