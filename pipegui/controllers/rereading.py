"""Reading scans anew: in another unit, with other columns, several as one."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from PySide6.QtCore import QObject

from pipecore.settings import InputSettings, LengthUnit
from pipecore.types import PointCloud
from pipegui.controllers.session import Session
from pipegui.i18n.texts import tr
from pipegui.model import commands
from pipegui.model.document import Scan
from pipegui.states.unit_texts import READ_IN


class Rereading(QObject):
    """Reads scans of the session's document anew; undo brings them back as they were."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self._session = session

    def in_unit(self, unit: LengthUnit) -> None:
        """Read the active scan anew in a unit."""
        scan = self._session.document.scan
        if scan is not None and scan.reading.length_unit is not unit:
            self._again(scan, replace(scan.reading, length_unit=unit))
        # Until it is read, the mark stays at the unit that it has.
        self._session.refused.emit()

    def with_columns(self, scan: Scan, columns: str) -> None:
        """Read a scan anew, its text's columns as they are named."""
        self._again(scan, replace(scan.reading, columns=columns))

    def offers(self, scan: Scan, units: Sequence[LengthUnit]) -> Mapping[str, Callable[[], object]]:
        """Return answers that read a scan anew in other units, with what they do."""
        return {
            tr(READ_IN[unit]): partial(self._again, scan, replace(scan.reading, length_unit=unit))
            for unit in units
            if scan.files
        }

    def join_all(self) -> None:
        """Read all open scans anew as one cloud, each of them a station."""
        self.join(self._session.document.scans)

    def join(self, scans: Sequence[Scan]) -> None:
        """Read scans anew as one cloud, each of them a station."""
        wanted = {id(scan.cloud) for scan in scans}
        there = [scan for scan in self._session.document.scans if id(scan.cloud) in wanted]
        files = tuple(path for scan in there for path in scan.files)
        if len(there) < 2:
            return
        name = tr("{name} and {n} more").format(name=there[0].name, n=len(there) - 1)
        clouds = [scan.cloud for scan in there]
        self._session.jobs.read_again(clouds, files, name, there[0].reading)

    def _again(self, scan: Scan, reading: InputSettings) -> None:
        self._session.jobs.read_again([scan.cloud], scan.files, scan.name, reading)

    def on_read_again(self, clouds: Sequence[PointCloud], scan: Scan) -> None:
        """Put a scan in the place of those that it was read from anew."""
        command = commands.replace_scan if len(clouds) == 1 else commands.join_scans
        where = clouds[0] if len(clouds) == 1 else clouds
        self._session.do(command, where, scan)
