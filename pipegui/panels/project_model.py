"""The project as a tree model: scans, their runs and elements, and their deformations."""

from dataclasses import dataclass, field
from enum import Enum
from functools import partial
from typing import Any

from PySide6.QtCore import (
    QAbstractItemModel,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    Qt,
    QTimer,
    Signal,
)
from PySide6.QtGui import QFont, QIcon

from pipecore.report.summary import by_verdict
from pipecore.types import NO_ID, Deformation, Element, PointCloud, Result
from pipegui.i18n.reason_texts import reason_text
from pipegui.i18n.texts import (
    candidate_label,
    count,
    first_capital,
    format_measure,
    label_of,
    mark,
    run_label,
    tr,
)
from pipegui.model.document import Scan, Selection
from pipegui.model.stations import stations_of
from pipegui.states import descriptions
from pipegui.states.hover_texts import station_label, station_text
from pipegui.states.view_state import TreeState
from pipegui.style import theme
from pipegui.style.colour_maps import station_colour

Index = QModelIndex | QPersistentModelIndex
Role = Qt.ItemDataRole
NAME, RADIUS, BADGE = range(3)
HEADERS = (mark("Name"), "r, mm", "")


class NodeKind(Enum):
    """What a node of the tree stands for."""

    ROOT = "root"
    SCAN = "scan"
    RUN = "run"
    ELEMENT = "element"
    DEFORMATIONS = "deformations"
    DEFORMATION = "deformation"
    CANDIDATES = "candidates"
    CANDIDATE = "candidate"
    STATIONS = "stations"
    STATION = "station"


@dataclass(eq=False)
class _Node:
    kind: NodeKind
    parent: "_Node | None"
    scan_index: int = 0
    item_id: int = NO_ID
    text: str = ""
    name: str = ""
    """What the user edits, where that is not the whole text."""
    icon: str = ""
    tint: str = ""
    radius: str = ""
    hint: str = ""
    badge: tuple[Deformation, ...] = ()
    """Its deformations, the worst first."""
    elements: tuple[int, ...] = ()
    """Ids of the elements whose visibility the check box of this node sets."""
    stations: tuple[int, ...] = ()
    """Ids of the stations whose visibility it sets."""
    number: int = 0
    row: int = 0
    children: "list[_Node]" = field(default_factory=list)


class ProjectModel(QAbstractItemModel):
    """The nodes are made anew when a scan or result comes or goes, and numbered for Qt."""

    visibility_changed = Signal(object, bool)
    """Ids of elements, and whether they are to be hidden."""
    stations_hidden = Signal(object, bool)
    """Ids of stations, and whether they are to be hidden."""
    renamed = Signal(int, object, int, str)
    """Scan, kind and id of a node, and what it is to be called."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._state = TreeState()
        self.nodes: list[_Node] = []
        self._root = self._add(_Node(NodeKind.ROOT, None))

    def apply(self, state: TreeState) -> bool:
        """Show a state; returns whether the nodes were made anew."""
        before, self._state = self._state, state
        if _shown_of(state.scans) != _shown_of(before.scans):
            self.beginResetModel()
            self.nodes = []
            self._root = self._add(_Node(NodeKind.ROOT, None))
            for index, scan in enumerate(state.scans):
                self._add_scan(index, scan)
            self.endResetModel()
            return True
        if _checks_of(state) != _checks_of(before):
            self._tell_checks(QModelIndex())
        return False

    def _tell_checks(self, parent: QModelIndex) -> None:
        if n_rows := self.rowCount(parent):
            first, last = self.index(0, NAME, parent), self.index(n_rows - 1, BADGE, parent)
            self.dataChanged.emit(first, last)
            for row in range(n_rows):
                self._tell_checks(self.index(row, NAME, parent))

    # Making the nodes

    def _add(self, node: _Node) -> _Node:
        node.number = len(self.nodes)
        self.nodes.append(node)
        if node.parent is not None:
            node.row = len(node.parent.children)
            node.parent.children.append(node)
        return node

    def _add_scan(self, index: int, scan: Scan) -> None:
        result = scan.result
        hint = str(scan.cloud.source or scan.name)
        node = _Node(NodeKind.SCAN, self._root, index, NO_ID, scan.name)
        node.icon = "scatter-plot-outline"
        node.hint = f"{hint}\n{descriptions.point_count(len(scan.cloud))}"
        self._add(node)
        if result is not None:
            self._add_result(node, index, result)
        self._add_stations(node, index, scan.cloud)

    def _add_result(self, node: _Node, index: int, result: Result) -> None:
        node.elements = tuple(e.element_id for e in result.elements)
        ranked = by_verdict(result)
        for run_id in sorted({e.run_id for e in result.elements}):
            self._add_run(node, run_id, result, ranked)
        if ranked:
            branch = _Node(NodeKind.DEFORMATIONS, node, index)
            branch.text, branch.icon = tr("Deformations ({n})").format(n=len(ranked)), "target"
            self._add(branch)
            for deformation in ranked:
                self._add_deformation(branch, deformation, result)

        if result.candidates:
            branch = _Node(NodeKind.CANDIDATES, node, index)
            branch.text = tr("Not accepted ({n})").format(n=len(result.candidates))
            branch.icon, branch.hint = "eye-off-outline", descriptions.candidates_hint(result)
            self._add(branch)
            for candidate in result.candidates:
                row = _Node(NodeKind.CANDIDATE, branch, index, candidate.candidate_id)
                row.text, row.icon = candidate_label(candidate), theme.ELEMENT_ICON[candidate.kind]
                row.radius = format_measure(1000 * candidate.radius, decimals=1)
                row.hint = reason_text(candidate.reason)
                self._add(row)

    def _add_stations(self, parent: _Node, index: int, cloud: PointCloud) -> None:
        stations = stations_of(cloud)
        if cloud.station is None or not stations:
            return
        branch = _Node(NodeKind.STATIONS, parent, index)
        branch.text = tr("Stations ({n})").format(n=len(stations))
        branch.icon = "map-marker-radius-outline"
        branch.stations = tuple(station.station_id for station in stations)
        self._add(branch)
        for station in stations:
            node = _Node(NodeKind.STATION, branch, index, station.station_id)
            label, points = station_label(station), descriptions.point_count(station.n_points)
            node.text, node.stations = f"{label} · {points}", (station.station_id,)
            node.hint = station_text(station, cloud)
            self._add(node)

    def _add_run(
        self, parent: _Node, run_id: int, result: Result, ranked: list[Deformation]
    ) -> None:
        elements = [e for e in result.elements if e.run_id == run_id]
        if len(elements) > 1:
            name = run_label(result, run_id)
            text = f"{name} ({len(elements)})"
            run = _Node(NodeKind.RUN, parent, parent.scan_index, run_id, text, name)
            run.icon, run.elements = "pipe-disconnected", tuple(e.element_id for e in elements)
            run.hint = count("{n:,} element", "{n:,} elements", len(elements))
            parent = self._add(run)
        # An element that is a run of its own stands alone: one line less to open and to read.
        for element in elements:
            badge = tuple(d for d in ranked if d.element_id == element.element_id)
            self._add_element(parent, element, badge)

    def _add_element(
        self, parent: _Node, element: Element, deformations: tuple[Deformation, ...]
    ) -> None:
        node = _Node(NodeKind.ELEMENT, parent, parent.scan_index, element.element_id)
        node.text, node.icon = label_of(element), theme.ELEMENT_ICON[element.kind]
        radius_mm, sd_mm = 1000 * element.radius, 1000 * element.radius_sd
        node.radius = format_measure(radius_mm, decimals=1)
        size = element.nominal.name if element.nominal else tr("no nominal size within tolerance")
        node.hint = f"{label_of(element)}: r {format_measure(radius_mm, sd_mm, 'mm')}, {size}"
        node.badge, node.elements = deformations, (element.element_id,)
        self._add(node)

    def _add_deformation(self, parent: _Node, deformation: Deformation, result: Result) -> None:
        element = result.element(deformation.element_id)
        node = _Node(NodeKind.DEFORMATION, parent, parent.scan_index, deformation.deformation_id)
        name = descriptions.deformation_name(deformation)
        node.text = f"{name} · {label_of(element)}"
        node.badge = (deformation,)
        self._add(node)

    # What Qt asks

    def node(self, index: Index) -> _Node:
        """Return what a row stands for."""
        return self.nodes[index.internalId()] if index.isValid() else self._root

    def index(self, row: int, column: int, parent: Index = QModelIndex()) -> QModelIndex:  # noqa: B008
        """Return the index of a child."""
        if not self.hasIndex(row, column, parent):
            return QModelIndex()
        return self.createIndex(row, column, self.node(parent).children[row].number)

    def parent(self, index: Index) -> QModelIndex:  # type: ignore[override]
        """Return the index of what contains a node."""
        parent = self.node(index).parent
        if parent is None or parent is self._root:
            return QModelIndex()
        return self.createIndex(parent.row, NAME, parent.number)

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008, N802
        """Return the number of children."""
        return 0 if parent.column() > 0 else len(self.node(parent).children)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008, N802
        """Return the number of columns."""
        return len(HEADERS)

    def headerData(  # noqa: N802
        self, section: int, orientation: Qt.Orientation, role: int = Role.DisplayRole
    ) -> Any:
        """Return a column's title."""
        if orientation is Qt.Orientation.Horizontal and role == Role.DisplayRole:
            return tr(HEADERS[section])
        return None

    def flags(self, index: Index) -> Qt.ItemFlag:
        """Say what can be done with a node."""
        if not index.isValid():
            return Qt.ItemFlag.NoItemFlags
        flags = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable
        node = self.node(index)
        is_active = node.scan_index == self._state.active
        if index.column() == NAME and (node.elements or node.stations) and is_active:
            flags |= Qt.ItemFlag.ItemIsUserCheckable
        is_named = node.kind is NodeKind.SCAN or (
            node.kind in (NodeKind.RUN, NodeKind.ELEMENT) and is_active
        )
        if index.column() == NAME and is_named:
            flags |= Qt.ItemFlag.ItemIsEditable
        return flags

    def data(self, index: Index, role: int = Role.DisplayRole) -> Any:
        """Return what is shown of a node."""
        if not index.isValid():
            return None
        node = self.node(index)
        value: Any = None
        match role:
            case Role.EditRole if index.column() == NAME:
                value = node.name or node.text
            case Role.DisplayRole:
                badge = str(len(node.badge)) if node.kind is NodeKind.ELEMENT and node.badge else ""
                value = (node.text, node.radius, badge)[index.column()]
            case Role.DecorationRole:
                value = self._icon(node, index.column())
            case Role.CheckStateRole if index.column() == NAME:
                value = self._check_state(node)
            case Role.TextAlignmentRole if index.column() == RADIUS:
                value = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
            case Role.ToolTipRole:
                value = self._hint(node, index.column())
            case Role.FontRole if node.kind is NodeKind.SCAN:
                value = QFont()
                value.setBold(node.scan_index == self._state.active)
        return value

    def _icon(self, node: _Node, column: int) -> QIcon | None:
        if column == BADGE and node.kind is NodeKind.ELEMENT and node.badge:
            return theme.verdict_icon(node.badge[0].verdict)
        if column != NAME:
            return None
        if node.kind is NodeKind.DEFORMATION:
            return theme.verdict_icon(node.badge[0].verdict)
        if node.kind is NodeKind.STATION:
            return theme.swatch_icon(station_colour(node.item_id))
        return theme.icon(node.icon, "muted")

    def _hint(self, node: _Node, column: int) -> str:
        if column == BADGE and node.kind is NodeKind.ELEMENT and node.badge:
            return "\n".join(f"{first_capital(tr(d.kind))}: {tr(d.verdict)}" for d in node.badge)
        return node.hint or node.text

    def _check_state(self, node: _Node) -> Qt.CheckState | None:
        ids, hidden = node.elements, self._state.hidden_elements
        if node.stations:
            ids, hidden = node.stations, self._state.hidden_stations
        if not ids or node.scan_index != self._state.active:
            return None
        n_hidden = len(hidden.intersection(ids))
        if n_hidden == 0:
            return Qt.CheckState.Checked
        all_hidden = n_hidden == len(ids)
        return Qt.CheckState.Unchecked if all_hidden else Qt.CheckState.PartiallyChecked

    def setData(self, index: Index, value: Any, role: int = Role.EditRole) -> bool:  # noqa: N802
        """Take a click on a check box or a new name: it becomes a command."""
        if role == Role.EditRole and self.flags(index) & Qt.ItemFlag.ItemIsEditable:
            node = self.node(index)
            # The rows are made anew for it, which the editor of this one must not live to see.
            tell = partial(self.renamed.emit, node.scan_index, node.kind, node.item_id, str(value))
            QTimer.singleShot(0, self, tell)
            return True
        if role != Role.CheckStateRole or not self.flags(index) & Qt.ItemFlag.ItemIsUserCheckable:
            return False
        hide = Qt.CheckState(value) == Qt.CheckState.Unchecked
        node = self.node(index)
        if node.stations:
            self.stations_hidden.emit(node.stations, hide)
        else:
            self.visibility_changed.emit(node.elements, hide)
        return True

    # For the panel

    def what(self, index: Index) -> tuple[int, NodeKind, int]:
        """Return scan, kind and id of a node."""
        node = self.node(index)
        return node.scan_index, node.kind, node.item_id

    def index_of(self, scan_index: int, selection: Selection) -> QModelIndex:
        """Return the node of a selection, the invalid index for nothing."""
        if selection.candidate_id:
            wanted = (NodeKind.CANDIDATE, selection.candidate_id)
        elif selection.deformation_id:
            wanted = (NodeKind.DEFORMATION, selection.deformation_id)
        elif selection.element_id:
            wanted = (NodeKind.ELEMENT, selection.element_id)
        elif selection.run_id:
            wanted = self._run_node(scan_index, selection.run_id)
        else:
            return QModelIndex()
        for node in self.nodes:
            if (node.scan_index, node.kind, node.item_id) == (scan_index, *wanted):
                return self.createIndex(node.row, NAME, node.number)
        return QModelIndex()

    def _run_node(self, scan_index: int, run_id: int) -> tuple[NodeKind, int]:
        """Kind and id of the node that stands for a run: its own, or its only element's."""
        result = self._state.scans[scan_index].result
        ids = [e.element_id for e in result.elements if e.run_id == run_id] if result else []
        return (NodeKind.ELEMENT, ids[0]) if len(ids) == 1 else (NodeKind.RUN, run_id)

    def branches(self) -> list[QModelIndex]:
        """Return the nodes that hold others."""
        nodes = [node for node in self.nodes[1:] if node.children]
        return [self.createIndex(node.row, NAME, node.number) for node in nodes]

    def folded(self) -> list[QModelIndex]:
        """Return the branches that are closed until somebody opens them."""
        nodes = [node for node in self.nodes if node.kind is NodeKind.CANDIDATES]
        return [self.createIndex(node.row, NAME, node.number) for node in nodes]

    def spanned(self) -> list[QModelIndex]:
        """Return the nodes whose name may take the whole width."""
        kinds = (
            NodeKind.DEFORMATIONS,
            NodeKind.DEFORMATION,
            NodeKind.CANDIDATES,
            NodeKind.STATIONS,
            NodeKind.STATION,
        )
        nodes = [node for node in self.nodes if node.kind in kinds]
        return [self.createIndex(node.row, NAME, node.number) for node in nodes]


def _checks_of(state: TreeState) -> tuple[Any, ...]:
    return state.hidden_elements, state.hidden_stations, state.active


def _shown_of(scans: tuple[Scan, ...]) -> list[tuple[Any, ...]]:
    """Return the parts of the scans that have nodes; reviews, for one, have none."""
    return [(scan.name, scan.cloud, scan.result) for scan in scans]
