"""Trajectories of the scripted API: ``rig.mico.trajectories`` (SCM, thesis 3.4.1)."""

import secrets
from abc import abstractmethod
from collections import OrderedDict
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from threading import Lock
from typing import Final, Protocol

from typing_extensions import override

from cosmic.frame.arguments import checked_class
from cosmic.frame.declaration import Declared, command, part
from cosmic.frame.errors import DeviceTimeout, NotAvailable, RecordingError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.kept_file import write_whole
from cosmic.frame.network.caller import caller_token, source_of
from cosmic.frame.network.transfer import transferable
from cosmic.frame.operation import Operation, Progress
from cosmic.frame.weakly import weakly
from cosmic.mico.api.trajectory_player import SPEEDS, Players, TrajectoryPlayer, text_of
from cosmic.mico.api.trajectory_recording import Recordings, TrajectoryRecording
from cosmic.mico.api.trajectory_site import TrajectorySite
from cosmic.mico.api.trajectory_state import PlayProgress, StartMode
from cosmic.mico.core.poses import Pose
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.core.trajectory import reader
from cosmic.mico.core.trajectory.binding import Bound, PlatformFacts, bind
from cosmic.mico.core.trajectory.mirror import mirrored
from cosmic.mico.core.trajectory.model import Problem, Trajectory
from cosmic.mico.core.trajectory.recorder import Recordable
from cosmic.mico.core.trajectory.rehearsal import Rehearsal
from cosmic.mico.core.trajectory.writer import to_text

transferable(Problem)  # a `TrajectoryError` lists them

_PIECE: Final = 12_000
"""How many characters of a text go in one call: a call is at most 64 KiB."""
_MOST_TEXTS: Final = 8
_LOOK_S: Final = 0.1
"""How often whoever waits for a rehearsal looks whether it shall end."""
_SLOW_S: Final = 30.0
"""How long it may take to read a long trajectory at the station."""


class Platform(Recordable, Protocol):
    """What is known, in this process, of the platform that trajectories are for."""

    @property
    @abstractmethod
    def settings(self) -> MicoSettings:
        """What the platform file says."""

    @property
    @abstractmethod
    def recordings(self) -> Recordings:
        """What this process records."""

    @property
    @abstractmethod
    def source(self) -> str:
        """Who commands through it, for the log."""

    @abstractmethod
    def pose(self, name: str) -> Pose:
        """Return a named pose; raises `NotAvailable`."""

    @abstractmethod
    def facts(self) -> PlatformFacts:
        """Return what a trajectory is checked against."""


_OF_A_PLATFORM: Final = ("settings", "recordings", "source", "pose", "facts")
"""What tells one from what is none: a protocol with properties cannot be asked."""


@checked_class
class Trajectories(Declared):
    """Records, reads, rehearses and runs trajectories; any thread.

    They are rehearsed and run where the axes are, and read, checked and written in this process.
    """

    _platform: Platform

    def __init__(self, platform: Platform, site: TrajectorySite, players: Players) -> None:
        self._platform = platform
        self._site = site
        self._players = players
        self._lock = Lock()
        self._texts: OrderedDict[tuple[str, str], str] = OrderedDict()
        players.changed.subscribe(weakly(self.note_change))

    @override
    def set_up_proxy(self, key: str, policy: FailurePolicy) -> None:
        """Nothing is known of the platform before `belong_to`."""

    def belong_to(self, platform: Platform) -> None:
        """Read and check for this platform; for whoever makes a proxy."""
        if not all(hasattr(type(platform), each) for each in _OF_A_PLATFORM):
            raise TypeError(f"platform must be a MiCo, not {str(platform)[:60]}")
        self._platform = platform

    @property
    @part
    def players(self) -> Mapping[str, TrajectoryPlayer]:
        """The players that were made last, by number, the newest last."""
        return self._players.by_number

    @property
    def player(self) -> TrajectoryPlayer | None:
        """What was run last, whoever ran it; None before that."""
        return next(reversed(list(self.players.values())), None)

    @property
    def recording(self) -> TrajectoryRecording | None:
        """What this process records, whoever began it; None while nothing is recorded."""
        return self._platform.recordings.current

    # Recording

    def record(
        self,
        path: str | Path,
        *,
        title: str = "",
        timed: bool = True,
        relative_to: str = "",
        sources: Collection[str] | None = None,
        overwrite: bool = False,
    ) -> TrajectoryRecording:
        """Begin to record every movement into a file, until `stop` or the end of a with block.

        The file is one of this computer, wherever the axes are.

        Parameters
        ----------
        timed : bool
            With the times at which movements began and the speed of jogs; else they follow each
            other as fast as they can.
        relative_to : str
            Named pose that positions count from, so that the recording serves another place.
        sources : collection of str or None
            Whose movements: "window", "key", "script", "gamepad" ...; None: everybody's.
        overwrite : bool
            A file of that name may go.

        Raises
        ------
        RecordingError
            The file cannot be made; `RecordingExistsError` where there is one.
        NotAvailable
            Something is being recorded already, or there is no such pose.
        """
        return self._platform.recordings.begin(
            self._platform,
            Path(path),
            platform=self._platform.facts().name,
            title=title,
            pose=self._platform.pose(relative_to) if relative_to else None,
            timed=timed,
            sources=sources,
            overwrite=overwrite,
        )

    # Reading and writing

    def load(
        self,
        path: str | Path,
        progress: Callable[[float], object] | None = None,
        *,
        cut_off: bool = False,
    ) -> Trajectory:
        """Read a trajectory and check all of it on this platform.

        Parameters
        ----------
        progress : callable
            Called with the part that is read, 0 to 1.
        cut_off : bool
            Take a recording without its end, as a crash or a full disk leaves it.

        Raises
        ------
        TrajectoryError
            Something is wrong; names each line.
        """
        trajectory = reader.load(Path(path), progress, cut_off=cut_off)
        self.check(trajectory)
        return trajectory

    def parse(self, text: str) -> Trajectory:
        """Read a trajectory from a text and check it; raises `TrajectoryError`."""
        trajectory = reader.parse(text)
        self.check(trajectory)
        return trajectory

    def check(self, trajectory: Trajectory) -> None:
        """Check a trajectory on this platform: axes, units, limits; raises `TrajectoryError`."""
        bind(trajectory, self._platform.facts())

    def save(self, trajectory: Trajectory, path: str | Path, *, overwrite: bool = False) -> None:
        """Write a trajectory to a file; raises `RecordingError`, and leaves then what was there."""
        file = Path(path)
        try:
            if not overwrite:
                file.open("xb").close()  # so that no other program's is overwritten either
            try:
                write_whole(file, to_text(trajectory))
            except OSError:
                if not overwrite:
                    file.unlink(missing_ok=True)
                raise
        except (OSError, ValueError) as exc:  # a name with a zero in it is no OSError
            raise RecordingError(f"{path} cannot be written: {exc}") from exc

    def mirror(self, trajectory: Trajectory) -> Trajectory:
        """Return a trajectory for the opposite assembly, as ``[mico.mirror]`` says.

        Raises
        ------
        TrajectoryError
            An axis has no counterpart, or the mirrored positions are outside its limits.
        """
        found = reader.parse(
            to_text(mirrored(trajectory, self._platform.settings.mirror)),
            name=trajectory.name,
        )
        self.check(found)
        return found

    # Rehearsing and running

    def rehearse(
        self,
        trajectory: Trajectory,
        progress: Callable[[float, str], object] | None = None,
        *,
        speed: float = 1.0,
        timed: bool = True,
        cancelled: Callable[[], bool] | None = None,
    ) -> Rehearsal:
        """Run a trajectory through the gate without moving anything; waits for it.

        It begins where the trajectory says it does, or where the axes stand now.

        Raises
        ------
        TrajectoryError
            It does not fit the platform.
        NotAvailable
            One of its axes is linked to one that it does not move, or `speed` is none.
        """
        low, high = SPEEDS
        if not low <= speed <= high:
            raise NotAvailable(f"speed lies between {low:g} and {high:g}: {speed!r}")
        if self.remote:
            given = self._sent(trajectory)
            begun = self.begin_rehearsal(given, trajectory.path, speed=speed, timed=timed)
            return _waited_for(begun, progress, cancelled)
        return self._site.rehearse(
            self._bound(trajectory),
            speed=speed,
            timed=timed,
            progress=progress,
            cancelled=cancelled,
        )

    @command(timeout_s=_SLOW_S)
    def begin_rehearsal(
        self, given: str, path: Path | None = None, *, speed: float = 1.0, timed: bool = True
    ) -> Operation[Rehearsal]:
        """Begin to rehearse a text that was given; raises as `rehearse`.

        Parameters
        ----------
        given : str
            Under which key `give` has the text.
        path : Path
            What the file of it is called, for messages.
        """
        bound = self._bound(self._read(given, path))
        return self._site.begin_rehearsal(bound, speed=speed, timed=timed)

    @command
    def give(self, key: str, text: str) -> None:
        """Take the text of a trajectory, or more of it, under a key of the caller's choice.

        Raises
        ------
        NotAvailable
            It is longer than any file may be.
        """
        whose = caller_token(), key
        with self._lock:
            whole = self._texts.get(whose, "") + text
            if len(whole) > reader.LARGEST_BYTES:
                self._texts.pop(whose, None)
                raise NotAvailable("the trajectory is longer than any file may be; split it")
            self._texts[whose] = whole
            while len(self._texts) > _MOST_TEXTS:
                self._texts.popitem(last=False)

    def _sent(self, trajectory: Trajectory) -> str:
        """Send a trajectory to where the axes are, piece by piece; returns its key there."""
        key, text = secrets.token_hex(8), text_of(trajectory)
        for start in range(0, len(text), _PIECE):
            self.give(key, text[start : start + _PIECE])
        return key

    def _read(self, given: str, path: Path | None) -> Trajectory:
        with self._lock:
            text = self._texts.pop((caller_token(), given), None)
        if text is None:
            raise NotAvailable("the text of the trajectory did not come; try again")
        return reader.parse(text, path=path, cut_off=True)

    def _bound(self, trajectory: Trajectory) -> Bound:
        axes = trajectory.axes
        for link in self._site.manager.links.links:
            # The rehearsal would know nothing of the axis that is drawn along.
            if (link.first in axes) != (link.second in axes):
                text = f"{link.first} and {link.second} are linked, and it moves only one of them"
                raise NotAvailable(f"{trajectory.name}: {text}; unlink them first")
        return bind(trajectory, self._site.facts(), self._site.positions())

    def prepare(
        self,
        trajectory: Trajectory,
        *,
        speed: float = 1.0,
        loops: int | None = 1,
        timed: bool = True,
    ) -> TrajectoryPlayer:
        """Return a player that has not begun: `resume` or `step` begins it.

        Raises
        ------
        TrajectoryError
            The trajectory does not fit the platform.
        NotAvailable
            Another trajectory is running, or one of its axes is linked to one that it does not
            move.
        """
        source = self._platform.source
        if not self.remote:
            number = self._made(trajectory, speed, loops, timed=timed, source=source)
            return self.players[number]
        number = self.begin_player(
            self._sent(trajectory),
            trajectory.path,
            speed=speed,
            loops=loops,
            timed=timed,
            source=source,
        )
        player = self.players[number]
        player.keep_trajectory(trajectory)
        return player

    @command(timeout_s=_SLOW_S)
    def begin_player(
        self,
        given: str,
        path: Path | None = None,
        *,
        speed: float = 1.0,
        loops: int | None = 1,
        timed: bool = True,
        source: str = "script",
    ) -> str:
        """Make a player of a text that was given, and return its number; raises as `prepare`."""
        trajectory = self._read(given, path)
        return self._made(trajectory, speed, loops, timed=timed, source=source_of(source))

    def _made(
        self, trajectory: Trajectory, speed: float, loops: int | None, *, timed: bool, source: str
    ) -> str:
        player = TrajectoryPlayer(
            self._site,
            self._bound(trajectory),
            source=source,
            speed=speed,
            loops=loops,
            timed=timed,
        )
        return self._players.add(player)

    def run(
        self,
        trajectory: Trajectory | str | Path,
        progress: Callable[[PlayProgress], None] | None = None,
        *,
        start: StartMode = "refuse",
        speed: float = 1.0,
        loops: int | None = 1,
        timed: bool = True,
        wait: bool = True,
    ) -> TrajectoryPlayer:
        """Rehearse a trajectory, then make its movements; returns its player.

        Parameters
        ----------
        start : str
            What to do where axes do not stand where it begins: "refuse", go there "straight" and
            together, or by a planned "detour".
        speed : float
            How fast, 0.01 to 10 times as written.
        loops : int or None
            How many times; None: until it is paused or cancelled.
        timed : bool
            Keep the times that are written.
        wait : bool
            False returns at once.

        Raises
        ------
        TrajectoryError
            It does not fit the platform.
        AwayFromStartError
            Axes stand elsewhere, and `start` is "refuse".
        MoveRefused, DeviceError, MoveCancelled
            What ended it, with the line; `player.resume` goes on there.
        """
        if not isinstance(trajectory, Trajectory):
            trajectory = self.load(trajectory)
        player = self.prepare(trajectory, speed=speed, loops=loops, timed=timed)
        if progress is not None:
            player.subscribe(progress)
        player.resume(start)
        if wait:
            try:
                player.wait()
            except KeyboardInterrupt:
                player.cancel()
                raise
        return player


def _waited_for(
    begun: Operation[Rehearsal],
    progress: Callable[[float, str], object] | None,
    cancelled: Callable[[], bool] | None,
) -> Rehearsal:
    """Return the result of a rehearsal; whoever waits is told how far it is, and may end it."""

    def on_progress(changed: Progress) -> None:
        if progress is not None and not changed.done:
            progress(changed.fraction, changed.text)

    begun.subscribe(on_progress)
    try:
        while True:
            try:
                return begun.wait(None if cancelled is None else _LOOK_S)
            except DeviceTimeout:
                if begun.done:
                    raise
                if cancelled is not None and cancelled():
                    begun.cancel()
    except KeyboardInterrupt:
        begun.cancel()
        raise
