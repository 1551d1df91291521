"""What every board refuses, before its driver is asked."""

import math
from collections.abc import Sequence
from typing import Final

from cosmic.daqco.hw.interface import BoardInfo, InputMode, InputSettings
from cosmic.frame.errors import DeviceError, DeviceFault, LimitError
from cosmic.frame.verdict import Reason, refuse

# NI's connectors carry blocks of sixteen: ai0 pairs with ai8, ai16 with ai24 (M Series manual).
_BLOCK: Final = 16
BUFFER_S: Final = 10.0
"""So long a board keeps samples that nobody fetches."""


def negative_input(info: BoardInfo, positive: str) -> str | None:
    """Return the input that is the other half of `positive` in a differential pair.

    None when `positive` cannot be the first half of a pair.
    """
    if info.pairs is not None:
        return dict(info.pairs).get(positive)
    block = min(_BLOCK, len(info.inputs))
    number = info.inputs.index(positive)
    partner = number + block // 2
    if number % block >= block // 2 or partner >= len(info.inputs):
        return None
    return info.inputs[partner]


def range_in_force(info: BoardInfo, each: InputSettings) -> tuple[float, float]:
    """Return the narrowest range of the board that holds what `each` expects, V.

    Raises
    ------
    LimitError
        No range holds it, or its low does not lie below its high.
    """
    if not each.low_v < each.high_v:
        raise _limit(
            f"{info.name}/{each.input}: {each.low_v:g} to {each.high_v:g} V is not a range; "
            f"low must lie below high",
            value=each.low_v,
            limit=each.high_v,
            unit="V",
        )
    fitting = [
        (low, high) for low, high in info.ranges_v if low <= each.low_v and each.high_v <= high
    ]
    if not fitting:
        low, high = info.ranges_v[0]
        asked_low_wrong = not low <= each.low_v
        raise _limit(
            f"{info.name}/{each.input}: {each.low_v:g} to {each.high_v:g} V is beyond the board's "
            f"widest range, {low:g} to {high:g} V",
            value=each.low_v if asked_low_wrong else each.high_v,
            limit=low if asked_low_wrong else high,
            unit="V",
        )
    return min(fitting, key=lambda pair: pair[1] - pair[0])


def check_inputs(info: BoardInfo, inputs: Sequence[InputSettings], *, paired: bool = True) -> None:
    """Refuse inputs that are not there, used twice, not to be wired so or out of every range.

    Parameters
    ----------
    paired : bool
        A differential channel takes two inputs; False where each input has two wires of its own,
        which `info` may say as well.

    Raises
    ------
    LimitError
        No input, more than there are, or a range that the board does not have.
    DeviceError
        There is no such input, it is used twice, or it cannot be wired like that.
    """
    if not 1 <= len(inputs) <= len(info.inputs):
        raise _limit(
            f"{info.name}: {len(inputs)} inputs asked; a {info.product} takes 1 to "
            f"{len(info.inputs)}",
            value=float(len(inputs)),
            limit=float(len(info.inputs)),
            unit="",
        )
    paired = paired and info.pairs != ()
    used: dict[str, str] = {}
    for each in inputs:
        _check_mode(info, each)
        for wire in _wires(info, each, paired=paired):
            if wire in used:
                raise DeviceError(
                    f"{info.name}/{each.input}: {wire} is already used by {used[wire]}; "
                    f"a differential channel needs both inputs of its pair",
                    fault=DeviceFault.PARAMETER,
                )
            used[wire] = each.input
        range_in_force(info, each)


def check_rate(info: BoardInfo, active: int, rate_hz: float) -> None:
    """Refuse a rate that the board cannot make with `active` inputs.

    Raises
    ------
    LimitError
        Not positive, not finite, or too high; the text says what is possible.
    """
    highest = min(info.max_single_rate_hz, info.highest_rate_hz(active))
    if not 0.0 < rate_hz <= highest:
        raise _limit(
            f"{info.name}: {active} inputs at {rate_hz:g} Hz asked; a {info.product} makes up to "
            f"{highest:g} Hz with {active}: lower the rate or use fewer inputs",
            value=rate_hz if math.isfinite(rate_hz) else None,
            limit=highest,
            unit="Hz",
        )


def check_chunk(info: BoardInfo, chunk_samples: int) -> None:
    """Refuse a chunk without samples; raises `DeviceError`."""
    if not chunk_samples >= 1:
        raise DeviceError(
            f"{info.name}: chunks of {chunk_samples} samples asked; give at least 1",
            fault=DeviceFault.PARAMETER,
        )


def _check_mode(info: BoardInfo, each: InputSettings) -> None:
    if each.mode not in info.modes:
        raise DeviceError(
            f"{info.name}: {each.input} cannot be wired {each.mode}; a {info.product} can: "
            f"{', '.join(info.modes)}",
            fault=DeviceFault.PARAMETER,
        )


def _wires(info: BoardInfo, each: InputSettings, *, paired: bool) -> tuple[str, ...]:
    if each.input not in info.inputs:
        raise DeviceError(
            f"{info.name}: there is no input {each.input!r}; a {info.product} has "
            f"{info.inputs[0]} to {info.inputs[-1]}",
            fault=DeviceFault.NO_CHANNEL,
        )
    if not paired or each.mode is not InputMode.DIFFERENTIAL:
        return (each.input,)
    partner = negative_input(info, each.input)
    if partner is None:
        raise DeviceError(
            f"{info.name}/{each.input}: it is the negative half of a differential pair; name the "
            f"positive one",
            fault=DeviceFault.PARAMETER,
        )
    return each.input, partner


def _limit(text: str, *, value: float | None, limit: float | None, unit: str) -> LimitError:
    return LimitError(refuse(Reason.LIMIT, text, value=value, limit=limit, unit=unit))
