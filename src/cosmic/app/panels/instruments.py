"""Where the panels of vision and acquisition stand at a first start."""

from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import Qt

from cosmic.app.platform import Platform
from cosmic.daqco.gui.main_widget import UDaqMainWidget
from cosmic.frame.gui.server_gui import CosmicServerGui
from cosmic.vico.gui.vico_gui import VicoGui

DAQCO: Final = "Force channels"
LENS: Final = "Lens and light"
NARROW_SCREEN_PX: Final = 1600
LOW_SCREEN_PX: Final = 1000
_WITH_IMAGE: Final = [5, 5, 4]
_WITH_SCENE: Final = [3, 2]
"""How panels beside each other share the width at a first start."""
_SHARES: Final = [1, 1]
"""How scene and force share their column."""
_ABOVE_LENS: Final = [3, 1]
"""How image and lens share theirs."""
_WITH_LENS: Final = [3, 1]
"""How image and lens share the width where they stand alone."""


@dataclass(frozen=True)
class Instruments:
    """The panels of vision and acquisition, as far as there are any."""

    images: VicoGui | None
    force: UDaqMainWidget | None

    @property
    def panels(self) -> dict[str, list[str]]:
        """The titles of the panels, by application."""
        found: dict[str, list[str]] = {}
        if self.force is not None:
            found["daqco"] = [DAQCO]
        if self.images is not None and self.images.cameras:
            titles = [view.windowTitle() for view in self.images.cameras.values()]
            found["vico"] = [*titles, LENS]
        return found

    def add_force(self, window: CosmicServerGui) -> None:
        """Add the panel of acquisition alone, wherever the window lays it out."""
        if self.force is not None:
            window.add_panel(DAQCO, self.force, scroll=False)
            self.force.close_requested.connect(window.dock(DAQCO).close)

    def place(self, window: CosmicServerGui, scene: str, left: str) -> str:
        """Add them to the window, and share its width out; return the first image's title.

        Parameters
        ----------
        scene, left : str
            Titles of the panel with the scene and of the one at the left; "" where there is none.
        """
        low = window.screen().availableGeometry().height() < LOW_SCREEN_PX
        first = add_instruments(window, self.images, self.force, scene, low=low)
        behind = window.tabifiedDockWidgets(window.dock(first)) if first else []
        aside = scene if scene and window.dock(scene) not in behind else ""
        columns = [title for title in (left, first, aside) if title]
        shares = _WITH_IMAGE if first else _WITH_SCENE
        window.share_out(columns, shares[: len(columns)], Qt.Orientation.Horizontal)
        return first


def instruments_of(platform: Platform) -> Instruments:
    """Return the panels of a platform's instruments; they are made now."""
    vision = platform.vico.get_gui() if platform.vico is not None else None
    force = platform.daqco.get_gui() if platform.daqco is not None else None
    return Instruments(
        vision if isinstance(vision, VicoGui) else None,
        force if isinstance(force, UDaqMainWidget) else None,
    )


def add_instruments(
    window: CosmicServerGui,
    images: VicoGui | None,
    force: UDaqMainWidget | None,
    scene: str,
    *,
    low: bool,
) -> str:
    """Put the image between the actuators and the scene, lens and force below these two.

    Parameters
    ----------
    scene : str
        Title of the scene's panel; "" where there is none.
    low : bool
        The screen is too low for two panels above each other: they share a tab.

    Returns
    -------
    str
        Title of the first camera's panel; "" where there is none.
    """
    views = list(images.cameras.values()) if images is not None else []
    first = views[0].windowTitle() if views else ""
    if first:
        window.add_panel(first, views[0], Qt.DockWidgetArea.RightDockWidgetArea, scroll=False)
    if first and scene:
        image, other = window.dock(first), window.dock(scene)
        if window.screen().availableGeometry().width() < NARROW_SCREEN_PX:
            window.tabifyDockWidget(image, other)
        else:
            window.splitDockWidget(image, other, Qt.Orientation.Horizontal)
    if force is not None:
        _add_force(window, force, first or scene if low else scene or first, low=low)
    if first and images is not None:
        _add_lens(window, images, first, scene, low=low)
    # Only now, for a dock that has tabs cannot be divided any more.
    for view in views[1:]:
        window.add_panel(view.windowTitle(), view, scroll=False, beside=first, tabbed=True)
    for title in (scene, first):
        if title:
            window.dock(title).raise_()
    return first


def _add_force(window: CosmicServerGui, gui: UDaqMainWidget, above: str, *, low: bool) -> None:
    area = Qt.DockWidgetArea.RightDockWidgetArea
    window.add_panel(DAQCO, gui, area, scroll=False, below=above, tabbed=low and bool(above))
    if above and not low:
        window.share_out((above, DAQCO), _SHARES, Qt.Orientation.Vertical)
    gui.close_requested.connect(window.dock(DAQCO).close)


def _add_lens(window: CosmicServerGui, gui: VicoGui, first: str, scene: str, *, low: bool) -> None:
    if low and scene:
        window.add_panel(LENS, gui.lens, beside=scene, tabbed=True)
    elif scene:
        window.add_panel(LENS, gui.lens, below=first)
        window.share_out((first, LENS), _ABOVE_LENS, Qt.Orientation.Vertical)
    else:
        window.add_panel(LENS, gui.lens, beside=first)
        window.share_out((first, LENS), _WITH_LENS, Qt.Orientation.Horizontal)
