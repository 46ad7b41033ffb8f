"""Errors that pipecore raises for reasons its caller can do something about."""


class PipecoreError(Exception):
    """Base of all errors that pipecore raises on purpose.

    The message is one sentence for the person at the screen: what happened, to
    which file or setting, and what to do.

    Parameters
    ----------
    template : str
        The sentence, with fields as of `str.format` for what differs from case to case;
        an app can look up its translation.
    **values
        What stands in the fields. Without any, the sentence is taken as it is.
    """

    def __init__(self, template: str, **values: object) -> None:
        super().__init__(template.format(**values) if values else template)
        self.template, self.values = template, values


class ReadError(PipecoreError):
    """A file could not be read as a point cloud."""


class WriteError(PipecoreError):
    """A file or report could not be written; nothing was left half done."""


class SettingsError(PipecoreError):
    """A setting is unknown, of the wrong kind or outside its bounds."""


class EditError(PipecoreError):
    """Elements cannot be changed in the way that was asked for."""


class SceneError(PipecoreError):
    """A description of a scene for the simulator is not valid."""


class MissingPackageError(PipecoreError):
    """A package that only some installations have is needed."""


class CancelledError(PipecoreError):
    """The user cancelled the work."""

    def __init__(self, template: str = "Cancelled.", **values: object) -> None:
        super().__init__(template, **values)
