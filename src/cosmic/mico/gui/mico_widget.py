"""`MicoWidget`: the MiCo panel, all positioners in their groups (thesis 6.1.4)."""

import logging
from collections.abc import Callable
from functools import partial

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QStackedWidget, QVBoxLayout, QWidget

from cosmic.frame.application import CosmicApplicationBase
from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.screen_fit import FittedPanel
from cosmic.frame.gui.theme import State
from cosmic.frame.operation import Task
from cosmic.mico.api.application_base import MicoApplicationBase
from cosmic.mico.api.mico import Mico, mico_of
from cosmic.mico.api.news import AxesStarted, MovementNews
from cosmic.mico.core.motion.links import Link
from cosmic.mico.core.motion.settings import PositionerSettings
from cosmic.mico.core.settings import GroupSettings, MicoSettings
from cosmic.mico.gui.axis_commands import ConsentRequest
from cosmic.mico.gui.axis_table import AxisTable
from cosmic.mico.gui.closed_loop_gui import ClosedLoopGUI
from cosmic.mico.gui.collision_status import CollisionStatus
from cosmic.mico.gui.columns import GroupColumns, arranged_groups
from cosmic.mico.gui.consent_dialogs import CautionDialog, ConsentDialog
from cosmic.mico.gui.device_gui import DeviceGUI
from cosmic.mico.gui.initialisation_panel import make_initialisation_panel
from cosmic.mico.gui.jog_keys import JogKey, JogKeys
from cosmic.mico.gui.key_names import key_text
from cosmic.mico.gui.mico_header import MicoHeader
from cosmic.mico.gui.positioner_gui import PositionerBaseGUI
from cosmic.mico.gui.qt_application import qt_application
from cosmic.mico.gui.registry import gui_class
from cosmic.mico.gui.state_feed import StateFeed
from cosmic.mico.gui.undo_gui import UNDO_KEY, UndoGui
from cosmic.mico.hw.interface import PositionerKind


def join_links(card: ClosedLoopGUI, mico: Mico) -> None:
    """Have the switch of a card link its axis and unlink it."""
    name = card.settings.name

    def link(other: str, ratio: float) -> None:
        try:
            mico.link(name, other, ratio)
        except CosmicError as exc:
            card.say_refused(str(exc))

    def unlink() -> None:
        mico.unlink(name)

    card.link_wanted.connect(link)
    card.unlink_wanted.connect(unlink)


def show_links(card: ClosedLoopGUI, mico: Mico) -> None:
    """Show on a card what its axis is linked with."""
    axis = card.axis
    others = [
        each.key
        for each in mico
        if each.key != axis.key
        and each.kind is axis.kind
        and each.kind is not PositionerKind.OPEN_LOOP
    ]
    card.show_links(axis.linked_to, others)


logger = logging.getLogger(__name__)


class MicoWidget(QWidget):
    """Everything an operator needs to move the positioners; GUI thread.

    Parameters
    ----------
    mico : Mico
        What it commands; its source should be "window".

    Signals
    -------
    initialisation_begun()
        The initialisation sequence was begun here.
    failure_changed(str)
        Why MiCo cannot work; empty when it can.
    refreshed()
        There may be other devices now.
    verdict_given(MoveVerdict)
        A command of this panel was refused, or a jog stopped in front of something.
    busy_refused(str)
        A command of this panel was refused as something else moves the axes; with what.
    refusal_over(str)
        What was refused for that axis holds no longer: it has moved since.
    undo_planned(object)
        The poses that Undo leads through, while it is asked about or under way; None afterwards.
    detour_wanted(DetourRequest)
        Something stands in the way of a move, while detours are planned.
    """

    initialisation_begun = Signal()
    failure_changed = Signal(str)
    refreshed = Signal()
    verdict_given = Signal(object)
    busy_refused = Signal(str)
    refusal_over = Signal(str)
    undo_planned = Signal(object)
    detour_wanted = Signal(object)

    def __init__(self, mico: Mico, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("MicoWidget")
        self._mico = mico
        self._application = mico.application
        self._cards: dict[str, PositionerBaseGUI] = {}
        self._shape: list[tuple[str, str]] = []
        self._dialog: ConsentDialog | None = None
        self._caution: CautionDialog | None = None
        self._plans_detours = False
        self._busy: Callable[[], str] = str
        self._stopped: str | None = None
        self._collision = CollisionStatus(mico)
        self._outline: tuple[object, ...] = ()
        self._links: tuple[Link, ...] = ()
        self._changes = Relay(self._on_change)
        self._movements = Relay(self._on_movement)
        self._header = MicoHeader(self._settings.jog)
        self._steps = make_initialisation_panel(mico)
        self._steps.hide()
        self._undoing = UndoGui(mico, self)
        self._columns = GroupColumns()
        self._table = AxisTable(self)
        self._table.hide()
        self._feed = StateFeed(mico, self)
        self._keys = JogKeys(qt_application(), self._header.speed, self)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self._header)
        column.addWidget(self._steps)
        self._pages = QStackedWidget()
        self._pages.addWidget(self._columns)
        column.addWidget(self._pages, 1)
        self._connect()
        self.refresh()

    def _connect(self) -> None:
        self._header.initialise_requested.connect(self.initialise)
        self._header.rescan_requested.connect(self.rescan)
        self._header.undo_requested.connect(self._undoing.undo)
        self._header.steps_toggled.connect(self._on_steps_toggled)
        self._steps.begun.connect(self.initialisation_begun)
        self._steps.refused.connect(self._on_refused)
        self._steps.doubted.connect(self._on_initialisation_doubted)
        self._undoing.planned.connect(self.undo_planned)
        self._undoing.said.connect(self._header.set_message)
        self._undoing.available.connect(self._header.set_undo)
        self._undoing.show_available()
        self._collision.changed.connect(self._on_collision_changed)
        application = self._application
        application.task_started.connect(self._on_task_started)
        application.status_changed.connect(self._on_status_changed)
        application.rescanned.connect(self._on_status_changed)
        self._changes.follow(self._mico.on_change)
        self._movements.follow(self._mico.follow_movements)

    @property
    def _settings(self) -> MicoSettings:
        return self._mico.settings  # of a station that is away they come later

    @property
    def mico(self) -> Mico:
        """What it commands."""
        return self._mico

    def _fill_table(self) -> None:
        if self._pages.count() > 1:
            self._table.set_cards(self._cards, self._settings.defaults)

    def offer_table(self) -> None:
        """Show all axes as a table of one row each; a button turns to the cards and back."""
        self._pages.addWidget(FittedPanel(self._table))
        self._table.show()
        self._fill_table()
        self.refresh()
        self._header.offer_cards()
        self._header.cards_toggled.connect(self._on_cards_toggled)
        self._pages.setCurrentIndex(1)

    @property
    def table(self) -> AxisTable:
        """The rows of all axes."""
        return self._table

    def show_cards(self, shown: bool) -> None:
        """Show the cards with every field, or the table."""
        self._header.show_cards(shown)
        self._on_cards_toggled(shown)

    def _on_cards_toggled(self, shown: bool) -> None:
        self._pages.setCurrentIndex(0 if shown or self._pages.count() == 1 else 1)

    @property
    def collision(self) -> CollisionStatus:
        """What is watched for collisions."""
        return self._collision

    @property
    def cards(self) -> dict[str, PositionerBaseGUI]:
        """The cards by the name of their axis."""
        return dict(self._cards)

    @property
    def groups(self) -> list[DeviceGUI]:
        """The groups in the order shown."""
        return self._columns.groups

    @property
    def dialog(self) -> ConsentDialog | None:
        """The question that waits for an answer."""
        return self._dialog

    @property
    def caution(self) -> CautionDialog | None:
        """The question before an initialisation that could lose something."""
        return self._caution

    def ask_while(self, doubt: Callable[[], str]) -> None:
        """Have Undo and Initialise ask first, too, while `doubt` returns a reason."""
        self._undoing.doubt = self._steps.doubt = doubt

    def refuse_while(self, busy: Callable[[], str]) -> None:
        """Have keys, buttons, fields and input devices move nothing while `busy` says why."""
        self._busy = self._application.busy = busy
        for card in self._cards.values():
            card.commands.busy = busy

    @property
    def busy(self) -> str:
        """Why the operator moves nothing now; empty where nothing speaks against it."""
        return self._busy()

    @property
    def undoing(self) -> UndoGui:
        """What takes the last movement back."""
        return self._undoing

    def keys(self) -> list[tuple[str, str]]:
        """Return the keys that jog, and what each moves, and that of Undo."""
        jogs = [
            (key, f"{each.name}: {text} while held")
            for each in self._settings.positioner
            for key, text in (
                (key_text(each.backward_key), each.backward_text),
                (key_text(each.forward_key), each.forward_text),
            )
            if key
        ]
        return [*jogs, (UNDO_KEY, "take the last movement back, through the gate")]

    def release_keys(self) -> None:
        """Let go of every key that jogs."""
        self._keys.release_all()

    def show_stopped(self, reason: str | None) -> None:
        """Show on every card that the stop is latched, and why; None: no longer."""
        self._stopped = reason
        for card in self._cards.values():
            card.show_stopped(reason)

    def set_planning_detours(self, on: bool) -> None:
        """Ask with `detour_wanted` instead of refusing a move that something blocks."""
        self._plans_detours = on
        for card in self._cards.values():
            card.commands.plans_detours = on

    # What there is

    def refresh(self) -> None:
        """Show what there is now; makes the cards anew where axes or their kinds changed."""
        try:
            self._refresh()
        except CosmicError as exc:
            # A rescan takes the devices apart in its own thread; its end brings us here again.
            logger.debug("the panel waits for the end of a rescan: %s", exc)

    def _refresh(self) -> None:
        shape = [(name, self._mico[name].kind.value) for name in self._mico.names]
        if shape != self._shape:
            self._rebuild()
            self._shape = shape
        self._feed.clear()
        for group in self._columns.groups:
            for name, card in group.cards.items():
                self._feed.add(name, card)
                self._feed.add(name, group)
        for name, row in self._table.rows.items():
            self._feed.add(name, row)
        self._header.set_missing(self._mico.missing)
        self._steps.preview()
        self._on_links_changed()
        self.failure_changed.emit(self._application.failure)
        self.refreshed.emit()

    def _rebuild(self) -> None:
        self._keys.set_keys({})
        if self._dialog is not None:
            self._dialog.close()  # its question is about a card that goes
        self._cards = {}
        groups = [self._make_group(each) for each in arranged_groups(self._mico)]
        self._columns.set_groups(groups)
        self._fill_table()
        self._keys.set_keys(self._jog_keys())
        self._on_collision_changed()

    def _make_group(self, arranged: GroupSettings) -> DeviceGUI:
        group = DeviceGUI(arranged.title)
        for name in arranged.positioners:
            axis = self._mico[name]
            make_card = gui_class(axis.kind, axis.details.positioner)
            card = make_card(axis, self._settings_of(name), self._settings.defaults)
            card.consent_wanted.connect(self._on_consent_wanted)
            card.commands.verdict_given.connect(self.verdict_given)
            card.commands.refusal_over.connect(partial(self.refusal_over.emit, name))
            card.commands.detour_wanted.connect(self.detour_wanted)
            card.commands.plans_detours = self._plans_detours
            card.commands.busy = self._busy
            card.commands.busy_refused.connect(self.busy_refused)
            card.show_stopped(self._stopped)
            if isinstance(card, ClosedLoopGUI):
                join_links(card, self._mico)
            self._cards[name] = card
            group.add(card)
        return group

    def _settings_of(self, name: str) -> PositionerSettings:
        for each in self._settings.positioner:
            if each.name == name:
                return each
        return self._mico[name].settings

    def _jog_keys(self) -> dict[str, JogKey]:
        keys: dict[str, JogKey] = {}
        for card in self._cards.values():
            for name, direction in (
                (card.settings.forward_key, 1),
                (card.settings.backward_key, -1),
            ):
                if name:
                    keys[key_text(name)] = JogKey(card, direction)
        return keys

    def _on_status_changed(self) -> None:
        self.refresh()

    def _on_change(self) -> None:
        mico = self._mico
        try:
            outline = (mico.names, mico.missing, mico.failure, mico.ready)
            links = mico.links
        except CosmicError as exc:
            logger.debug("the panel waits for the end of a rescan: %s", exc)
            return
        if outline != self._outline:
            self._outline = outline
            self.refresh()
        elif links != self._links:
            self._on_links_changed()

    def _on_collision_changed(self) -> None:
        unwatched, model = self._collision.unwatched, self._collision.has_model
        for name, card in self._cards.items():
            card.show_detection(model=model, watched=name not in unwatched)

    def _on_links_changed(self) -> None:
        self._links = self._mico.links
        for card in self._cards.values():
            if isinstance(card, ClosedLoopGUI):
                show_links(card, self._mico)

    def _on_movement(self, news: MovementNews) -> None:
        if isinstance(news, AxesStarted):
            count, skew_ms = len(news.names), news.skew_ms
            self._header.set_message(f"{count} axes started within {skew_ms:.1f} ms")

    def _on_refused(self, why: str) -> None:
        self._header.set_message(why, State.REFUSED)

    # Long operations

    def initialise(self) -> None:
        """Begin the initialisation sequence and show its steps, as the button does."""
        self._header.set_steps_shown(True)
        self._steps.start()

    def _on_initialisation_doubted(self, doubts: tuple[str, ...]) -> None:
        if self._caution is not None:
            self._caution.raise_()
            return
        caution = CautionDialog(
            "Initialise",
            "The initialisation drives every axis to its reference.",
            doubts,
            "Initialise anyway",
            self._steps.start_anyway,
            self,
        )
        caution.destroyed.connect(self._on_caution_destroyed)
        self._caution = caution
        caution.show()

    def _on_caution_destroyed(self) -> None:
        self._caution = None

    def _on_steps_toggled(self, shown: bool) -> None:
        self._steps.setVisible(shown)
        if shown:
            self._steps.preview()

    def rescan(self) -> None:
        """Begin to look for the devices again, as the button does."""
        try:
            self._mico.rescan(wait=False)
        except NotAvailable as exc:
            self._header.set_message(str(exc), State.REFUSED)

    def _on_task_started(self, task: Task) -> None:
        self._header.follow(task)

    # Consent

    def _on_consent_wanted(self, request: ConsentRequest) -> None:
        if self._dialog is not None:
            self._dialog.close()
        dialog = ConsentDialog(request, self)
        dialog.initialise_requested.connect(self.initialise)
        dialog.destroyed.connect(self._on_dialog_destroyed)
        self._dialog = dialog
        dialog.show()

    def _on_dialog_destroyed(self) -> None:
        self._dialog = None


def make_mico_gui(application: CosmicApplicationBase) -> MicoWidget:
    """Return the GUI component of a `MicoApplicationBase`; its `gui_factory`."""
    if not isinstance(application, MicoApplicationBase):
        raise TypeError(f"{application!r} is not a MicoApplication")
    return MicoWidget(mico_of(application, "window"))
