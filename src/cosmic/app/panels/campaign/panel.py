"""The panel "Campaign": a recipe is chosen and run; its procedure, its fibres, one fibre's card."""

import logging
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Final

from PySide6.QtCore import QTimer, Signal
from PySide6.QtWidgets import QComboBox, QLineEdit, QTabWidget, QVBoxLayout, QWidget

from cosmic.app.panels.campaign.board import CampaignBoard
from cosmic.app.panels.campaign.fibre_card import FibreCard
from cosmic.app.panels.campaign.output import write_output
from cosmic.app.panels.procedure import ProcedurePort, ProcedureTreePanel
from cosmic.autonomy.campaign.campaign import Campaign, CampaignPhase
from cosmic.autonomy.campaign.recipe import Recipe, load_recipe, shipped_recipes
from cosmic.autonomy.campaign.records import FibreRecord
from cosmic.autonomy.campaign.snapshot import card_of, snapshot_of
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.autonomy.procedures.combinators import outline_of
from cosmic.autonomy.procedures.run import RunState
from cosmic.autonomy.procedures.tree import NodeView, ProcedureTreeState
from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.gui.ask_directory import ask_directory, ask_open_file
from cosmic.frame.gui.beside import open_with_desktop
from cosmic.frame.gui.build import named, push_button, retip, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.flow_layout import FlowLayout
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.screen_fit import FittedPanel
from cosmic.frame.gui.theme import STEP_PX, State, state_look
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.operation import Operation
from cosmic.frame.overrides import override

logger = logging.getLogger(__name__)

_STATES: Final = {
    CampaignPhase.READY: RunState.READY,
    CampaignPhase.RUNNING: RunState.RUNNING,
    CampaignPhase.PAUSING: RunState.PAUSING,
    CampaignPhase.PAUSED: RunState.PAUSED,
    CampaignPhase.ENDING: RunState.ABORTING,
    CampaignPhase.ENDED: RunState.DONE,
    CampaignPhase.STOPPED: RunState.ABORTED,
    CampaignPhase.FAILED: RunState.FAILED,
}


class CampaignRun(ProcedurePort):
    """The tree is that of the held fibre; start, pause, step and abort are of the whole."""

    def __init__(self, campaign: Campaign) -> None:
        self.campaign = campaign
        root = campaign.procedure.root
        self._waiting = ProcedureTreeState(outline_of(root), campaign.work.clock).snapshot()

    @property
    @override
    def name(self) -> str:
        done = self.campaign.progress.done
        return f"{self.campaign.recipe.name}, fibre {done + 1}"

    @property
    @override
    def state(self) -> RunState:
        return _STATES[self.campaign.phase]

    @property
    @override
    def failure(self) -> Exception | None:
        campaign = self.campaign
        return CosmicError(campaign.end_reason) if campaign.unfinished else None

    @property
    @override
    def not_safe(self) -> str:
        run = self.campaign.run
        return run.not_safe if run is not None else ""

    @property
    @override
    def tree(self) -> NodeView:
        run = self.campaign.run
        return run.tree if run is not None else self._waiting

    @override
    def on_change(self, listener: Callable[[], object]) -> Callable[[], None]:
        return self.campaign.on_change(listener)

    @override
    def start(self) -> None:
        self.campaign.start()

    @override
    def pause(self) -> None:
        self.campaign.pause()

    @override
    def resume(self) -> None:
        self.campaign.resume()

    @override
    def step(self) -> None:
        if self.campaign.phase is CampaignPhase.READY:
            self.campaign.start()
            self.campaign.pause()
        else:
            self.campaign.step()

    @override
    def abort(self, reason: str = "aborted") -> None:
        self.campaign.abort(reason)

    @override
    def join(self) -> None:
        self.campaign.join()


OTHER: Final = "another file…"
PERIOD_MS: Final = 500
_FIRST: Final = "quick"

Open = Callable[[Recipe | Path, Path], Campaign]


class CampaignPanel(QWidget):
    """Runs campaigns on the platform of the window; GUI thread.

    Parameters
    ----------
    open_campaign : callable
        Returns a campaign by a recipe in a folder, ready to start.
    folder : Path
        Where folders of campaigns are made.
    policy : FailurePolicy
        Told of a defect while a report is written.

    Signals
    -------
    replay_requested(FibreRecord)
        The operator wants to see the movements of a fibre.
    opened()
        A campaign is about to begin, or to go on.
    """

    replay_requested = Signal(object)
    opened = Signal()

    def __init__(
        self,
        open_campaign: Open,
        folder: Path,
        policy: FailurePolicy,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("CampaignPanel")
        self._open = open_campaign
        self._home = folder
        self._policy = policy
        self._writing: JobQueue | None = None
        self._written: Path | None = None
        self._to_open = False
        self.open_file: Callable[[Path], object] = open_with_desktop
        self._campaign: Campaign | None = None
        self._card: FibreRecord | None = None
        self._recipe = _FIRST
        self._changed_relay = Relay(self._on_changed)
        self._written_relay = Relay(self._on_written)
        self._make_widgets()
        self._arrange()
        self._redraw = QTimer(self, interval=PERIOD_MS, singleShot=True)
        self._redraw.timeout.connect(self.refresh)
        self._connect()
        self._suggest_folder()

    def _make_widgets(self) -> None:
        self.recipe = named(tipped(QComboBox(), "Recipe: how each fibre is treated"), "recipe")
        self.recipe.addItems([*sorted(shipped_recipes()), OTHER])
        self.recipe.setCurrentText(_FIRST)
        self.folder = named(QLineEdit(), "campaignFolder")
        self.folder.setToolTip("Output folder. An existing campaign in it is resumed.")
        self.choose = named(push_button("Folder…", "Choose the output folder"), "chooseFolder")
        self.report = named(
            push_button("Report", "Write the report and the table of the fibres so far"), "report"
        )
        self.plate = named(
            push_button("Plate is there", "Confirm the plate that is asked for"), "plateIsThere"
        )
        self.about = named(ElidedLabel(), "campaignAbout")
        self.about.set_dim(True)
        self.message = named(ElidedLabel(), "campaignMessage")
        self.procedure = ProcedureTreePanel(self._make_run, self._go_on)
        self.board = CampaignBoard()
        self.card = FibreCard()
        self.report.setEnabled(False)
        self.plate.hide()

    def _arrange(self) -> None:
        head, flow = QWidget(), FlowLayout(STEP_PX)
        head.setLayout(flow)
        for widget in (self.recipe, self.choose, self.report, self.plate):
            flow.addWidget(widget)
        self.tabs = QTabWidget()
        self.tabs.addTab(self.procedure, "Procedure")
        self.tabs.addTab(FittedPanel(self.board), "Fibres")
        self.tabs.addTab(FittedPanel(self.card), "Fibre")
        whole = QVBoxLayout(self)
        whole.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        whole.setSpacing(STEP_PX)
        whole.addWidget(head)
        whole.addWidget(self.about)
        whole.addWidget(self.folder)
        whole.addWidget(self.message)
        whole.addWidget(self.tabs, 1)
        whole.addWidget(self.procedure.buttons)  # whichever page is in front
        room = self.message.sizePolicy()
        room.setRetainSizeWhenHidden(True)  # what is below stays where it is clicked
        self.message.setSizePolicy(room)
        self.message.setFixedHeight(self.message.fontMetrics().height() + STEP_PX // 2)
        self.message.hide()

    def _connect(self) -> None:
        self.recipe.activated.connect(self._on_recipe)
        self.choose.clicked.connect(self._on_choose)
        self.report.clicked.connect(self.write_report)
        self.plate.clicked.connect(self.confirm_plate)
        self.message.clicked.connect(self._open_written)
        self.procedure.refused.connect(lambda: self.tabs.setCurrentWidget(self.procedure))
        self.card.replay_requested.connect(self._on_replay)
        self.board.fibre_chosen.connect(self.show_fibre)

    @property
    def campaign(self) -> Campaign | None:
        """The one that runs, or ran last."""
        return self._campaign

    # Choosing

    def _on_recipe(self) -> None:
        if self.recipe.currentText() == OTHER:
            self.recipe.setCurrentText(self._recipe)  # nothing else is chosen by a cancel
            ask_open_file(
                self, "Recipe", str(self._home), files="Recipes (*.toml)", chosen=self.use_recipe
            )
            return
        self._suggest_folder()

    def use_recipe(self, path: str) -> None:
        """Offer the recipe in a file, and choose it."""
        if self.recipe.findText(path) < 0:
            self.recipe.insertItem(0, path)
        self.recipe.setCurrentText(path)
        self._suggest_folder()

    def _suggest_folder(self) -> None:
        self._recipe = self.recipe.currentText()
        self._show_about()
        name = Path(self.recipe.currentText()).stem
        self.folder.setText(str(self._home / f"{name}-{datetime.now():%Y%m%d-%H%M%S}"))

    def _show_about(self) -> None:
        """Say what the chosen recipe does, or what is wrong with it."""
        chosen = Path(self.recipe.currentText())
        retip(self.recipe, f"Recipe: how each fibre is treated\n{chosen}")
        name = f"{chosen.name}: " if chosen.name != str(chosen) else ""  # the path is cut off
        try:
            self.about.set_text(f"{name}{load_recipe(chosen).file.description}")
        except CosmicError as exc:
            self.about.set_text(str(exc))

    def _on_choose(self) -> None:
        ask_directory(self, "Output folder", str(self._home), self.folder.setText)

    # Running

    def _make_run(self) -> ProcedurePort:
        """Return a campaign that is ready to begin; the tree shows why there is none."""
        before = self._campaign
        if before is not None and before.unfinished and not self.folder.isModified():
            self._suggest_folder()  # Resume goes on in that of before; this one is new
        self._show_about()  # the file may be another one by now
        return self._opened(Path(self.recipe.currentText()), self._chosen_folder())

    def _chosen_folder(self) -> Path:
        """Return the folder in the field; a relative one lies where campaigns are made."""
        typed = self.folder.text().strip()
        if not typed:
            raise CosmicError("no output folder is named: type one, or choose it by Folder…")
        return self._home / typed

    def _go_on(self) -> ProcedurePort:
        """Return the campaign that ended early, ready to go on: its recipe, in its folder."""
        before = self._campaign
        if before is None:
            raise CosmicError("there is no campaign to resume: start one")
        return self._opened(before.recipe, before.store.folder)

    def _opened(self, recipe: Recipe | Path, folder: Path) -> ProcedurePort:
        before = self._campaign
        if before is not None and not before.over:
            raise CosmicError("a campaign is running: end it first")
        campaign = self._open(recipe, folder)
        campaign.on_change(self._changed_relay)
        self._campaign = campaign
        self.folder.setText(str(folder))
        self._say("")
        self.refresh()
        self.opened.emit()
        return CampaignRun(campaign)

    def _on_changed(self) -> None:
        if not self._redraw.isActive():
            self._redraw.start()

    def refresh(self) -> None:
        """Show the campaign as it is now."""
        campaign = self._campaign
        running = campaign is not None and not campaign.over
        for widget in (self.recipe, self.folder, self.choose):
            widget.setEnabled(not running)
        self.report.setEnabled(campaign is not None and self._writing is None)
        if campaign is None:
            return
        self._show_request(campaign.request)
        self.board.set_state(
            snapshot_of(
                campaign.recipe.name,
                str(campaign.phase),
                campaign.fibres,
                campaign.progress,
                left_s=campaign.left_s,
                operation=campaign.operation,
                reason=campaign.end_reason,
            )
        )
        if campaign.over and not campaign.unfinished and not self.folder.isModified():
            self._suggest_folder()
        if campaign.unfinished and not self.message.toolTip():
            self.message.set_text(
                f"Resume goes on in {campaign.store.folder.name}; Start begins a new one beside it"
            )
            self.message.show()

    def _show_request(self, request: str) -> None:
        if request and not self.plate.isVisibleTo(self):
            self._say(request, State.BUSY)
        elif not request and self.plate.isVisibleTo(self):
            self._say("")
        self.plate.setVisible(bool(request))

    def confirm_plate(self) -> None:
        """Say that the plate is on the table which the campaign asks for."""
        if self._campaign is None:
            return
        try:
            self._campaign.confirm_plate()
        except CosmicError as exc:
            self._say(str(exc))

    # Looking at what there is

    def show_fibre(self, number: int) -> None:
        """Show the card of a fibre."""
        campaign = self._campaign
        if campaign is None:
            return
        try:
            record = CampaignReader(campaign.store.folder).fibre(number)
        except CosmicError as exc:
            self._say(str(exc))
            return
        self._card = record
        self.card.set_card(card_of(record))
        self.tabs.setCurrentIndex(2)

    def _on_replay(self, number: int) -> None:
        if self._card is not None and self._card.number == number:
            self.replay_requested.emit(self._card)

    def write_report(self) -> None:
        """Begin to write report and table of the campaign as it stands; returns at once."""
        campaign = self._campaign
        if campaign is None or self._writing is not None:
            return
        folder, wanted = campaign.store.folder, campaign.recipe.file.output
        self._say("writing the report", State.BUSY)
        self._writing = JobQueue("campaign report", self._policy)
        written = self._writing.submit(lambda: write_output(folder, wanted), "the report")
        written.add_callback(self._written_relay)
        self.refresh()

    def show_report(self) -> None:
        """Begin to write the report, and open it when it is written; returns at once."""
        self._to_open = self._campaign is not None
        self.write_report()

    def _open_written(self) -> None:
        if self._written is not None:
            self.open_file(self._written)

    def _on_written(self, written: Operation[list[Path]]) -> None:
        self._end_writing()
        to_open, self._to_open = self._to_open, False
        if written.failure is None:
            files = ", ".join(str(each) for each in written.result)
            self._say(f"written, a click opens it: {files}", State.OK)
            self._written = next(iter(written.result), None)
            if to_open:
                self._open_written()
        else:
            self._say(str(written.failure))
        self.refresh()

    def _end_writing(self) -> None:
        writing, self._writing = self._writing, None
        if writing is not None:
            writing.request_end()
            writing.join()

    def _say(self, text: str, state: State = State.REFUSED) -> None:
        self._written = None  # the line tells of something else now
        self.message.set_text(f"{state_look(state).glyph} {text}" if text else "")
        self.message.setVisible(bool(text))

    # Leaving

    def shut_down(self) -> None:
        """End what runs, in order: it can be gone on with."""
        campaign = self._campaign
        if campaign is not None and not campaign.over:
            campaign.abort("the window was closed")
            campaign.join()
        self._end_writing()
