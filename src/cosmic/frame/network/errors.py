"""What can go wrong between stations, as part of the one tree of exceptions."""

from cosmic.frame.errors import CosmicError, DeviceTimeout, NotAvailable, ProtocolError


class StationAway(NotAvailable):
    """The other station cannot be reached now; the text says why. Nothing was sent."""


class StationTimeout(DeviceTimeout):
    """The other station did not answer in time; what was not begun then will not be."""


class Busy(StationTimeout):
    """Other calls to the application took too long; this one was not carried out."""


class CommandExpired(CosmicError):  # noqa: N818 - reads as what happened
    """A command came too late, or a second time, and was not executed."""


class CallRefused(ProtocolError):  # noqa: N818 - reads as what happened
    """A call that is not offered: unknown, not marked as remote, not permitted, or ill-typed."""


class RemoteDefect(CosmicError):  # noqa: N818 - reads as what happened
    """A mistake in the program on the station; its text is in the station's log as well."""
