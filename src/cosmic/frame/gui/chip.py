"""A short word on a coloured ground, such as SIMULATED."""

from typing import Literal

from PySide6.QtWidgets import QLabel, QSizePolicy, QWidget

from cosmic.frame.gui.theme import ui_font

Tone = Literal["simulated", "real", "alarm", "warning", "quiet"]


def set_style_property(widget: QWidget, name: str, value: object) -> None:
    """Set a property that the style sheet looks at, and have the widget styled anew."""
    if widget.property(name) == value:
        return
    widget.setProperty(name, value)
    restyle(widget, *widget.findChildren(QWidget))


def restyle(*widgets: QWidget) -> None:
    """Have widgets styled anew; each costs a new layout."""
    for each in widgets:
        each.style().unpolish(each)
        each.style().polish(each)


class Chip(QLabel):
    """A word on a ground whose colour the theme takes from the tone."""

    def __init__(
        self, text: str, tone: Tone = "quiet", tip: str = "", parent: QWidget | None = None
    ) -> None:
        super().__init__(text, parent)
        self.setObjectName("chip")
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setToolTip(tip)
        self.set_tone(tone)

    def set_tone(self, tone: Tone) -> None:
        """Change the ground."""
        self.setFont(ui_font(bold=tone != "quiet"))
        set_style_property(self, "tone", tone)
