"""`Rig`: the whole platform, as scripts and the console see it."""

import atexit
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from types import TracebackType
from typing import TYPE_CHECKING, Any, Final, Self, TypeVar, cast
from weakref import WeakSet

from typing_extensions import override

from cosmic.app.platform import Platform, stopped_since
from cosmic.app.simulation import SimulationFaults
from cosmic.app.stations.remote_station import RemoteStation, StationControl
from cosmic.autonomy.control.control import Control
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.procedures.run import ProcedureRun, RunState
from cosmic.daqco.api.daqco import Daqco, daqco_of
from cosmic.frame.arguments import check_named, checked_class
from cosmic.frame.declaration import Declared
from cosmic.frame.errors import NotAvailable
from cosmic.frame.forked import FORKED, Owner
from cosmic.mico.api.mico import Mico, mico_of
from cosmic.vico.api.vico import Vico, vico_of

if TYPE_CHECKING:
    from cosmic.autonomy.calibrating.registry import CalibrationRegistry
    from cosmic.autonomy.campaign.campaign import Campaign
    from cosmic.autonomy.campaign.recipe import Recipe
    from cosmic.autonomy.handling.context import HandlingContext
    from cosmic.autonomy.handling.marked import MarkedFibre
    from cosmic.autonomy.handling.plate_change import PlateHandler
    from cosmic.autonomy.handling.settings import HandlingSettings
    from cosmic.autonomy.recorded.steps import RecordedProcedure
    from cosmic.autonomy.shipped.fibre_handling import FibreHandling

W = TypeVar("W")

A_CAMPAIGN: Final = "a campaign"


@dataclass(slots=True, eq=False)
class SharedRuns:
    """What runs on a platform, for all who command it in this program."""

    runs: "WeakSet[ProcedureRun[object] | Campaign]" = field(default_factory=WeakSet)
    handling: "FibreHandling | None" = None
    control: Control | None = None
    closed: bool = False
    lock: Lock = field(default_factory=Lock)


@checked_class
class Rig:
    """The whole platform, as scripts and the console see it; any thread.

    As a context manager it closes at the end of the block: everything stops, the hold is
    released, all threads end.
    """

    def __init__(
        self,
        platform: Platform,
        source: str = "script",
        *,
        at_end: ExitStack | None = None,
        shared: SharedRuns | None = None,
    ) -> None:
        self._platform, self._at_end = platform, at_end or ExitStack()
        self._mico = mico_of(platform.mico, source) if platform.mico is not None else None
        self._daqco = daqco_of(platform.daqco) if platform.daqco is not None else None
        self._vico = vico_of(platform.vico) if platform.vico is not None else None
        self._shared, self._first = shared or SharedRuns(), shared is None
        self._control: Control | None = None
        if self._mico is not None and self._shared.control is not None:
            self._control = self._shared.control.commanding_by(self._mico)
        elif self._mico is not None:
            self._control = self._shared.control = Control(
                self._mico,
                self._daqco,
                platform.file.control,
                platform.policy,
                rate=platform.clock.rate,
            )
        self._handling: FibreHandling | None = None
        self._owner = Owner()

    def commanding_as(self, source: str) -> "Rig":
        """Return the same rig, whose movements are logged by another name, such as "console".

        What runs by one of them runs for the other too. The platform is closed by the first alone:
        closing this one does nothing.
        """
        return Rig(self._platform, source, shared=self._shared)

    @override
    def __repr__(self) -> str:
        kind = "simulated" if self.simulated else "real hardware"
        return f"<Rig {self._platform.file.platform.name!r}, {kind}>"

    @property
    def simulated(self) -> bool:
        """True when no hardware moves."""
        return self._platform.simulated

    @property
    def mico(self) -> Mico:
        """Micromanipulation; raises `NotAvailable` where it is not hosted."""
        self._check_owner()
        if self._mico is None:
            raise NotAvailable("mico is not hosted here; name it in the platform file")
        return self._mico

    @property
    def daqco(self) -> Daqco:
        """Data acquisition; raises `NotAvailable` where it is not hosted."""
        self._check_owner()
        if self._daqco is None:
            raise NotAvailable("daqco is not hosted here; name it in the platform file")
        return self._daqco

    @property
    def vico(self) -> Vico:
        """Vision; raises `NotAvailable` where it is not hosted."""
        self._check_owner()
        if self._vico is None:
            raise NotAvailable("vico is not hosted here; name it in the platform file")
        return self._vico

    @property
    def control(self) -> Control:
        """Control loops; raises `NotAvailable` where mico is not hosted."""
        self._check_owner()
        if self._control is None:
            raise NotAvailable("mico is not hosted here; a control loop needs axes")
        return self._control

    def application(self, name: str, kind: type[Declared] | None = None) -> Any:
        """Return an application of another package, as it offers itself to scripts.

        Parameters
        ----------
        name : str
            What the platform file calls it.
        kind : type or None
            What it declares, to use one that runs at a station.

        Raises
        ------
        NotAvailable
            None of that name runs here; the text says why, or which there are.
        """
        if name in self._platform.others:
            return self._platform.others[name].interface
        if name in self._platform.failed:
            raise NotAvailable(self._platform.failed[name])
        if kind is not None:
            found = self._platform.remote.brought(name, kind, self._platform.policy)
            if found is not None:
                return found
        there = ", ".join(self._platform.others) or "none"
        raise NotAvailable(
            f"application {name!r} is not hosted here; name it in [platform] applications of the "
            f"platform file. Others that are: {there}. One of a station needs `kind`, its class"
        )

    def campaign(
        self,
        recipe: "Recipe | str | Path",
        folder: str | Path,
        *,
        plates: "PlateHandler | None" = None,
    ) -> "Campaign":
        """Return a campaign that is ready to start: many fibres by one recipe.

        In a folder that holds a campaign by the same recipe it goes on with that one. It ends when
        motion is stopped or the platform closed, and can be gone on with.

        Parameters
        ----------
        recipe : Recipe or path
            A file, or the name of a recipe that ships with CoSMic, such as "bend-test".
        folder : path
            Where records are kept; made where it is not there.
        plates : PlateHandler, optional
            What puts further plates on the table; a person does if None, and the twin by itself.

        Raises
        ------
        ConfigError
            The recipe is wrong, a line for every mistake, or the platform has not what it names.
        CampaignError
            The folder holds another campaign, is in use, or cannot be written.
        ArgumentError
            `recipe` or `folder` is empty, or no file can be called so.
        NotAvailable
            An application is not hosted here, something runs, or the platform is closed.
        """
        self._check_open()
        from cosmic.app.procedures import campaign_on  # loads statistics, which takes a second

        handling = self._shared.handling
        if handling is not None and handling.running:
            raise NotAvailable("an operation on a fibre is running; wait until it has ended")
        if other := self.running:
            raise NotAvailable(f"{other} is running; end it first")
        campaign = campaign_on(self, self._platform, recipe, folder, plates, lambda: self.running)
        self._shared.runs.add(campaign)
        return campaign

    @property
    def calibrations(self) -> "CalibrationRegistry":
        """All calibrations that were made, with residual, age, and whether they may be used.

        Raises
        ------
        NotAvailable
            Cameras and axes do not run in this program.
        """
        from cosmic.app.procedures import registry_of

        return registry_of(self)

    def calibrate(
        self,
        settings: "HandlingSettings | None" = None,
        *,
        anew: Sequence[str] = (),
        zooms: bool = False,
    ) -> "ProcedureRun[HandlingContext]":
        """Return a run that calibrates what is not fresh; begin it by `run_here` or `start`.

        Parameters
        ----------
        settings : HandlingSettings or None
            Which gripper and probe, where, and how good is good enough.
        anew : sequence of str
            Names of calibrations that are measured though they are fresh.
        zooms : bool
            The map at every step of the lens as well.

        Raises
        ------
        NotAvailable
            An application is not hosted here, something runs, or the platform is closed.
        ConfigError
            The platform has not what `settings` names, or there is no such calibration.
        """
        self._check_open()
        from cosmic.app.procedures import calibration_on

        if other := self.running:
            raise NotAvailable(f"{other} is running; end it first")
        procedure, work = calibration_on(self, settings, anew, zooms=zooms)
        run = self._alone(procedure, work)

        def close() -> None:
            if run.over:
                work.close()

        run.on_change(close)
        return run

    @property
    def handling(self) -> "FibreHandling":
        """Fibres handled one operation at a time: take, bring, push, measure, put away, undo.

        Raises
        ------
        NotAvailable
            An application is not hosted here.
        """
        if self._handling is None:
            from cosmic.autonomy.shipped.fibre_handling import FibreHandling

            with self._shared.lock:
                if self._shared.handling is None:
                    made = FibreHandling(self, self._alone, lambda: self.running)
                    self._handling = self._shared.handling = made
                else:
                    self._handling = self._shared.handling.commanding_by(self)
        return self._handling

    def replay(
        self,
        procedure: "RecordedProcedure | str | Path",
        marked: "MarkedFibre | None" = None,
        *,
        folder: str | Path = ".",
        confirm: Callable[[str], bool] | None = None,
    ) -> "ProcedureRun[HandlingContext]":
        """Return a run that replays a recorded procedure; begin it by `run_here` or `start`.

        Parameters
        ----------
        procedure : RecordedProcedure or path
            It, or the file it was saved in.
        marked : MarkedFibre or None
            The fibre it is replayed on; None: where it needs one, the first that is certain.
        folder : path
            Where its recordings go.
        confirm : callable
            Asked in words, in the thread of the run, where a step waits for the operator: whether
            to go on. Needed where one does.

        Raises
        ------
        ConfigError
            The file cannot be read, or a step cannot be carried out here.
        ArgumentError
            `folder` is empty, or no file can be called so.
        NotAvailable
            Something else runs, no fibre is seen, or a step waits for an operator whom nobody asks.
        """
        check_named("folder", folder)
        from cosmic.autonomy.recorded.operations import Surroundings
        from cosmic.autonomy.recorded.replay import mark_one, replay_on
        from cosmic.autonomy.recorded.steps import RecordedProcedure, load_recorded

        if not isinstance(procedure, RecordedProcedure):
            if not isinstance(procedure, str | Path):
                raise TypeError(
                    "procedure must be a recorded procedure or the path of its file, not "
                    f"{type(procedure).__name__}"
                )
            procedure = load_recorded(Path(procedure))
        if procedure.waits and confirm is None:
            raise NotAvailable(
                f"{procedure.name}: {procedure.waits!r} waits for an operator; pass confirm"
            )
        if marked is None and procedure.needs_fibre:
            marked = mark_one(self)
        around = Surroundings(marked, folder=lambda: Path(folder))
        if confirm is not None:
            around.ask(confirm)
        return replay_on(self.handling, procedure, around)

    @property
    def running(self) -> str:
        """Which campaign or procedure runs here, in words; empty for none."""
        if not self._shared.runs:
            return ""
        from cosmic.autonomy.campaign.campaign import Campaign, CampaignPhase

        for each in list(self._shared.runs):
            if isinstance(each, Campaign):
                if not each.over and each.phase is not CampaignPhase.READY:
                    return A_CAMPAIGN
            elif not each.over and each.state is not RunState.READY:
                return each.name
        return ""

    @property
    def driving(self) -> str:
        """Which of them moves axes by itself at the moment; empty where none does, or it pauses."""
        if not self._shared.runs:
            return ""
        from cosmic.autonomy.campaign.campaign import Campaign, CampaignPhase

        at_rest = (CampaignPhase.READY, CampaignPhase.PAUSED)
        for each in list(self._shared.runs):
            if isinstance(each, Campaign):
                if not each.over and each.phase not in at_rest:
                    return A_CAMPAIGN
            elif not each.over and each.state not in (RunState.READY, RunState.PAUSED):
                return each.name
        return ""

    def procedure(self, procedure: Procedure[W], work: W) -> ProcedureRun[W]:
        """Return a run of `procedure` that is ready to begin, in the platform's time.

        It ends when motion is stopped or the platform closed, even where it only waits. It does
        not begin while a campaign runs.

        Parameters
        ----------
        procedure : Procedure
            What to do, put together from operations.
        work : object
            What its operations share, such as this rig and what they find.
        """
        return self._made(procedure, work, lambda: A_CAMPAIGN if self.running == A_CAMPAIGN else "")

    def _alone(self, procedure: Procedure[W], work: W) -> ProcedureRun[W]:
        """Return a run that begins only while nothing else runs."""
        return self._made(procedure, work, lambda: self.running)

    def _check_owner(self) -> None:
        if not self._owner.here:
            raise NotAvailable(FORKED)

    def _check_open(self) -> None:
        self._check_owner()
        if self._shared.closed:
            raise NotAvailable("the platform is closed; connect again for another one")

    def _made(self, procedure: Procedure[W], work: W, busy: Callable[[], str]) -> ProcedureRun[W]:
        self._check_open()
        run = ProcedureRun(
            procedure,
            work,
            self._platform.clock,
            self._platform.policy,
            stopped=stopped_since(self._mico),
            busy=busy,
        )
        self._shared.runs.add(cast("ProcedureRun[object]", run))
        return run

    @property
    def stations(self) -> dict[str, StationControl]:
        """The other stations in use, by name, with who may move things there."""
        return {each.name: each.control for each in self._platform.remote.stations}

    def take_control(self, *stations: str) -> None:
        """Take the right to move things at the stations named, all without a name; or at none.

        Raises
        ------
        MoveRefused
            Another holds it, or the operator there keeps it (`NO_LEASE`).
        StationAway
            A station cannot be reached.
        NotAvailable
            No such station is in use.
        """
        with ExitStack() as undo:
            for each in self._chosen(stations):
                if not each.control.here:
                    each.take_control()
                    undo.callback(each.release_control)
            undo.pop_all()

    def release_control(self, *stations: str) -> None:
        """Give the right to move back, at every station without a name; what moves by it stops.

        Raises
        ------
        NotAvailable
            No such station is in use.
        """
        for each in self._chosen(stations):
            if each.control.here:
                each.release_control()

    def _chosen(self, names: Sequence[str]) -> list[RemoteStation]:
        known = {each.name: each for each in self._platform.remote.stations}
        for name in names:
            if name not in known:
                used = ", ".join(known) or "none"
                raise NotAvailable(f"no station {name!r} is in use; in use are: {used}")
        return [known[name] for name in names or known]

    @property
    def stopped(self) -> str | None:
        """Why motion is stopped, or None while it is allowed."""
        return self._mico.stop_state.reason if self._mico is not None else None

    def stop(self, reason: str = "stop from a script") -> None:
        """Stop every axis now; nothing moves again before `reset_stop`. Returns at once.

        Outputs marked ``stops`` go to their safe values.

        Raises
        ------
        StationAway
            The axes are at a station that cannot be reached. What this program had begun to move
            there stops by itself.
        NotAvailable
            This process was forked from the one that drives the platform: nothing was stopped.
        """
        self._check_owner()
        try:
            if self._mico is not None:
                self._mico.stop(reason)
        finally:
            if self._has_outputs:
                self.daqco.stop_outputs(reason)

    def reset_stop(self) -> None:
        """Allow motion again; what was stopped does not go on by itself."""
        if self._mico is not None:
            self._mico.reset_stop()
        if self._has_outputs:
            self.daqco.reset_outputs()

    @property
    def _has_outputs(self) -> bool:
        return self._platform.daqco is not None and bool(self.daqco.outputs)

    @property
    def faults(self) -> SimulationFaults:
        """Trouble that can be injected into the simulated platform, by name.

        ``rig.faults.inject("missed_grasp", times=2)``; docs/explanation/twin.md lists the names.

        Raises
        ------
        NotAvailable
            The platform is real: it has troubles of its own.
        """
        if self._platform.faults is None and "mico" in self._platform.remote.host_of:
            raise NotAvailable("mico runs at another station; inject faults there")
        if self._platform.faults is None:
            raise NotAvailable("faults can be injected into a simulated platform only")
        return self._platform.faults

    def change_plate(self) -> int:
        """Put the next plate with new fibres on the simulated table, and return its number.

        Takes as long of the platform's time as somebody takes to do it.

        Raises
        ------
        NotAvailable
            The platform is real or runs elsewhere, something is in the jaws, or they stand low.
        """
        scene = self._platform.scene
        if scene is None:
            raise NotAvailable("plates change by themselves on a simulated platform here only")
        scene.check_plate_change()
        self._platform.clock.sleep(scene.settings.plate.exchange_s)
        return scene.change_plate()

    def close(self) -> None:
        """Stop everything, release the hold and end all threads; harmless the second time.

        One made by `commanding_as` does nothing, nor does it in a process that was forked: the
        platform is not its own.
        """
        shared = self._shared
        if self._first and not shared.closed and self._owner.here:
            shared.closed = True
            atexit.unregister(self.close)
            if shared.handling is not None:
                shared.handling.close()
            for run in list(shared.runs):
                run.abort("the platform is closed")
                run.join()
            if shared.control is not None:
                shared.control.close()
            self._platform.shut_down()
            self._at_end.close()  # what watches it has seen everything by now

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
