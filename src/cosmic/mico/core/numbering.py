"""Which device is which: the configuration numbers them by serial, the library as it likes."""

import logging
from collections.abc import Collection, Sequence

from cosmic.frame.errors import NotConnectedError
from cosmic.mico.hw.interface import Controller, DeviceIdentity

logger = logging.getLogger(__name__)


def open_devices(controller: Controller, wanted: Sequence[int]) -> dict[int, int]:
    """Open the devices with the serial numbers `wanted`, or all where none are.

    Returns
    -------
    dict of int
        The library's index of each device by its number in the configuration.
    """
    identities = controller.open(_serials_to_open(controller, wanted))
    return _library_indices(controller, wanted, identities)


def _serials_to_open(controller: Controller, wanted: Sequence[int]) -> tuple[int, ...]:
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
    controller: Controller, wanted: Sequence[int], identities: Sequence[DeviceIdentity]
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


def _listed(serials: Collection[int]) -> str:
    return ", ".join(map(str, serials)) or "none"
