"""What is acquired in one go: checked against the boards before anything starts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cosmic.daqco.core.settings import (
    HIGHEST_RATE_HZ,
    LOWEST_RATE_HZ,
    CameraTriggerSettings,
    ChannelSettings,
    DaqcoSettings,
)
from cosmic.daqco.hw.board_checks import negative_input
from cosmic.daqco.hw.interface import BoardInfo, InputMode, InputSettings
from cosmic.daqco.hw.pulses import LEAST_EVERY, PulseTrain
from cosmic.frame.errors import LimitError, NotConnectedError
from cosmic.frame.verdict import Reason, refuse


@dataclass(frozen=True)
class AcquisitionPlan:
    """Channels, rate and length of the chunks of one acquisition.

    Attributes
    ----------
    channels : tuple of ChannelSettings
        The active ones: the order of the rows in every chunk.
    chunk_samples : int
        Samples a channel in one chunk.
    pulses : PulseTrain or None
        The trigger of a camera.
    """

    channels: tuple[ChannelSettings, ...]
    rate_hz: float
    chunk_samples: int
    pulses: PulseTrain | None = None

    @property
    def boards(self) -> tuple[str, ...]:
        """Names of the boards that take part, in order."""
        return tuple(dict.fromkeys(each.board for each in self.channels))

    @property
    def rows(self) -> tuple[int, ...]:
        """For each channel, its row when the chunks of the boards are laid below each other."""
        by_board = [
            number
            for board in self.boards
            for number, each in enumerate(self.channels)
            if each.board == board
        ]
        return tuple(by_board.index(number) for number in range(len(self.channels)))

    def inputs(self, board: str) -> tuple[InputSettings, ...]:
        """Return what is acquired on one board."""
        return tuple(
            InputSettings(each.input, each.input_mode, each.low_v, each.high_v)
            for each in self.channels
            if each.board == board
        )


def make_plan(
    channels: Sequence[ChannelSettings],
    rate_hz: float,
    chunk_s: float,
    boards: Mapping[str, BoardInfo],
    trigger: CameraTriggerSettings | None = None,
) -> AcquisitionPlan:
    """Return a plan for the active ones of `channels`, with the trigger of a camera.

    Raises
    ------
    LimitError
        A rate, a number of channels or an input that a board does not have; the text says what
        is possible.
    NotConnectedError
        A channel names a board that is not there.
    """
    active = [each for each in channels if each.active]
    if not active:
        raise _limit("no channel is active; switch one on")
    if not LOWEST_RATE_HZ <= rate_hz <= HIGHEST_RATE_HZ:
        raise _limit(
            f"{rate_hz:g} Hz is outside {LOWEST_RATE_HZ:g} to {HIGHEST_RATE_HZ:g} Hz",
            value=rate_hz,
            limit=HIGHEST_RATE_HZ if rate_hz > HIGHEST_RATE_HZ else LOWEST_RATE_HZ,
        )
    for name in dict.fromkeys(each.board for each in active):
        if name not in boards:
            raise NotConnectedError(
                f"board {name} is not there; there are {', '.join(boards) or 'none'}"
            )
        _check_board(boards[name], [each for each in active if each.board == name], rate_hz)
    pulses = None if trigger is None else _pulses(trigger, active, rate_hz)
    return AcquisitionPlan(tuple(active), rate_hz, max(1, round(rate_hz * chunk_s)), pulses)


def _pulses(
    trigger: CameraTriggerSettings, active: Sequence[ChannelSettings], rate_hz: float
) -> PulseTrain:
    if trigger.board not in {each.board for each in active}:
        raise _limit(
            f"camera_trigger: no channel of {trigger.board} is active, and without samples it has "
            f"no sample clock; switch one on"
        )
    every = round(rate_hz / trigger.rate_hz)
    if not every >= LEAST_EVERY:
        highest_hz = rate_hz / LEAST_EVERY
        raise _limit(
            f"camera_trigger: {trigger.rate_hz:g} Hz asked; at {rate_hz:g} samples a second up to "
            f"{highest_hz:g} Hz",
            value=trigger.rate_hz,
            limit=highest_hz,
        )
    return PulseTrain(trigger.board, trigger.counter, every, every)


def highest_rate_hz(channels: Sequence[ChannelSettings], boards: Mapping[str, BoardInfo]) -> float:
    """Return the highest rate that all boards allow for the active ones of `channels`."""
    rates = [HIGHEST_RATE_HZ]
    for name, board in boards.items():
        active = sum(each.active and each.board == name for each in channels)
        if active:
            rates.append(board.highest_rate_hz(active))
    return min(rates)


def _check_board(board: BoardInfo, channels: Sequence[ChannelSettings], rate_hz: float) -> None:
    highest = board.highest_rate_hz(len(channels))
    if not rate_hz <= highest:
        raise _limit(
            f"{board.name}: {len(channels)} channels at {rate_hz:g} Hz are too much for a "
            f"{board.product}; up to {highest:g} Hz, or fewer channels",
            value=rate_hz,
            limit=highest,
        )
    used: dict[str, str] = {}
    for each in channels:
        for taken in _taken(each, board):
            if taken in used:
                raise _limit(f"{each.name} and {used[taken]} both use {board.name}/{taken}")
            used[taken] = each.name


def _taken(channel: ChannelSettings, board: BoardInfo) -> tuple[str, ...]:
    """Return the inputs that a channel occupies, its partner as well where differential."""
    if channel.input not in board.inputs:
        raise _limit(
            f"{channel.name}: {board.name} has no input {channel.input}; it has "
            f"{board.inputs[0]} to {board.inputs[-1]}"
        )
    if channel.input_mode not in board.modes:
        raise _limit(
            f"{channel.name}: {board.name}/{channel.input} cannot be wired {channel.mode}; a "
            f"{board.product} can: {', '.join(board.modes)}"
        )
    if channel.input_mode is not InputMode.DIFFERENTIAL or board.pairs == ():
        return (channel.input,)
    negative = negative_input(board, channel.input)
    if negative is None:
        partner = [each for each in board.inputs if negative_input(board, each) == channel.input]
        raise _limit(
            f"{channel.name}: {channel.input} is the second half of a pair; give its partner "
            f"{', '.join(partner) or 'there is none'}"
        )
    return channel.input, negative


def _limit(text: str, *, value: float | None = None, limit: float | None = None) -> LimitError:
    return LimitError(refuse(Reason.LIMIT, text, value=value, limit=limit, unit="Hz"))


def restarts(before: DaqcoSettings, after: DaqcoSettings) -> bool:
    """Return True when acquisition must begin anew for `after`, not only scale differently."""

    def wiring(settings: DaqcoSettings) -> object:
        inputs = [
            (each.name, each.board, each.input, each.mode, each.low_v, each.high_v)
            for each in settings.channel
            if each.active
        ]
        return settings.rate_hz, settings.chunk_s, inputs, settings.camera_trigger

    return wiring(before) != wiring(after)
