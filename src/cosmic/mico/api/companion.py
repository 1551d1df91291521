"""What keeps an eye, on this side of a line, on the axes of a station."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from functools import partial
from typing import Protocol

from typing_extensions import override

from cosmic.frame.background import OnResult
from cosmic.frame.declaration import Companion
from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.api.axis import Axis
from cosmic.mico.api.news import AxisEnded, AxisPositions, AxisRefused, MovementNews


class RemoteAxes(Protocol):
    """What it needs of a `Mico` at a station."""

    @property
    @abstractmethod
    def axes(self) -> Mapping[str, Axis]:
        """Each axis by its name."""

    @property
    @abstractmethod
    def away(self) -> str:
        """Why the station cannot be reached."""

    @property
    @abstractmethod
    def moves_remotely(self) -> bool:
        """Something that was begun through it still moves."""

    @abstractmethod
    def stop(self, reason: str = "stop") -> None:
        """Stop every axis."""

    @abstractmethod
    def carry_out(
        self, action: Callable[[], None], on_result: OnResult[None], *, slow: bool = False
    ) -> None:
        """Do what may have to wait for the line."""

    @abstractmethod
    def follow_positions(self, receiver: Callable[[AxisPositions], object]) -> Callable[[], None]:
        """Hear where the axes are."""

    @abstractmethod
    def follow_movements(self, receiver: Callable[[MovementNews], object]) -> Callable[[], None]:
        """Hear of every movement."""


class MicoCompanion(Companion):
    """Keeps an eye on axes at another station; in the threads that hear from it.

    It notes where they are, has the commanders of the axes tell what became of movements, and stops
    there what was begun here when something here has failed.
    """

    def __init__(self, mico: RemoteAxes, policy: FailurePolicy) -> None:
        self._mico = mico
        self._policy = policy
        self._ends: list[Callable[[], object]] = []

    @override
    def on_opened(self) -> None:
        self._ends.append(self._policy.on_safe_stop(self._on_safe_stop))
        self._ends.append(self._mico.follow_positions(self._on_positions))
        self._ends.append(self._mico.follow_movements(self._on_movement))

    @override
    def close(self) -> None:
        while self._ends:
            self._ends.pop()()

    def _on_safe_stop(self, reason: str) -> None:
        """Stop what was begun here, when something here has failed."""
        if self._mico.moves_remotely and not self._mico.away:
            self._mico.carry_out(partial(self._mico.stop, reason), self._on_stopped)

    def _on_stopped(self, _result: None, error: CosmicError | None) -> None:
        if error is not None:
            self._policy.report(error, "stop was NOT carried out at the station")

    def _on_positions(self, positions: AxisPositions) -> None:
        axes = self._mico.axes
        for name, (position, std, read_wall_s) in positions.of.items():
            axis = axes.get(name)
            if axis is not None and axis.far is not None:
                axis.far.move(position, std, read_wall_s)
                axis.far.changed.emit(axis.details)

    def _on_movement(self, news: MovementNews) -> None:
        axes = self._mico.axes
        if isinstance(news, AxisEnded) and news.name in axes:
            axes[news.name].commander.movement_ended.emit(news.heard())
        elif isinstance(news, AxisRefused) and not news.together and news.verdict.axis in axes:
            axes[news.verdict.axis].commander.movement_refused.emit(news.verdict)
