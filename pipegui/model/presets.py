"""Named settings: those that come with the program, and the user's own.

A preset is a TOML file of settings, without the length unit and the user's own stacks,
which depend on the scan: applying a preset leaves them as they are.
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

SCAN_SETTINGS = ("input.length_unit", "stacks.directions")
"""Settings that depend on the scan; no preset has them."""
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
    """Return the settings after a preset is applied: those of the scan stay as they are."""
    return preset.replace({key: present.get(key) for key in SCAN_SETTINGS})


class Presets:
    """The presets of the program, and the user's own, which are in `folder`."""

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
            except SettingsError:  # reported when it is chosen
                continue
        return None

    def objection(self, name: str) -> str:
        """Return why a preset cannot have a name; "" if it can."""
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
        """Save settings as a preset, replacing one of that name.

        Raises
        ------
        SettingsError
            If the name is not allowed.
        WriteError
            If the file cannot be written.
        """
        if objection := self.objection(name):
            raise SettingsError(objection)
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"{name.strip()}.toml"
        content = settings.to_dict()
        for key in SCAN_SETTINGS:
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
    """Return the name of a preset of the program, from its file's name."""
    return path.stem.replace("-", " ").capitalize()


def _first_comment(path: Path) -> str:
    """Return the comment at the top of a file."""
    lines = path.read_text(encoding="utf-8").splitlines()
    comment = []
    for line in lines:
        if not line.startswith("#"):
            break
        comment.append(line.lstrip("# "))
    return " ".join(comment)
