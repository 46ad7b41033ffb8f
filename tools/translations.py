"""The catalogues of translations: `python -m tools.translations` brings them up to the sources.

Texts are found where the app calls `tr`, `mark`, `trn` and `count`, and where the core raises
errors or gives reasons; those of tables that the core or the menus hold are taken from the
tables themselves.
"""

from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

from babel.messages.catalog import Catalog
from babel.messages.extract import extract_from_dir
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po, write_po

from pipecore.editing import STAGES as EDITING_STAGES
from pipecore.elements.gates import refusals
from pipecore.formatting import NOT_MEASURABLE
from pipecore.io import file_filter
from pipecore.io.coordinates import UNIT_LABELS
from pipecore.io.source import CAUSES, IO_ERROR, NO_SENSE
from pipecore.nothing_found import ADVICE, OTHERWISE
from pipecore.pipeline import STAGES
from pipecore.resources import resource
from pipecore.rules import MEASURE_TEXTS, QUESTIONS, list_rules
from pipecore.settings import (
    DirectionPreset,
    EllipseFit,
    FlaggedPoints,
    ProfileMethod,
    SizeCatalogue,
    StationSource,
    iterate_fields,
)
from pipecore.stations.verdicts import TEXTS as STATION_TEXTS
from pipecore.types import (
    KIND_LABELS,
    Condition,
    DeformationKind,
    ElementKind,
    ReviewState,
    SeenBy,
    Verdict,
)
from pipegui.i18n.texts import DOMAIN, LANGUAGES
from pipegui.model.document import Background, ColourBy
from pipegui.model.presets import Presets
from pipegui.style import theme
from pipegui.window.action_table import MENUS, SPECS

SOURCES = Path(__file__).parents[1] / "pipegui"
KEYWORDS = {"tr": None, "mark": None, "trn": (1, 2), "count": (1, 2)}
CORE = Path(__file__).parents[1] / "core" / "pipecore"
ERRORS = dict.fromkeys(("ReadError", "WriteError", "SettingsError", "EditError", "Reason", "Note"))
"""Their first argument is a text; what is left out here is never shown in the window."""
NOT_IN_THE_APP = ("simulate", "cli", "tiling", "ellipses")
MORE_STAGES = (
    "reading",
    "normals",
    "drawing figures",
    "writing",
    "writing profiles",
    "writing result",
    "saving",
    "opening",
)
"""Stages of work that is no detection."""


def tables() -> Iterator[str]:
    """Yield the texts of tables that are translated where they are shown."""
    yield from MENUS
    for action in SPECS:
        if action.name.startswith("language_") and action.name != "language_system":
            yield from (action.tip, action.submenu)
        else:
            yield from (action.text, action.tip, action.submenu)
    for _, spec in iterate_fields():
        yield from (spec.label, spec.help, spec.zero_means)
    for enum in (
        ColourBy,
        Background,
        theme.Appearance,
        ProfileMethod,
        EllipseFit,
        DirectionPreset,
        FlaggedPoints,
        StationSource,
        SizeCatalogue,
    ):
        yield from (str(value) for value in enum)
    for enum in (ElementKind, DeformationKind, SeenBy, Verdict, Condition, ReviewState):
        yield from (str(value) for value in enum)
    yield from KIND_LABELS.values()
    yield from MEASURE_TEXTS.values()
    for text in QUESTIONS.values():
        yield from (text.question, text.yes, text.no)
    yield from UNIT_LABELS.values()
    yield from (*refusals.TEXTS, *ADVICE.values(), OTHERWISE, *STATION_TEXTS)
    yield from (*CAUSES.values(), NO_SENSE, IO_ERROR, "line", "arc")
    yield from (rule.title for rule in list_rules())
    for preset in Presets(Path("none")).every():
        yield from (preset.name, preset.description)
    yield from (*STAGES, *EDITING_STAGES, *MORE_STAGES, NOT_MEASURABLE)
    for kind in file_filter().split(";;"):
        name = kind.partition(" (")[0]
        if name in ("Point clouds", "All files"):
            yield name


def extract() -> Catalog:
    """Return a catalogue of all texts, untranslated, in a steady order."""
    found = Catalog(charset="utf-8", fuzzy=False)
    for folder, keywords in ((SOURCES, KEYWORDS), (CORE, ERRORS)):
        texts = extract_from_dir(folder, [("**.py", "python")], keywords=keywords)
        for path, _, text, _, _ in sorted(texts, key=lambda m: m[:2]):
            if not path.startswith(NOT_IN_THE_APP):
                found.add(text)
    for text in tables():
        if text:
            found.add(text)
    return found


def path_of(code: str, ending: str = "po") -> Path:
    """Path of a language's catalogue."""
    return resource("locale", code, "LC_MESSAGES", f"{DOMAIN}.{ending}")


def read(code: str) -> Catalog:
    """Return a language's catalogue as it is kept."""
    with path_of(code).open("rb") as file:
        return read_po(file, locale=code)


def compiled(catalogue: Catalog) -> bytes:
    """Return what the program reads of a catalogue."""
    buffer = BytesIO()
    write_mo(buffer, catalogue)
    return buffer.getvalue()


def renew(code: str) -> None:
    """Bring a language's catalogue up to the sources and compile it."""
    catalogue = read(code)
    catalogue.update(extract(), no_fuzzy_matching=True, update_creation_date=False)
    catalogue.obsolete.clear()
    with path_of(code).open("wb") as file:
        write_po(file, catalogue, width=100, no_location=True, sort_output=True)
    path_of(code, "mo").write_bytes(compiled(catalogue))
    missing = [m.id for m in catalogue if m.id and not is_translated(m)]
    print(f"{code}: {len(catalogue)} texts, {len(missing)} without a translation")
    for text in missing:
        print(f"  {text}")


def is_translated(message: object) -> bool:
    """Whether a message has all its forms."""
    string = message.string
    return all(string) if isinstance(string, tuple | list) else bool(string)


if __name__ == "__main__":
    for language in LANGUAGES:
        if language not in ("", "en"):
            renew(language)
