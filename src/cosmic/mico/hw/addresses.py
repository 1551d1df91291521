"""Devices and channels by their numbers: finding an open one, and naming it in an error."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.mico.hw.interface import Channel, Serial

D = TypeVar("D")


def where(
    device: int | None, channel: int | None = None, *, serial: Serial | None = None, none: str = ""
) -> str:
    """Return where something happened, such as "device 1 (serial 4711), channel 2".

    Parameters
    ----------
    device, channel : int or None
        Both counted from 0.
    none : str
        What is said where no device is concerned: the library, or the kind of controller.
    """
    if device is None:
        return none
    text = f"device {device}"
    if serial is not None:
        text += f" (serial {serial})" if isinstance(serial, int) else f" ({serial})"
    return text if channel is None else f"{text}, channel {channel}"


def open_device(devices: Sequence[D], index: int, not_open: str) -> D:
    """Return an open device; any thread.

    Parameters
    ----------
    not_open : str
        What an error says while none is open, such as "SmarActCTL is not open".

    Raises
    ------
    DeviceError
        None is open, or there is none of that number.
    """
    if not devices:
        text = f"{where(index)}: {not_open}"
        raise DeviceError(text, fault=DeviceFault.STATE, device=index)
    if not 0 <= index < len(devices):
        text = f"{where(index)}: there is no such device"
        raise DeviceError(text, fault=DeviceFault.NO_CHANNEL, device=index)
    return devices[index]


def device_of(
    devices: Sequence[D], at: Channel, channels: Callable[[D], int], not_open: str, call: str = ""
) -> D:
    """Return the open device that has a channel; any thread.

    Parameters
    ----------
    channels : callable
        How many channels a device has.
    not_open : str
        As of `open_device`.
    call : str
        What was asked, for an error; "" leaves it out.

    Raises
    ------
    DeviceError
        None is open, or there is no such channel.
    """
    if devices and 0 <= at.device < len(devices):
        device = devices[at.device]
        if 0 <= at.channel < channels(device):
            return device
    elif not devices:
        return open_device(devices, at.device, not_open)
    raise no_channel(at, call)


def no_channel(at: Channel, call: str = "") -> DeviceError:
    """Return the exception for a channel that there is not; `call` is what was asked of it."""
    asked = f"{call}: " if call else ""
    return error_at(DeviceFault.NO_CHANNEL, f"{asked}there is no such channel", at)


def refused(text: str, at: Channel | None = None, *, none: str = "") -> DeviceError:
    """Return the exception for a value that is refused before a library or a line sees it."""
    return error_at(DeviceFault.PARAMETER, text, at, none=none)


def error_at(
    fault: DeviceFault, text: str, at: Channel | None = None, *, none: str = ""
) -> DeviceError:
    """Return an exception that names the channel; `none` is said where there is none."""
    device, channel = (None, None) if at is None else (at.device, at.channel)
    said = f"{where(device, channel, none=none)}: {text}"
    return DeviceError(said, fault=fault, device=device, channel=channel)
