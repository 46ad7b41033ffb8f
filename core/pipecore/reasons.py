"""Why something could not be measured, as a sentence that keeps its template and values."""

from typing import Any


class Reason(str):
    """An English sentence made of a template, so that an app can look up its translation.

    Parameters
    ----------
    template : str
        The sentence, with fields as of `str.format` for what differs from case to case.
    **values
        What stands in the fields, rounded as it is to be shown. Without any, the sentence is
        taken as it is.
    """

    __slots__ = ("template", "values")

    template: str
    values: dict[str, Any]

    def __new__(cls, template: str = "", /, **values: Any) -> "Reason":
        """Fill the template."""
        reason = super().__new__(cls, template.format(**values) if values else template)
        reason.template, reason.values = template, values
        return reason

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self.template, self.values)


def _restored(template: str, values: dict[str, Any]) -> Reason:
    return Reason(template, **values)
