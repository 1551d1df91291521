"""What is painted ends, whatever goes wrong while it is."""

import re
from pathlib import Path

import pytest
from PySide6.QtGui import QImage, QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

import cosmic
from cosmic.frame.gui.painting import painting, saved
from cosmic.frame.overrides import override


class Failing(QWidget):
    """Fails half way through its painting, once."""

    def __init__(self) -> None:
        super().__init__()
        self.fails = True
        self.known: list[QPainter] = []
        self.painted = 0

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        with painting(self) as painter:
            self.known.append(painter)  # as the traceback of its error does
            painter.drawText(5, 15, "half")
            if self.fails:
                raise KeyError("the other half")
            assert painter.isActive()
            self.painted += 1


def test_a_widget_that_fails_while_it_is_painted_is_painted_again(qtbot: QtBot) -> None:
    widget = Failing()
    qtbot.addWidget(widget)
    with qtbot.captureExceptions() as errors:
        widget.show()
        qtbot.waitUntil(lambda: bool(errors))
    assert errors[0][0] is KeyError
    assert not any(painter.isActive() for painter in widget.known)
    widget.fails = False
    widget.update()
    qtbot.waitUntil(lambda: widget.painted > 0)


def test_a_painter_is_put_back_when_what_is_painted_fails(qtbot: QtBot) -> None:
    image = QImage(20, 20, QImage.Format.Format_RGB32)
    with painting(image) as painter:
        with pytest.raises(KeyError), saved(painter):
            painter.setOpacity(0.5)
            raise KeyError
        assert painter.opacity() == 1.0
    assert not painter.isActive()


def test_nothing_is_painted_with_a_painter_that_nobody_ends() -> None:
    source = Path(cosmic.__file__).parent
    left = [
        file.relative_to(source).as_posix()
        for file in source.rglob("*.py")
        if re.search(r"\bQPainter\(\S", file.read_text("utf-8"))
    ]
    assert left == ["frame/gui/painting.py"]
