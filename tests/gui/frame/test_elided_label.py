"""The one-line label."""

from PySide6.QtCore import QEvent, QObject

from cosmic.frame.gui.elided_label import ElidedLabel


class Counter(QObject):
    def __init__(self) -> None:
        super().__init__()
        self.tips = 0

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        self.tips += event.type() == QEvent.Type.ToolTipChange
        return False


def test_the_same_text_again_changes_nothing_and_another_does(qtbot):
    label = ElidedLabel("", hint="Axis left.x")
    qtbot.addWidget(label)
    counter = Counter()
    label.installEventFilter(counter)
    label.set_text("one\ntwo")
    label.set_text("one\ntwo")
    assert (label.text(), label.toolTip(), counter.tips) == ("one two", "one\ntwo\nAxis left.x", 1)
    label.set_text("three")
    assert (label.text(), label.toolTip(), counter.tips) == ("three", "three\nAxis left.x", 2)


def test_where_the_whole_has_no_room_a_shorter_text_is_shown_and_no_number_is_cut(qtbot):
    label = ElidedLabel()
    qtbot.addWidget(label)
    texts = ("ARMED ±150, 149 to go", "±150, 149 to go", "149 to go")
    label.set_text(*texts)
    label.show()
    widths = [label.fontMetrics().horizontalAdvance(each) for each in texts]
    for width, text in zip(widths, texts, strict=True):
        label.resize(width, 20)
        assert label.shown_text == text
    assert label.toolTip() == texts[0]


def test_units_are_shown_with_their_micro_sign(qtbot):
    label = ElidedLabel("force reached 140.1 uN, 3 um from the plate")
    qtbot.addWidget(label)
    assert label.text() == "force reached 140.1 µN, 3 µm from the plate"
    assert label.accessibleName() == label.text()
