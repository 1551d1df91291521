"""Which devices there are: opened by their serial numbers, with the axes that are configured."""

import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from cosmic.frame.errors import NotConnectedError
from cosmic.mico.core.motion.data_container import NO_DEVICE, DeviceDataContainer, Memory
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import Channel, Controller, DeviceIdentity, Serial

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Inventory:
    """What is kept of each device, where each axis is connected, and what is missing, a line each.

    Devices are counted as in the configuration.
    """

    containers: dict[int, DeviceDataContainer]
    addresses: dict[str, Channel]
    missing: tuple[str, ...]


def take_inventory(
    controller: Controller,
    settings: MicoSettings,
    library_index: Mapping[int, int],
    memories: Mapping[str, Memory],
    *,
    searched: bool,
) -> Inventory:
    """Make a container for each device that is present, and for each that is only configured.

    Parameters
    ----------
    library_index : mapping of int
        The library's index of each device that is present, by its number in the configuration.
    memories : mapping of Memory
        What the user has set on each axis, which outlives the search for devices.
    searched : bool
        The hardware was looked for, so that what is not present is missing.
    """
    positioners = settings.positioner
    containers: dict[int, DeviceDataContainer] = {}
    addresses: dict[str, Channel] = {}
    missing: list[str] = []
    for number in sorted({each.device for each in positioners} | set(library_index)):
        here = {each.channel: each for each in positioners if each.device == number}
        at, can = library_index.get(number, number), controller.capabilities
        if number in library_index:
            can = controller.device_capabilities(at)
        container = DeviceDataContainer(number, here, settings.defaults.hold, at, can)
        container.remember(memories)
        if number not in library_index:
            for channel in here:
                container.settle(channel, None, NO_DEVICE)
            if searched:
                names = ", ".join(each.name for each in here.values())
                missing.append(f"device {number} was not found ({names})")
        containers[number] = container
        addresses.update({each.name: each.address for each in here.values()})
    return Inventory(containers, addresses, tuple(missing))


def open_devices(controller: Controller, wanted: Sequence[Serial]) -> dict[int, int]:
    """Open the devices with the serial numbers `wanted`, or all where none are.

    Returns
    -------
    dict of int
        The library's index of each device by its number in the configuration.
    """
    identities = controller.open(_serials_to_open(controller, wanted))
    return _library_indices(controller, wanted, identities)


def _serials_to_open(controller: Controller, wanted: Sequence[Serial]) -> tuple[Serial, ...]:
    """Return those of the configured serial numbers that are connected; none wanted opens all.

    Raises
    ------
    NotConnectedError
        None of them is there; a foreign device is never opened instead.
    """
    if not wanted:
        return ()
    found = controller.find_devices()
    present = tuple(serial for serial in wanted if serial in found)
    if not present:
        raise NotConnectedError(
            f"none of the configured devices is connected (serial numbers {_listed(wanted)}; "
            f"found {_listed(found)}); check power and USB, or the serials in the platform file"
        )
    return present


def _library_indices(
    controller: Controller, wanted: Sequence[Serial], identities: Sequence[DeviceIdentity]
) -> dict[int, int]:
    """Return the library's index of each device by its number in the configuration.

    The library numbers whatever is connected, so that one device missing would shift the others
    onto foreign axes: only the serial numbers tell which is which.
    """
    if wanted:
        return {wanted.index(each.serial): each.index for each in identities}
    if len(identities) > 1 and not controller.simulated:
        logger.warning("no serials are configured: devices are numbered as the library does")
    return {each.index: each.index for each in identities}


def _listed(serials: Collection[Serial]) -> str:
    return ", ".join(map(str, serials)) or "none"
