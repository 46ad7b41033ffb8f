"""The check for what tests leave behind: it tells a leak, and no test pulls down the next."""

from pathlib import Path

import pytest

pytest_plugins = ("pytester",)

TESTS = """
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QDialog, QMenu, QPushButton, QWidget

kept = []


def test_that_fails_with_a_menu_and_a_dialog_open(qtbot):
    menu, dialog = QMenu(), QDialog()
    kept.extend([menu, dialog])
    menu.addAction("a")
    dialog.setModal(True)
    dialog.show()
    menu.popup(dialog.pos())
    qtbot.waitUntil(lambda: QApplication.activePopupWidget() is not None)
    raise ValueError("on purpose")


def test_that_leaves_a_window(qtbot):
    kept.append(QWidget())
    kept[-1].show()


def test_that_needs_the_keyboard_and_the_mouse(qtbot):
    window = QWidget()
    qtbot.addWidget(window)
    button = QPushButton("press", window)
    with qtbot.waitActive(window):
        window.show()
        window.activateWindow()
    with qtbot.waitSignal(button.clicked):
        qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    with qtbot.waitSignal(button.clicked):
        button.setFocus()
        qtbot.keyClick(button, Qt.Key.Key_Space)
"""


@pytest.mark.filterwarnings("ignore")
def test_that_a_failing_test_pulls_no_other_down(pytester: pytest.Pytester) -> None:
    conftest = Path(__file__).with_name("conftest.py").read_text(encoding="utf-8")
    pytester.makeconftest(conftest)
    pytester.makepyfile(TESTS)
    result = pytester.runpytest_subprocess("-p", "no:dash", "-p", "no:cacheprovider")
    result.assert_outcomes(passed=2, failed=1, errors=1)
    result.stdout.fnmatch_lines(["*ERROR*test_that_leaves_a_window*"])
