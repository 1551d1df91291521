"""Trajectories of the scripted API: ``rig.mico.trajectories`` (SCM, thesis 3.4.1)."""

from collections.abc import Callable, Collection
from datetime import datetime
from pathlib import Path

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import NotAvailable, RecordingError
from cosmic.mico.api.trajectory_player import SPEEDS, TrajectoryPlayer
from cosmic.mico.api.trajectory_recording import TrajectoryRecording
from cosmic.mico.api.trajectory_site import TrajectorySite
from cosmic.mico.api.trajectory_state import PlayProgress, PlayState, StartMode
from cosmic.mico.core.trajectory import parser
from cosmic.mico.core.trajectory.binding import Bound, bind
from cosmic.mico.core.trajectory.mirror import mirrored
from cosmic.mico.core.trajectory.model import Trajectory
from cosmic.mico.core.trajectory.rehearsal import Rehearsal
from cosmic.mico.core.trajectory.writer import to_text
from cosmic.mico.core.trajectory_recorder import TrajectoryRecorder


@checked_class
class Trajectories:
    """Records, reads, rehearses and runs trajectories; any thread.

    Parameters
    ----------
    source : str
        Who commands through this object, for the log: "script", "window".
    """

    def __init__(self, site: TrajectorySite, source: str = "script") -> None:
        self._site = site
        self._source = source

    @property
    def player(self) -> TrajectoryPlayer | None:
        """What was run last, whoever ran it; None before that."""
        return self._site.player

    @property
    def recording(self) -> TrajectoryRecording | None:
        """What is being recorded, whoever began it; None while nothing is."""
        recorder = self._site.recorder
        if recorder is None or not recorder.recording:
            return None
        return TrajectoryRecording(recorder)

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
        running = self.recording
        if running is not None:
            raise NotAvailable(f"{running.path} is being recorded; stop that first")
        pose = self._site.poses[relative_to] if relative_to else None
        if "\n" in title or "#" in title:
            raise RecordingError("a title is one line without #")
        head = Trajectory(
            platform=self._site.platform or "any",
            statements=(),
            title=title.strip(),
            recorded=f"{datetime.now():%Y-%m-%d %H:%M:%S}",
            pose=relative_to,
            pose_axes=tuple(pose.positions) if pose is not None else None,
        )
        recorder = TrajectoryRecorder(
            self._site.manager,
            Path(path),
            head,
            self._site.policy,
            timed=timed,
            zero=pose.positions if pose is not None else None,
            sources=sources,
            overwrite=overwrite,
        )
        self._site.recorder = recorder
        return TrajectoryRecording(recorder)

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
        trajectory = parser.load(Path(path), progress, cut_off=cut_off)
        self.check(trajectory)
        return trajectory

    def parse(self, text: str) -> Trajectory:
        """Read a trajectory from a text and check it; raises `TrajectoryError`."""
        trajectory = parser.parse(text)
        self.check(trajectory)
        return trajectory

    def check(self, trajectory: Trajectory) -> None:
        """Check a trajectory on this platform: axes, units, limits; raises `TrajectoryError`."""
        bind(trajectory, self._site.facts())

    def save(self, trajectory: Trajectory, path: str | Path, *, overwrite: bool = False) -> None:
        """Write a trajectory to a file; raises `RecordingError`."""
        try:
            with Path(path).open("w" if overwrite else "x", encoding="utf-8") as file:
                file.write(to_text(trajectory))
        except (OSError, ValueError) as exc:  # a name with a zero in it is no OSError
            raise RecordingError(f"{path} cannot be written: {exc}") from exc

    def mirror(self, trajectory: Trajectory) -> Trajectory:
        """Return a trajectory for the opposite assembly, as ``[mico.mirror]`` says.

        Raises
        ------
        TrajectoryError
            An axis has no counterpart, or the mirrored positions are outside its limits.
        """
        found = parser.parse(
            to_text(mirrored(trajectory, self._site.manager.settings.mirror)),
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
        return self._site.rehearse(
            self._bound(trajectory),
            speed=speed,
            timed=timed,
            progress=progress,
            cancelled=cancelled,
        )

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
        running = self._site.player
        if running is not None and running.state is PlayState.RUNNING:
            raise NotAvailable(f"{running.trajectory.name} is running; pause or cancel it first")
        player = TrajectoryPlayer(
            self._site,
            self._bound(trajectory),
            source=self._source,
            speed=speed,
            loops=loops,
            timed=timed,
        )
        self._site.player = player
        return player

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
            together, or have a "way" found.
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
