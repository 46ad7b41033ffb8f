"""The box that says which version this is."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QMessageBox, QWidget

import pipecore
from pipegui.i18n.texts import tr


def show_about(parent: QWidget) -> None:
    """Open the box over a window."""
    box = QMessageBox(parent)
    box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    box.setWindowTitle(tr("About PipeGUI"))
    box.setText(f"PipeGUI {pipecore.__version__}")
    box.setInformativeText(
        tr(
            "Finds pipes in laser scans, measures them, and shows where they are deformed.\n\n"
            "After Mapurisa and Sithole, “Deformation detection in piping installations using "
            "profiling techniques”."
        )
    )
    box.open()
