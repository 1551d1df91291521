"""What a force limit rests on, and what may not change while it is armed.

A limit belongs to a physical quantity: this channel, measured by this input in this unit. See
docs/explanation/safety.md for the other guards.
"""

from typing import Final

import numpy as np

from cosmic.daqco.core.limits import LOWEST_RATE_HZ, Limit
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import ChannelSettings, DaqcoSettings
from cosmic.frame.errors import ConfigError, NotAvailable

_VOLTAGES: Final = 1001
CHUNKS_A_SILENCE: Final = 2.0
"""Data come so many times at least before their silence is noticed."""


def _channel(name: str, settings: DaqcoSettings) -> ChannelSettings | None:
    return next((each for each in settings.channel if each.name == name), None)


def _active(name: str, settings: DaqcoSettings) -> ChannelSettings:
    channel = _channel(name, settings)
    if channel is None or not channel.active:
        names = ", ".join(each.name for each in settings.channel if each.active)
        raise ConfigError(f"there is no active channel {name!r}; there are {names}")
    return channel


def _scale(channel: ChannelSettings, settings: DaqcoSettings) -> Scale:
    return settings.scales()[channel.scale]


def _of_same_input(channel: ChannelSettings, settings: DaqcoSettings) -> ChannelSettings | None:
    return next(
        (
            each
            for each in settings.channel
            if (each.board, each.input) == (channel.board, channel.input)
        ),
        None,
    )


def check_arming(limit: Limit, settings: DaqcoSettings) -> None:
    """Refuse to arm a limit that could never be crossed.

    Raises
    ------
    ConfigError
        There is no such channel, it is not active, or no voltage in its range lies beyond.
    NotAvailable
        Chunks are too long for the watch.
    """
    channel = _active(limit.channel, settings)
    if settings.chunk_s * CHUNKS_A_SILENCE > settings.silence_s:
        raise NotAvailable(
            f"{limit.channel}: its limit cannot be watched: data come every {settings.chunk_s:g} s "
            f"and are missed after {settings.silence_s:g} s; shorten chunk_s"
        )
    scale = _scale(channel, settings)
    low, high = measurable(channel.name, settings)
    if not (limit.low >= low or limit.high <= high):
        raise ConfigError(
            f"{limit.channel}: a limit of {limit.range_text} {scale.unit} can never be crossed: "
            f"{channel.low_v:g} to {channel.high_v:g} V are {low:g} to {high:g} {scale.unit} by "
            f"the scale {scale.name!r}; correct the limit, the range or the scale"
        )


def measurable(name: str, settings: DaqcoSettings) -> tuple[float, float]:
    """Return the least and the most that an active channel can measure, in its unit.

    Raises
    ------
    ConfigError
        There is no such channel, or it is not active.
    """
    channel = _active(name, settings)
    volts = np.linspace(channel.low_v, channel.high_v, _VOLTAGES)
    values = _scale(channel, settings).apply(volts)
    return float(values.min()), float(values.max())


def unit_of(name: str, settings: DaqcoSettings) -> str:
    """Return the unit that a channel is measured in; empty where there is no such channel."""
    channel = _channel(name, settings)
    return "" if channel is None else _scale(channel, settings).unit


def changed_quantity(name: str, before: DaqcoSettings, after: DaqcoSettings) -> str:
    """Return what changed of the quantity that an active channel measures, in words; or ""."""
    old, new = _channel(name, before), _channel(name, after)
    if old is None or new is None or not new.active:
        return f"there is no channel {name} any more: renamed, or switched off"
    what = _changed(old, new, before, after)
    return what and f"the {what} of {name} changed"


def _changed(
    old: ChannelSettings, new: ChannelSettings, before: DaqcoSettings, after: DaqcoSettings
) -> str:
    """Return what is different about the quantity that two channels measure; empty for nothing."""
    if (old.board, old.input, old.mode) != (new.board, new.input, new.mode):
        return "input"
    if (old.low_v, old.high_v) != (new.low_v, new.high_v):
        return "range"
    one, other = _scale(old, before), _scale(new, after)
    if one.unit != other.unit:
        return "unit"
    return "" if one.coefficients == other.coefficients else "scale"


def check_guarded(limit: Limit, before: DaqcoSettings, after: DaqcoSettings) -> None:
    """Refuse settings that change what an armed limit rests on.

    Raises
    ------
    NotAvailable
        They do; the text says what, and to disarm the limit first.
    """
    old = _channel(limit.channel, before)
    if old is None:
        return
    what = _touched(old, before, after) or _slowed(before, after)
    if what:
        raise NotAvailable(
            f"{limit.channel}: {what} while its limit ({limit.range_text} "
            f"{_scale(old, before).unit}) is armed. Disarm the "
            f"limit first, then set it anew"
        )


def _touched(old: ChannelSettings, before: DaqcoSettings, after: DaqcoSettings) -> str:
    """Return what changes about the quantity that is watched; empty where nothing does."""
    new = _channel(old.name, after)
    if new is None:
        heir = _of_same_input(old, after)
        return f"it cannot be renamed to {heir.name}" if heir else "it cannot be taken out"
    if not new.active:
        return "it cannot be switched off"
    what = _changed(old, new, before, after)
    if what == "unit":
        one, other = _scale(old, before), _scale(new, after)
        return f"its unit cannot change from {one.unit} to {other.unit}"
    return what and f"its {what} cannot change"


def _slowed(before: DaqcoSettings, after: DaqcoSettings) -> str:
    """Return why samples would come too seldom, or their silence be noticed later."""
    if not after.rate_hz >= LOWEST_RATE_HZ:
        return f"the rate cannot fall below {LOWEST_RATE_HZ:g} Hz"
    if after.silence_s > before.silence_s:
        return "silence_s cannot be raised"
    if after.chunk_s * CHUNKS_A_SILENCE > after.silence_s:
        return f"chunks of {after.chunk_s:g} s cannot be watched"
    return ""


def successor(name: str, before: DaqcoSettings, after: DaqcoSettings) -> tuple[str, str]:
    """Return what a channel is called after a change, or else why what was set for it is void.

    A channel is the same under another name when it has the same input and unit.
    """
    old, new = _channel(name, before), _channel(name, after)
    if old is None:
        return name, ""
    if new is None:
        new = _of_same_input(old, after)
        if new is None or _channel(new.name, before) is not None:
            return name, f"there is no channel {name} any more"
    one, other = _scale(old, before).unit, _scale(new, after).unit
    return new.name, "" if one == other else f"{new.name} is now measured in {other}, not in {one}"
