"""The one theme: colours, spacing, fonts and the look of a state, for every CoSMic window."""

from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from typing import Final, TypeGuard

from PySide6.QtCore import QCoreApplication, QEvent, QObject
from PySide6.QtGui import QColor, QFont, QFontDatabase, QPalette
from PySide6.QtWidgets import QApplication, QWidget

from cosmic.frame.gui.palette import DARK, INK, LIGHT, OKABE_ITO, Palette, ThemeName, blend
from cosmic.frame.gui.stylesheet import ROLES, stylesheet
from cosmic.frame.overrides import override

STEP_PX: Final = 8
"""All spacing is a multiple of this, or half of it inside a widget."""

FONT_PX: Final = 13
LARGE_PX: Final = 17

_FAMILIES: Final[tuple[str, ...]] = (
    "Inter",
    "Segoe UI",
    "Noto Sans",
    "DejaVu Sans Condensed",
    "DejaVu Sans",
)


_PALETTES: Final[dict[str, Palette]] = {"dark": DARK, "light": LIGHT}
_PROPERTY: Final = "cosmic_theme"


class State(StrEnum):
    """The states an operator is shown; the value is the word."""

    OK = "OK"
    BUSY = "BUSY"
    ERROR = "ERROR"
    UNKNOWN = "UNKNOWN"
    REFUSED = "REFUSED"


@dataclass(frozen=True, slots=True)
class StateLook:
    """How a state is shown: by colour, by shape and by word, so that one of them is enough.

    Attributes
    ----------
    colour : str
        Okabe-Ito colour of the shape.
    glyph : str
        The shape as a character, for plain text.
    word : str
        The word.
    fill, text : str
        Background and text of a badge; their contrast is at least 4.5:1.
    """

    colour: str
    glyph: str
    word: str
    fill: str
    text: str


_STATES: Final = {
    State.OK: ("bluish green", "●"),
    State.BUSY: ("sky blue", "▶"),
    State.ERROR: ("vermillion", "■"),
    State.UNKNOWN: ("reddish purple", "?"),
    State.REFUSED: ("orange", "◆"),
}
_LOUD: Final = (State.ERROR, State.REFUSED)


def state_look(state: State, palette: Palette | None = None) -> StateLook:
    """Return how `state` is shown in `palette`, or in the theme in force."""
    palette = palette or current_palette()
    name, glyph = _STATES[state]
    colour = OKABE_ITO[name]
    if state in _LOUD:
        return StateLook(colour=colour, glyph=glyph, word=state.value, fill=colour, text=INK)
    fill = blend(colour, palette.panel, 0.22)
    return StateLook(colour=colour, glyph=glyph, word=state.value, fill=fill, text=palette.text)


@cache
def _families() -> list[str]:
    """Return those of our families that this computer has: to list all takes a millisecond."""
    known = set(QFontDatabase.families())
    return [family for family in _FAMILIES if family in known] or ["sans-serif"]


def ui_font(size_px: int = FONT_PX, *, bold: bool = False) -> QFont:
    """Return the font of the user interface; needs a QApplication."""
    font = QFont(_families())
    font.setPixelSize(size_px)
    font.setBold(bold)
    return font


def number_font(size_px: int = FONT_PX, *, bold: bool = False) -> QFont:
    """Return the same font with figures of one width, so that numbers do not dance."""
    font = ui_font(size_px, bold=bold)
    font.setFeature(QFont.Tag("tnum"), 1)
    return font


def code_font(size_px: int = FONT_PX) -> QFont:
    """Return the font of the console and of the log's details."""
    font = QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont)
    font.setPixelSize(size_px)
    return font


def is_theme(name: object) -> TypeGuard[ThemeName]:
    """Tell whether `name` names a theme."""
    return isinstance(name, str) and name in _PALETTES


def current_palette() -> Palette:
    """Return the palette of the theme in force; the dark one before the first is applied."""
    app = QCoreApplication.instance()
    name = app.property(_PROPERTY) if app is not None else None
    return _PALETTES.get(str(name), DARK)


def apply_theme(app: QApplication, name: ThemeName) -> None:
    """Give every window of `app` the theme `name`; GUI thread.

    Raises
    ------
    ValueError
        There is no such theme.
    """
    if name not in _PALETTES:
        raise ValueError(f"there is no theme {name!r}; there are {', '.join(_PALETTES)}")
    app.setProperty(_PROPERTY, name)
    if not app.styleSheet() and app.style().name().lower() != "fusion":
        app.setStyle("Fusion")  # under a sheet it is, and has no name; again costs half a second
    if app.font() != ui_font():
        app.setFont(ui_font())
    app.setPalette(_qt_palette(_PALETTES[name]))
    sheet = stylesheet()
    if app.styleSheet() != sheet:
        app.setStyleSheet(sheet)
    else:
        restyle_shown(app)


def _qt_palette(colours: Palette) -> QPalette:
    role = QPalette.ColorRole
    roles = {each: getattr(colours, name) for name, each in ROLES.items()} | {
        role.WindowText: colours.text,
        role.AlternateBase: colours.panel,
        role.ButtonText: colours.text,
        role.BrightText: colours.on_stop,
        role.Accent: colours.accent,
        role.Link: colours.accent,
        role.ToolTipBase: colours.raised,
        role.ToolTipText: colours.text,
    }
    palette = QPalette()
    for each, colour in roles.items():
        palette.setColor(each, QColor(colour))
    for each in (role.WindowText, role.Text, role.ButtonText):
        palette.setColor(QPalette.ColorGroup.Disabled, each, QColor(colours.disabled))
    return palette


_RESTYLE_NAME: Final = "restyleWhenShown"


class RestyleWhenShown(QObject):
    """Styles widgets that were hidden while the palette changed, when they are shown.

    Qt keeps the colours of a style sheet's rules for each widget, and takes `palette(...)` in them
    from the palette that was in force when it made them. `QApplication.setStyleSheet` makes all of
    them anew, at 0.4 ms a widget (Qt 6.11): 0.8 s of 1,900 widgets, of which 150 are seen.
    """

    def __init__(self, app: QApplication) -> None:
        super().__init__(app)
        self.setObjectName(_RESTYLE_NAME)

    def restyle(self, widget: QWidget) -> None:
        """Style a widget and what is shown in it anew, and the rest when that is shown."""
        style = widget.style()
        style.unpolish(widget)
        style.polish(widget)
        widget.update()
        self.restyle_inside(widget)

    def restyle_inside(self, widget: QWidget) -> None:
        """Style what is in a widget."""
        for child in widget.children():
            if not isinstance(child, QWidget):
                continue
            if child.isHidden() or child.isWindow():
                self.watch(child)
            else:
                self.restyle(child)

    def watch(self, widget: QWidget) -> None:
        """Style a widget anew when it is shown."""
        widget.removeEventFilter(self)  # it would be asked twice
        widget.installEventFilter(self)

    @override
    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Show and isinstance(watched, QWidget):
            watched.removeEventFilter(self)
            self.restyle(watched)
        return False


def restyle_shown(app: QApplication) -> None:
    """Have every widget take its colours from the palette in force; GUI thread."""
    found = app.findChild(RestyleWhenShown, _RESTYLE_NAME)
    later = found if isinstance(found, RestyleWhenShown) else RestyleWhenShown(app)
    for window in app.topLevelWidgets():
        if window.isHidden():
            later.watch(window)
        else:
            later.restyle(window)
