"""A short word on a coloured ground, such as SIMULATED."""

from typing import Literal

from PySide6.QtWidgets import QLabel, QSizePolicy, QWidget

from cosmic.frame.gui.build import set_style_property
from cosmic.frame.gui.theme import ui_font

Tone = Literal["simulated", "real", "alarm", "warning", "quiet"]


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
