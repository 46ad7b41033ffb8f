"""The cursor over one view: what is there is named, and marked in the other views."""

from PySide6.QtCore import QObject, Signal

from pipegui.controllers.session import Session
from pipegui.model import result_queries
from pipegui.model.document import ProfileKey
from pipegui.model.stations import stations_of
from pipegui.states import descriptions, hover_texts


class Hovering(QObject):
    """Looks up what is under the cursor."""

    coordinates_changed = Signal(str)
    """World coordinates of the point under the cursor, "" for none."""
    description_changed = Signal(str)
    """Name and deviation of what is under the cursor, "" for nothing."""
    spot_changed = Signal(object)
    """Local coordinates of the spot under the cursor on a plot, shape (3,), or None."""
    profile_changed = Signal(object)
    """The profile under the cursor on a plot, a table of one row, or None."""
    place_changed = Signal(object)
    """Chainage and clock angle of the point under the cursor on the selected element, or None."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self._session = session

    def hover_point(self, point_index: int) -> None:
        """Describe the point of the cloud under the cursor, -1 for none."""
        document = self._session.document
        scan, place = document.scan, None
        is_there = scan is not None and point_index >= 0
        self.coordinates_changed.emit(
            descriptions.coordinates(scan.cloud, point_index) if scan and is_there else ""
        )
        self.description_changed.emit(
            hover_texts.hover_text(scan, point_index) if scan and is_there else ""
        )
        if scan is not None and scan.result is not None:
            element_id = document.selection.element_id
            place = result_queries.spot_of_point(scan.cloud, scan.result, element_id, point_index)
        self.place_changed.emit(place)

    def hover_station(self, station_id: int) -> None:
        """Describe the station whose mark is under the cursor."""
        scan = self._session.document.scan
        if scan is None:
            return
        self.coordinates_changed.emit("")
        for station in stations_of(scan.cloud):
            if station.station_id == station_id:
                self.description_changed.emit(hover_texts.station_text(station, scan.cloud))

    def hover_spot(self, place: tuple[float, float] | None) -> None:
        """Mark a spot of the selected element's surface: chainage in metres, clock angle."""
        document, spot = self._session.document, None
        element_id = document.selection.element_id
        if place is not None and document.result is not None and element_id:
            spot = result_queries.spot_on_surface(document.result, element_id, *place)
        self.spot_changed.emit(spot)

    def hover_profile(self, key: ProfileKey | None) -> None:
        """Mark a profile of the selected element."""
        document, profile = self._session.document, None
        element_id = document.selection.element_id
        if key is not None and document.result is not None and element_id:
            profile = result_queries.profile_at(document.result, element_id, key)
        self.profile_changed.emit(profile)
