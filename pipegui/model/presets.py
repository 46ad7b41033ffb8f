"""Settings kept by name: those that come with the program, and the user's own. Qt-free.

A preset is a TOML file of settings. It says nothing of the file's length unit and of own
stacks, which belong to a scan: choosing one leaves them as they are.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import tomli_w

from pipecore.errors import SettingsError
from pipecore.io import write_file
from pipecore.resources import resource
from pipecore.settings import Settings
from pipegui.i18n.texts import mark, tr

OF_THE_SCAN = ("input.length_unit", "stacks.directions")
"""Settings that no preset touches."""
STANDARD = "Standard"


@dataclass(frozen=True)
class Preset:
    """Settings with a name; `description` says what they are for."""

    name: str
    path: Path | None = None
    is_own: bool = False
    description: str = ""

    @property
    def shown_name(self) -> str:
        """The name in the language of the window; the user's own stay as they are."""
        return self.name if self.is_own else tr(self.name)

    def load(self) -> Settings:
        """Return the settings.

        Raises
        ------
        SettingsError
            If the file cannot be read or holds what is no setting.
        """
        return Settings() if self.path is None else Settings.from_toml(self.path)


def applied(present: Settings, preset: Settings) -> Settings:
    """Return a preset's settings with what belongs to the scan as it is at present."""
    return preset.replace({key: present.get(key) for key in OF_THE_SCAN})


class Presets:
    """The presets there are; the user's own lie in `folder`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def every(self) -> list[Preset]:
        """Return the standard, those of the program, then the user's own by name."""
        shipped = sorted(resource("presets").glob("*.toml"))
        built_in = [
            Preset(_display_name(path), path, False, _first_comment(path)) for path in shipped
        ]
        names = {preset.name for preset in built_in} | {STANDARD}
        paths = sorted(self.folder.glob("*.toml"), key=lambda path: path.stem.casefold())
        own = [Preset(path.stem, path, True) for path in paths if path.stem not in names]
        return [Preset(STANDARD, description=mark("The program's defaults.")), *built_in, *own]

    def matching(self, settings: Settings) -> Preset | None:
        """Return the preset that gives these settings, if one does."""
        for preset in self.every():
            try:
                if applied(settings, preset.load()) == settings:
                    return preset
            except SettingsError:  # told when it is chosen
                continue
        return None

    def objection(self, name: str) -> str:
        """Say why settings cannot be kept under a name; "" if they can."""
        name = name.strip()
        if not name:
            return tr("Give it a name.")
        if not re.fullmatch(r"[\w(][\w .,()+-]*", name) or name.endswith("."):
            return tr("Use letters, digits, spaces and . , ( ) + - _ only.")
        taken = {preset.name.casefold() for preset in self.every() if not preset.is_own}
        return (
            tr("“{name}” comes with the program.").format(name=name)
            if name.casefold() in taken
            else ""
        )

    def save(self, name: str, settings: Settings) -> Preset:
        """Keep settings under a name, in place of what it meant before.

        Raises
        ------
        SettingsError
            If the name will not do.
        WriteError
            If the file cannot be written.
        """
        if objection := self.objection(name):
            raise SettingsError(objection)
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"{name.strip()}.toml"
        content = settings.to_dict()
        for key in OF_THE_SCAN:
            group, field = key.split(".")
            del content[group][field]
        with write_file(path) as temporary:
            temporary.write_text(tomli_w.dumps(content), encoding="utf-8")
        return Preset(name.strip(), path, True)

    def delete(self, preset: Preset) -> None:
        """Delete one of the user's own."""
        if preset.is_own and preset.path is not None:
            preset.path.unlink(missing_ok=True)


def _display_name(path: Path) -> str:
    """The name of a preset that comes with the program, from its file's name."""
    return path.stem.replace("-", " ").capitalize()


def _first_comment(path: Path) -> str:
    """What the comment at the top of a file says."""
    lines = path.read_text(encoding="utf-8").splitlines()
    comment = []
    for line in lines:
        if not line.startswith("#"):
            break
        comment.append(line.lstrip("# "))
    return " ".join(comment)
