"""The units of files in words, and which of them to offer for a scan."""

from collections.abc import Mapping, Sequence

from pipecore.io.coordinates import UNIT_LABELS
from pipecore.notes import Note
from pipecore.settings import LengthUnit
from pipecore.units import FileUnit
from pipegui.i18n.texts import mark, tr
from pipegui.model.document import Scan

UNIT_NAMES: Mapping[LengthUnit, str] = {
    LengthUnit.AUTO: mark("As the file says"),
    LengthUnit.METRE: mark("Metres"),
    LengthUnit.MILLIMETRE: mark("Millimetres"),
    LengthUnit.INCH: mark("Inches"),
    LengthUnit.FOOT: mark("Feet"),
    LengthUnit.US_SURVEY_FOOT: mark("US survey feet"),
}
READ_IN = {
    LengthUnit.METRE: mark("Read in metres"),
    LengthUnit.MILLIMETRE: mark("Read in millimetres"),
    LengthUnit.FOOT: mark("Read in feet"),
    LengthUnit.INCH: mark("Read in inches"),
}
"""The units that can be offered with one click, and the text of the button."""
USUAL = (LengthUnit.METRE, LengthUnit.MILLIMETRE, LengthUnit.FOOT)


def unit_text(unit: FileUnit) -> str:
    """Return the unit of a file in words: "US survey feet (heights metres)"."""
    plan, height = _spelled(unit.name), _spelled(unit.height_name)
    if plan == height:
        return plan
    return tr("{plan} (heights {height})").format(plan=plan, height=height)


def _spelled(name: str) -> str:
    return tr(UNIT_LABELS.get(name, name))


def units_in_doubt(scan: Scan, notes: Sequence[Note]) -> tuple[LengthUnit, ...]:
    """Return other units to offer, if notes on the scan say something of its unit."""
    named = [LengthUnit(note.values["other"]) for note in notes if doubts_unit(note)]
    if named:
        usual = other_units(scan)
        return (named[0], *(unit for unit in usual if unit is not named[0]))
    if any("system" in note.values and "unit" in note.values for note in notes):
        return (LengthUnit.METRE,)
    return ()


def doubts_unit(note: Note) -> bool:
    """Return whether a note says that a cloud makes no sense in its unit, and names another."""
    return note.values.get("other") in set(READ_IN)


def other_units(scan: Scan) -> tuple[LengthUnit, ...]:
    """Return the usual units in which a scan was not read."""
    return tuple(unit for unit in USUAL if str(unit) != scan.cloud.unit.name)
