"""Settings being edited: what the dialog shows before Apply puts it in force."""

from collections.abc import Sequence
from typing import Final

from pydantic import ValidationError

from cosmic.daqco.core.scale import VOLTS
from cosmic.daqco.core.settings import COLOURS, ChannelSettings, DaqcoSettings, ScaleSettings
from cosmic.daqco.hw.interface import BoardInfo
from cosmic.frame.errors import ConfigError

_VALUE_ERROR: Final = "Value error, "


class Draft:
    """A copy of the settings that may change; `settings` makes the frozen ones."""

    def __init__(self, given: DaqcoSettings) -> None:
        self._given = given
        self.rate_hz, self.refresh_hz = given.rate_hz, given.refresh_hz
        self.channels = list(given.channel)
        self.scales = list(given.scale)
        self._limits = list(given.limit)

    @property
    def scale_names(self) -> list[str]:
        """The names a channel can choose from."""
        return [VOLTS.name, *(each.name for each in self.scales)]

    @property
    def active(self) -> int:
        """How many channels are active."""
        return sum(each.active for each in self.channels)

    def scale(self, name: str) -> ScaleSettings:
        """Return a scale by name."""
        for each in self.scales:
            if each.name == name:
                return each
        return ScaleSettings(name=VOLTS.name, unit=VOLTS.unit, coefficients=VOLTS.coefficients)

    def scale_users(self) -> dict[str, str]:
        """Return the channels of each scale that is used."""
        users: dict[str, list[str]] = {}
        for each in self.channels:
            users.setdefault(each.scale, []).append(each.name)
        return {name: ", ".join(channels) for name, channels in users.items()}

    def replace(self, row: int, channel: ChannelSettings) -> None:
        """Change a channel; its limit goes with it."""
        old = self.channels[row].name
        self.channels[row] = channel
        self._limits = [
            each.model_copy(update={"channel": channel.name}) if each.channel == old else each
            for each in self._limits
        ]

    def remove(self, row: int) -> None:
        """Take a channel out, and its limit."""
        gone = self.channels.pop(row).name
        self._limits = [each for each in self._limits if each.channel != gone]

    def add(self, board: str, input_: str) -> int:
        """Add a channel for an input that is free; returns its row."""
        number = int(input_.removeprefix("ai"))
        names = {each.name for each in self.channels}
        wanted = (
            f"{board.lower()}_{input_}"
            if board.isascii() and board.isalnum() and board[:1].isalpha()
            else input_
        )
        name = next(
            candidate
            for candidate in (wanted, *(f"channel{i}" for i in range(10_000)))
            if candidate not in names
        )
        channel = ChannelSettings(
            name=name, board=board, input=input_, colour=COLOURS[number % len(COLOURS)]
        )
        self.channels.append(channel)
        return len(self.channels) - 1

    def free_inputs(self, board: BoardInfo) -> list[str]:
        """Return the inputs of a board that no channel has."""
        taken = {each.input for each in self.channels if each.board == board.name}
        return [each for each in board.inputs if each not in taken]

    def set_scales(self, scales: Sequence[ScaleSettings], renamed: dict[str, str]) -> None:
        """Take over scales from the editor; channels follow those that were renamed."""
        self.scales = list(scales)
        self.channels = [
            each.model_copy(update={"scale": renamed.get(each.scale, each.scale)})
            for each in self.channels
        ]

    def settings(self) -> DaqcoSettings:
        """Return what is drafted.

        Raises
        ------
        ConfigError
            It does not fit together; the text says why.
        """
        if not self.active:
            raise ConfigError("no channel is active: activate at least one")
        changed = {
            "rate_hz": self.rate_hz,
            "refresh_hz": self.refresh_hz,
            "channel": tuple(self.channels),
            "scale": tuple(self.scales),
            "limit": tuple(self._limits),
        }
        try:
            return DaqcoSettings(**(dict(self._given) | changed))
        except ValidationError as exc:
            texts = [each["msg"].removeprefix(_VALUE_ERROR) for each in exc.errors()]
            raise ConfigError("; ".join(texts)) from None
