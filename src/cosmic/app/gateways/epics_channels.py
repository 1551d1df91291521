"""Channels of Channel Access and the server for them: the file that wraps caproto."""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

import caproto
import numpy as np
from caproto import AlarmSeverity, AlarmStatus, CAStatus
from caproto._utils import ConversionDirection
from caproto.asyncio.server import Context, VirtualCircuit
from caproto.server.common import DisconnectedCircuit
from typing_extensions import override

from cosmic.app.gateways.line_watch import keep_watch
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.errors import CallRefused
from cosmic.frame.threads import WorkerThread

logger = logging.getLogger(__name__)

MOST_CLIENTS: Final = 128
JSON_LENGTH: Final = 16_000
LARGEST_MESSAGE: Final = 1 << 18
"""In bytes; no command is as long, and a head alone may promise 4 GB."""
MOST_CHANNELS: Final = 2000
"""So many records, and monitors, one line has."""
MOST_MONITORED: Final = 32_000_000
"""Values in all monitors of one line."""
_ARRAYS_WAITING: Final = 2
"""So many arrays wait for a client that does not read; the newest count."""
_START_S: Final = 10.0

_DONE: Final = int(CAStatus.ECA_NORMAL.value.code_with_severity)
_REFUSED: Final = int(CAStatus.ECA_PUTFAIL.value.code_with_severity)

NO_ALARM: Final = (AlarmStatus.NO_ALARM, AlarmSeverity.NO_ALARM)
UNKNOWN: Final = (AlarmStatus.UDF, AlarmSeverity.INVALID_ALARM)
FAULT: Final = (AlarmStatus.STATE, AlarmSeverity.MAJOR_ALARM)
TOO_HIGH: Final = (AlarmStatus.HIHI, AlarmSeverity.MAJOR_ALARM)
TOO_LOW: Final = (AlarmStatus.LOLO, AlarmSeverity.MAJOR_ALARM)
ALARMS: Final = {
    "STOPPED": (AlarmStatus.DISABLE, AlarmSeverity.MAJOR_ALARM),
    "NO_LEASE": (AlarmStatus.WRITE_ACCESS, AlarmSeverity.MAJOR_ALARM),
    "LIMIT": (AlarmStatus.HWLIMIT, AlarmSeverity.MAJOR_ALARM),
    "POSITION_UNKNOWN": UNKNOWN,
    "COLLISION": (AlarmStatus.SOFT, AlarmSeverity.MAJOR_ALARM),
    "NO_ANSWER": (AlarmStatus.TIMEOUT, AlarmSeverity.MAJOR_ALARM),
    "DEVICE": (AlarmStatus.COMM, AlarmSeverity.MAJOR_ALARM),
}
"""Alarm of a refused move, by the reason of its verdict."""

Alarm = tuple[AlarmStatus, AlarmSeverity]
Channel = Any
"""A channel of caproto, which has no types."""
Text = caproto.ChannelChar


@dataclass(frozen=True, slots=True)
class Who:
    """A client that writes: its line, and what it says of itself, which is not proven."""

    address: tuple[str, int]
    host: str
    user: str


Put = Callable[[Who, Any], Awaitable[None]]
"""`put(who, value)` carries out a write; what it raises refuses it."""


class PutRefused(Exception):  # noqa: N818 - reads as what happened
    """A write that was not carried out; the text says why."""


def number(
    value: float = 0.0,
    *,
    put: Put | None = None,
    units: str = "",
    limits: tuple[float, float] | None = None,
    precision: int = 4,
) -> Channel:
    """Return a channel with a float."""
    low, high = limits or (0.0, 0.0)
    made = caproto.ChannelDouble(
        value=value,
        units=units,
        precision=precision,
        lower_ctrl_limit=low,
        upper_ctrl_limit=high,
        lower_disp_limit=low,
        upper_disp_limit=high,
    )
    return _guarded(made, put)


def whole(value: int = 0, *, put: Put | None = None, otherwise: int | None = None) -> Channel:
    """Return a channel with a whole number.

    `otherwise` stands for what is written and is none, or is cut to 0.
    """
    return _guarded(caproto.ChannelInteger(value=value), put, otherwise)


def choice(words: Sequence[str], value: int = 0, *, put: Put | None = None) -> Channel:
    """Return a channel with one of a few words."""
    return _guarded(caproto.ChannelEnum(value=words[value], enum_strings=list(words)), put)


def line(value: str = "", *, put: Put | None = None) -> Channel:
    """Return a channel with a text of up to 39 letters."""
    return _guarded(caproto.ChannelString(value=value[:39], string_encoding="utf-8"), put)


def text(
    value: str = "",
    *,
    put: Put | None = None,
    length: int = JSON_LENGTH,
    otherwise: str | None = None,
) -> Channel:
    """Return a channel with a long text, as an array of characters; see `whole`."""
    made = caproto.ChannelChar(
        value=value,
        max_length=length,
        string_encoding="utf-8",
        max_subscription_backlog=_ARRAYS_WAITING,
    )
    return _guarded(made, put, otherwise)


def wave(length: int, units: str = "") -> Channel:
    """Return a channel with an array of floats."""
    made = caproto.ChannelDouble(
        value=[0.0],
        max_length=length,
        units=units,
        max_subscription_backlog=_ARRAYS_WAITING,
    )
    return _guarded(made, None)


def wholes(length: int) -> Channel:
    """Return a channel with an array of whole numbers."""
    made = caproto.ChannelInteger(
        value=[0], max_length=length, max_subscription_backlog=_ARRAYS_WAITING
    )
    return _guarded(made, None)


def pixels(length: int) -> Channel:
    """Return a channel with an array of bytes."""
    made = caproto.ChannelByte(
        value=b"\0", max_length=length, max_subscription_backlog=_ARRAYS_WAITING
    )
    return _guarded(made, None)


async def show(channel: Channel, value: object, alarm: Alarm = NO_ALARM, **more: Any) -> None:
    """Publish a value with its alarm, unless it was published last."""
    said = (value if not isinstance(value, np.ndarray) else id(value), alarm, tuple(more.items()))
    if getattr(channel, "said", None) == said:
        return
    channel.said = said
    status, severity = alarm
    # Verifying, caproto takes an alarm of before back, and with it the one given here.
    await channel.write(value, verify_value=False, status=status, severity=severity, **more)


def _guarded(channel: Channel, put: Put | None, otherwise: object = None) -> Channel:
    """Have clients write through `put`; without it they may only read.

    What is of a wrong kind is refused, unless `otherwise` stands for it.
    """
    rights = caproto.AccessRights.READ
    if put is not None:
        rights |= caproto.AccessRights.WRITE
    channel.check_access = lambda _host, _user: rights

    async def auth_write(
        host: str,
        user: str,
        data: Any,
        data_type: Any,
        _metadata: Any,
        *,
        flags: int = 0,
        user_address: tuple[str, int] = ("", 0),
    ) -> int:
        del flags
        if put is None:
            return _REFUSED
        who = Who((user_address[0], user_address[1]), str(host), str(user))
        try:
            try:
                value = _value(channel, data, data_type)
            except CallRefused:
                if otherwise is None:
                    raise
                value = otherwise
            if otherwise is not None and value == 0 and _is_more_than_zero(data):
                value = otherwise  # what was cut off on the way to a whole number
            await put(who, value)
        except (CosmicError, PutRefused) as exc:
            logger.info("EPICS: %s of %s: a write was refused: %s", who.user, who.host, exc)
            return _REFUSED
        except Exception:  # a defect: caproto would leave the client without an answer
            logger.exception("EPICS: a write of %s of %s failed", who.user, who.host)
            return _REFUSED
        return _DONE

    channel.auth_write = auth_write
    return channel


def _is_more_than_zero(data: Any) -> bool:
    """Return whether numbers that were written are not all 0."""
    try:
        return any(float(each) != 0.0 for each in data)
    except (TypeError, ValueError):
        return False


def _value(channel: Channel, data: Any, data_type: Any) -> Any:
    try:
        found = caproto.backend.convert_values(
            values=data,
            from_dtype=caproto.native_type(data_type),
            to_dtype=channel.data_type,
            string_encoding=channel.string_encoding,
            enum_strings=getattr(channel, "enum_strings", None),
            direction=ConversionDirection.FROM_WIRE,
        )
        return channel.preprocess_value(found)
    except (caproto.CaprotoError, ValueError, TypeError, IndexError, KeyError) as exc:
        raise CallRefused(f"what was written is of a wrong kind: {str(exc)[:100]}") from exc


class _Line(VirtualCircuit):  # type: ignore[misc]  # caproto has no types
    """One client: what breaks the protocol, or wants too much, ends with its line alone."""

    def __init__(self, *of: Any) -> None:
        super().__init__(*of)
        self.since_s = WALL.now_s()

    @override
    async def recv(self) -> None:
        await super().recv()
        if len(self.circuit._data) > LARGEST_MESSAGE:  # noqa: SLF001 - nothing else tells
            await self._end("a message is too long")

    @override
    async def command_queue_loop(self) -> None:
        try:
            await super().command_queue_loop()
        except Exception as exc:  # noqa: BLE001 - caproto raises what its own search found
            logger.info("EPICS: a client broke the protocol: %r", exc)
        finally:
            self.client.close()  # caproto leaves it open, and whoever hangs on it moving

    @override
    async def _process_command(self, command: Any) -> Any:
        self.context.heard(tuple(self.circuit.address))
        if isinstance(command, caproto.EventAddRequest):
            held = self.subscriptions.items()
            values = sum(len(each) * of.db_entry.max_length for of, each in held)
            if sum(len(each) for _, each in held) >= MOST_CHANNELS or values > MOST_MONITORED:
                await self._end("it monitors too much")
        elif len(self.circuit.channels) > MOST_CHANNELS:
            await self._end("it asks for too many records")
        return await super()._process_command(command)

    async def _end(self, why: str) -> None:
        logger.info("EPICS: a line is ended: %s", why)
        await self._on_disconnect()
        raise DisconnectedCircuit


class ChannelServer(WorkerThread):
    """Serves channels in a thread with an event loop; at last `request_end` and `join`.

    Parameters
    ----------
    run : callable
        `run()` is awaited in the loop beside the server; it shows what changes.
    on_gone : callable
        `on_gone(address)` is called when the line of a client has ended.
    on_heard : callable
        `on_heard(address)` is called for each message of a client, before it is carried out.
    """

    def __init__(
        self,
        channels: Mapping[str, Channel],
        where: tuple[str, int],
        policy: FailurePolicy,
        run: Callable[[], Awaitable[None]],
        on_gone: Callable[[tuple[str, int]], None],
        on_heard: Callable[[tuple[str, int]], None],
    ) -> None:
        super().__init__("EPICS server", policy)
        logging.getLogger("caproto").setLevel(logging.ERROR)  # it logs each client that comes
        self._channels = dict(channels)
        self._interface, self._port = where
        self._run = run
        self._on_gone = on_gone
        self._on_heard = on_heard
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ending: asyncio.Event | None = None
        self._problem = ""
        self._listening_at = 0

    @property
    def port(self) -> int:
        """Where it listens; 0 while it does not."""
        return self._listening_at

    @property
    def problem(self) -> str:
        """Why it does not listen; empty while it does."""
        return self._problem

    def change(self, come: Mapping[str, Channel], gone: Iterable[str]) -> None:
        """Serve more channels, and others no longer to whom asks for them; in the loop."""
        for name in gone:
            self._channels.pop(name, None)
        for name, channel in come.items():
            self._channels.setdefault(name, channel)

    @override
    def run_body(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._loop, self._ending = asyncio.get_running_loop(), asyncio.Event()
        if self.end_requested:
            return
        context = Context(self._channels, [self._interface])
        context.CircuitClass = _Line
        if self._port:
            context.ca_server_port = self._port
        inner = context.circuit_disconnected
        accept = context.tcp_handler

        async def gone(circuit: Any) -> None:
            self._on_gone(tuple(circuit.circuit.address))
            await inner(circuit)

        async def come(client: Any, address: Any) -> None:
            if len(context.circuits) >= MOST_CLIENTS and not _make_room(context.circuits):
                client.writer.close()
                return
            keep_watch(client.writer.get_extra_info("socket"))
            await accept(client, address)

        context.circuit_disconnected, context.tcp_handler = gone, come
        context.heard = self._on_heard
        context.broadcast_beacon_loop = _nothing  # it would tell the whole network
        serving = asyncio.ensure_future(context.run())
        showing = asyncio.ensure_future(self._run())
        ending = asyncio.ensure_future(self._ending.wait())
        noting = asyncio.ensure_future(self._note_port(context))
        try:
            await asyncio.wait((serving, showing, ending), return_when=asyncio.FIRST_COMPLETED)
            for each in (serving, showing):
                if each.done() and not each.cancelled() and each.exception() is not None:
                    self._problem = str(each.exception())
                    logger.error("the EPICS server ended: %s", self._problem)
        finally:
            for each in (serving, showing, ending, noting):
                each.cancel()
            for each in (serving, showing, ending, noting):
                with suppress(asyncio.CancelledError, Exception):
                    await asyncio.wait_for(each, 2.0)

    async def _note_port(self, context: Any) -> None:
        while context.port is None or not context.udp_socks:
            await asyncio.sleep(0.01)
        self._listening_at = int(context.port)

    @override
    def request_end(self) -> None:
        super().request_end()
        loop, ending = self._loop, self._ending
        if loop is not None and ending is not None:
            with suppress(RuntimeError):
                loop.call_soon_threadsafe(ending.set)

    def wait_started(self, sleep: Callable[[float], None]) -> None:
        """Wait until it listens.

        Raises
        ------
        NotAvailable
            It cannot.
        """
        for _ in range(round(_START_S / 0.02)):
            if self._listening_at or self._problem:
                break
            sleep(0.02)
        if not self._listening_at:
            raise NotAvailable(
                f"EPICS cannot listen at {self._interface}: {self._problem or 'no answer'}"
            )


def _make_room(lines: set[Any]) -> bool:
    """End the oldest line that never asked for a record; False where each did."""
    idle = [each for each in lines if not each.circuit.channels]
    if not idle:
        return False
    oldest = min(idle, key=lambda each: float(each.since_s))
    lines.discard(oldest)
    oldest.client.close()
    return True


async def _nothing() -> None:
    await asyncio.Event().wait()
