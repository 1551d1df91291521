"""`EpicsGateway`: a station as EPICS records over Channel Access."""

import asyncio
import json
import logging
import types
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import partial
from itertools import count
from threading import Lock
from typing import Any, Final, Union, get_args, get_origin, get_type_hints

from cosmic.app.configuration.gateways import EpicsSettings
from cosmic.app.gateways import epics_channels as ca
from cosmic.app.gateways.catalogue import Command, commands_of, places_of
from cosmic.app.gateways.epics_channels import Channel, ChannelServer, Who
from cosmic.app.gateways.epics_image import ImageRecord
from cosmic.app.gateways.epics_motor import MotorRecord, ValueRecord
from cosmic.app.gateways.plain import to_json
from cosmic.app.gateways.session import Approve, GatewaySession
from cosmic.daqco.core.chunk import DataChunk
from cosmic.frame.clock import WALL
from cosmic.frame.declaration import Declared, declaration_of
from cosmic.frame.errors import ConfigError, CosmicError
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.network.caller import Access
from cosmic.frame.network.errors import Busy, CallRefused
from cosmic.frame.network.host import STATE, Host
from cosmic.frame.network.lease import LeaseState
from cosmic.frame.network.ongoing import StateMessage
from cosmic.frame.network.station import LEASE_TOPIC, Station
from cosmic.frame.network.transport import Rule, Subscription
from cosmic.frame.operation import Operation
from cosmic.mico.core.motion.positioner import PositionerState
from cosmic.mico.hw.interface import PositionerKind
from cosmic.vico.api.sent_image import SentImage
from cosmic.vico.hw.interface import PixelFormat

logger = logging.getLogger(__name__)

SHOWN_EVERY_S: Final = 0.04
IMAGES_EVERY_S: Final = 0.5
MOST_WAITING: Final = 32
LONGEST_SILENCE_S: Final = 600
_PLAIN: Final = (bool, int, float, str)
_Make = Callable[[], Channel]


class EpicsGateway:
    """A station as records; `close` it in every case.

    Each line of a client is a session of its own. It takes the right to move by a put of 1 to
    PREFIX + "control", and loses it with its line; by a put of seconds, also when it says nothing
    for so long.

    Raises
    ------
    NotAvailable
        It cannot listen there.
    ConfigError
        Two things would have the same name.
    """

    def __init__(
        self,
        station: Station,
        hosts: Mapping[str, Host],
        settings: EpicsSettings,
        approve: Approve | None = None,
    ) -> None:
        self._station = station
        self._hosts = dict(hosts)
        self._prefix = settings.prefix
        self._step_um = settings.step_um
        self._access = Access.MOVE if settings.write else Access.VIEW
        self._approve = approve
        self._lock = Lock()
        self._sessions: dict[tuple[str, int], GatewaySession] = {}
        self._numbers = count(1)
        self._queues = {
            name: JobQueue(f"{name} over EPICS", station.policy)
            for name in (*hosts, "stops", "reads")
        }
        self._newest: dict[str, object] = {}
        self._subscriptions: list[Subscription] = []
        self._motors: dict[str, MotorRecord] = {}
        self._values: dict[str, ValueRecord] = {}
        self._states: dict[tuple[str, ...], Channel] = {}
        self._images: dict[str, ImageRecord] = {}
        self._looked = 0
        self._going: dict[tuple[str, tuple[str, ...]], list[Operation[Any]]] = {}
        self._control = ca.whole(put=self._take)
        self._holder = ca.line()
        self._why_not = ca.text(length=500)
        self._of: dict[str, dict[str, _Make]] = {}
        self._there: dict[str, object] = {}
        channels: dict[str, Channel] = {}
        for name, channel in self._all_channels():
            if name in channels:
                raise ConfigError(f"EPICS: two things would be the record {name}; rename one")
            channels[name] = channel
        self._server = ChannelServer(
            channels,
            (settings.interface, settings.port),
            station.policy,
            self._show,
            self._gone,
            self._heard,
        )
        self._follow()
        self._server.start()
        try:
            self._server.wait_started(WALL.sleep)
        except CosmicError:
            self.close()
            raise

    @property
    def address(self) -> str:
        """Where it is reached, and what its names begin with."""
        return f"port {self._server.port}, names begin with {self._prefix}"

    @property
    def port(self) -> int:
        """Where it listens."""
        return self._server.port

    def close(self) -> None:
        """Stop what clients have set in motion and answer no more; any state."""
        with self._lock:
            sessions, self._sessions = list(self._sessions.values()), {}
        for session in sessions:
            session.close()
        self._server.request_end()
        self._server.join()
        for each in self._subscriptions:
            each.close()
        for queue in self._queues.values():
            queue.request_end()
            queue.join()

    # Which records there are

    def _all_channels(self) -> Iterator[tuple[str, Channel]]:
        yield f"{self._prefix}control", self._control
        yield f"{self._prefix}control:holder", self._holder
        yield f"{self._prefix}control:reason", self._why_not
        for name, host in self._hosts.items():
            values = host.state(whole=False).values
            self._there[name] = _parts_there(name, host, values)
            declared = list(self._declared(name, host, values))
            self._of[name] = dict(declared)
            for record, make in declared:
                yield record, make()
            yield from self._special(name, values)

    def _declared(
        self, name: str, host: Host, values: Mapping[str, Any]
    ) -> "Iterator[tuple[str, _Make]]":
        """Yield the records of what an application declares, and how they are made."""
        for command in commands_of(name, type(host.served)):
            for keys in _keys(values, command.place.parts, command.place.keyed):
                parts, keyed = command.place.parts, command.place.keyed
                at = (name, *_steps(parts, keyed, keys), command.declared.name)
                yield self._prefix + _joined(at), partial(self._command_channel, command, keys)
        for at, kind in _plain_states(host.served, (name,)):
            yield self._prefix + _joined(at), partial(self._state_record, at, kind)

    def _state_record(self, at: tuple[str, ...], kind: Any) -> Channel:
        self._states[at] = _state_channel(kind)
        return self._states[at]

    def _follow_parts(self, name: str, values: Mapping[str, Any]) -> None:
        """Add the records of parts that have come, such as players, and end those that are gone."""
        host = self._hosts[name]
        there = _parts_there(name, host, values)
        if there == self._there[name]:
            return
        before, now = self._of[name], dict(self._declared(name, host, values))
        gone = {each for each in before if each not in now}
        self._states = {
            at: each
            for at, each in self._states.items()
            if at[0] != name or self._prefix + _joined(at) not in gone
        }
        come = {each: make() for each, make in now.items() if each not in before}
        self._server.change(come, gone)
        self._there[name], self._of[name] = there, now

    def _special(self, name: str, values: Mapping[str, Any]) -> Iterator[tuple[str, Channel]]:
        for axis, held in values.get("axes", {}).items() if name == "mico" else ():
            state = held["_latest"]
            if isinstance(state, PositionerState) and state.kind is not PositionerKind.OPEN_LOOP:
                motor = MotorRecord(self._prefix + _plain(axis), axis, state, self, self._step_um)
                self._motors[axis] = motor
                yield from motor.channels.items()
        for channel in values["settings"].channel if name == "daqco" else ():
            record = ValueRecord(self._prefix + _plain(channel.name), "V")
            self._values[channel.name] = record
            yield from record.channels.items()
        for camera in values.get("camera_handles", {}) if name == "vico" else ():
            base = f"{self._prefix}{_plain(camera)}:image:"
            settings = values["camera_handles"][camera].get("_settings")
            kind = settings.pixel_format if settings is not None else PixelFormat.MONO8
            self._images[camera] = ImageRecord(base, camera, kind)
            yield from self._images[camera].channels.items()

    def _command_channel(self, command: Command, keys: tuple[str, ...]) -> Channel:
        async def put(who: Who, said: str) -> None:
            channel = made
            try:
                arguments = _arguments(said)
            except CallRefused:
                if not command.declared.need.at_once:
                    raise
                arguments = {}  # a stop is carried out whatever is put
            try:
                result = await self._carried_out(who, command, arguments, keys)
            except CosmicError as exc:
                await _answer(channel, {"error": str(exc)[:1000]})
                raise
            await _answer(channel, {"result": to_json(result)})

        made = ca.text("{}", put=put, otherwise="" if command.declared.need.at_once else None)
        return made

    # Commands

    async def run(
        self, who: Who, function: str, arguments: dict[str, Any], keys: tuple[str, ...]
    ) -> None:
        """Carry out a command of MiCo and await its end; raises `CosmicError`."""
        await self._run(who, "mico", function, arguments, keys)

    def may_move(self, who: Who) -> bool:
        """Return whether a client holds the right to move."""
        return self._session(who).in_control

    async def look(self, axis: str) -> PositionerState:
        """Return the newest state of an axis."""
        host = self._hosts["mico"]
        job = self._queues["reads"].submit(lambda: host.state(whole=False), "state")
        await _ended(job)
        self._looked = max(self._looked, job.result.number)
        held: Any = job.result.values["axes"]
        found: PositionerState = held[axis]["_latest"]
        return found

    async def _carried_out(
        self, who: Who, command: Command, arguments: dict[str, Any], keys: tuple[str, ...]
    ) -> object:
        application = command.place.application
        return await self._run(who, application, command.function, arguments, keys)

    async def _run(
        self,
        who: Who,
        application: str,
        function: str,
        arguments: dict[str, Any],
        keys: tuple[str, ...],
    ) -> object:
        session = self._session(who)
        order = session.order(application, function, arguments, keys)
        queue = self._queues["stops" if order.found.mark.at_once else application]
        if queue.waiting >= MOST_WAITING:
            raise Busy(f"too many commands wait for {application}")
        job = queue.submit(lambda: session.carry_out(order), order.title)
        await _ended(job)
        result = job.result
        if order.found.mark.at_once and not order.found.mark.renews:
            self._take_back(application, keys)
        if isinstance(result, Operation):
            going = self._going.setdefault((application, keys), [])
            going.append(result)
            try:
                await _ended(result)
            finally:
                going.remove(result)
            return result.result
        return result

    def _take_back(self, application: str, keys: tuple[str, ...]) -> None:
        """End what waits where something was halted: an approval would come too late for it."""
        for (of, at), going in list(self._going.items()):
            if of == application and at[: len(keys)] == keys:
                for each in list(going):
                    each.cancel()

    async def _take(self, who: Who, value: int) -> None:
        session = self._session(who)
        try:
            self._change_control(session, value)
        except CosmicError as exc:
            await ca.show(self._why_not, str(exc)[:499])
            raise
        await ca.show(self._why_not, "")
        if session.in_control:
            for motor in self._motors.values():
                await motor.forget("NO_LEASE")
        await self._show_one(LEASE_TOPIC, self._station.lease.state)

    @staticmethod
    def _change_control(session: GatewaySession, value: int) -> None:
        if value == 0:
            session.release_control()
        elif value == 1:
            session.take_control(in_process=True)  # its line is watched instead
        elif 2 <= value <= LONGEST_SILENCE_S:
            session.take_control(keep_s=float(value))
        else:
            raise CallRefused(
                "put 1 to take the right to move, 0 to give it back, 2 to "
                f"{LONGEST_SILENCE_S} to have it for so many seconds of silence"
            )

    def _session(self, who: Who) -> GatewaySession:
        with self._lock:
            found = self._sessions.get(who.address)
            if found is None:
                name = f"EPICS {who.user[:20]} {who.host[:20]} {next(self._numbers)}"
                found = GatewaySession(
                    self._station, name, self._access, self._approve, door="epics"
                )
                self._sessions[who.address] = found
        return found

    def _heard(self, address: tuple[str, int]) -> None:
        found = self._sessions.get(address)
        if found is not None:
            found.beat()

    def _end_silent(self) -> None:
        """End what moves for clients that want to be watched and have fallen silent."""
        with self._lock:
            watched = [each for each in self._sessions.values() if each.may_be_silent]
        for each in watched:
            each.end_silent_motion()
        if watched:
            self._station.lease.poll()

    def _gone(self, address: tuple[str, int]) -> None:
        with self._lock:
            found = self._sessions.pop(address, None)
        if found is not None:
            self._queues["stops"].submit(lambda: found.close(f"{found.name} is gone"), "gone")

    # What is shown

    def _follow(self) -> None:
        topics = [LEASE_TOPIC, *(f"{name}/{STATE}" for name in self._hosts)]
        topics += ["daqco/display"] if "daqco" in self._hosts else []
        topics += [f"vico/camera_handles/{each}/shown" for each in self._images]
        self._newest[LEASE_TOPIC] = self._station.lease.state
        for topic in topics:
            bus = self._station.bus
            self._subscriptions.append(bus.subscribe(topic, Rule.LATEST, self._taker(topic)))

    def _taker(self, topic: str) -> Callable[[object], None]:
        def take(payload: object) -> None:
            self._newest[topic] = payload

        return take

    async def _show(self) -> None:
        shown: dict[str, object] = {}
        images_due_s = 0.0
        while True:
            await asyncio.sleep(SHOWN_EVERY_S)
            self._end_silent()
            now_s = WALL.now_s()
            for value in self._values.values():
                await value.look(now_s)
            images = now_s >= images_due_s
            if images:
                images_due_s = now_s + IMAGES_EVERY_S
            for topic, payload in list(self._newest.items()):
                if shown.get(topic) is payload or (topic.endswith("/shown") and not images):
                    continue
                shown[topic] = payload
                await self._show_one(topic, payload)

    async def _show_one(self, topic: str, payload: object) -> None:
        if isinstance(payload, StateMessage):
            application = topic.partition("/")[0]
            if application == "mico" and payload.number < self._looked:
                return  # a motion that has ended meanwhile would begin again
            await self._show_state(application, payload.values)
        elif isinstance(payload, LeaseState):
            await ca.show(self._holder, payload.holder[:39])
            await ca.show(self._control, int(not payload.local))
        elif isinstance(payload, DataChunk):
            await self._show_samples(payload)
        elif isinstance(payload, SentImage):
            await self._images[payload.camera].show(payload)

    async def _show_state(self, application: str, values: Mapping[str, Any]) -> None:
        self._follow_parts(application, values)
        if application == "mico":
            for axis, motor in self._motors.items():
                held = values["axes"].get(axis)
                if held is not None:
                    await motor.show(held["_latest"])
                if values["stop_state"].reason is None:
                    await motor.forget("STOPPED")
        for at, channel in list(self._states.items()):
            if at[0] != application:
                continue
            value: Any = values
            for step in at[1:]:
                inside = isinstance(value, Mapping)
                value = value.get(step) if inside else getattr(value, step, None)
            await _show_plain(channel, value)

    async def _show_samples(self, chunk: DataChunk) -> None:
        served: Any = self._hosts["daqco"].served
        limits = {each.channel: each for each in served.limits_there}
        for row, name in enumerate(chunk.channels):
            record = self._values.get(name)
            if record is not None:
                scale = chunk.scales[row]
                samples = scale.apply(chunk.volts[row])
                await record.show(samples, scale.unit, limits.get(name), WALL.now_s())


async def _ended(operation: Operation[Any]) -> None:
    """Wait until an operation has ended; the loop goes on meanwhile."""
    loop, ended = asyncio.get_running_loop(), asyncio.Event()

    def wake(_operation: object) -> None:
        with suppress(RuntimeError):
            loop.call_soon_threadsafe(ended.set)

    operation.add_callback(wake)
    await ended.wait()


def _arguments(said: str) -> dict[str, Any]:
    """Return what was put to a command, by name; raises `CallRefused`."""
    try:
        found = json.loads(said or "{}")
    except (ValueError, RecursionError) as exc:
        raise CallRefused(f"arguments are JSON: {str(exc)[:100]}") from exc
    if not isinstance(found, dict):
        raise CallRefused("arguments are a JSON object, by their names")
    return found


async def _answer(channel: Channel, said: dict[str, Any]) -> None:
    coded = json.dumps(said)
    await channel.write(coded if len(coded) < ca.JSON_LENGTH else '{"result": "too large"}')


def _parts_there(name: str, host: Host, values: Mapping[str, Any]) -> object:
    """Return which objects of an application there are."""
    places = places_of(name, type(host.served))
    return {(each.parts, tuple(_keys(values, each.parts, each.keyed))) for each in places}


def _plain(name: str) -> str:
    return name.replace(".", "_")


def _joined(steps: tuple[str, ...]) -> str:
    return ":".join(_plain(each) for each in steps)


def _steps(parts: tuple[str, ...], keyed: tuple[bool, ...], keys: tuple[str, ...]) -> Iterator[str]:
    left = iter(keys)
    for part, with_key in zip(parts, keyed, strict=True):
        yield part
        if with_key:
            yield next(left)


def _keys(
    values: Any, parts: tuple[str, ...], keyed: tuple[bool, ...]
) -> Iterator[tuple[str, ...]]:
    """Yield the keys that lead to each object that there is."""
    if not parts:
        yield ()
        return
    inner = values.get(parts[0])
    if inner is None:
        return
    if not keyed[0]:
        yield from _keys(inner, parts[1:], keyed[1:])
        return
    for key, held in inner.items():
        for rest in _keys(held, parts[1:], keyed[1:]):
            yield (key, *rest)


def _plain_states(served: Declared, at: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield where each state is that is a number, a truth value or a text, and of which kind.

    The fields of a state that is made of them are there as well, such as "stop_state", "reason".
    """
    declaration = declaration_of(type(served))
    for name, each in declaration.state.items():
        if each.fixed:
            continue
        (kind,) = _kinds(each.kind)[:1] or (None,)
        if is_dataclass(kind) and isinstance(kind, type):
            hints = get_type_hints(kind)
            for field in fields(kind):
                yield from _if_plain((*at, name, field.name), hints[field.name])
        else:
            yield from _if_plain((*at, name), each.kind)
    for name, part in declaration.parts.items():
        found = getattr(served, name)
        inner = found.items() if part.keyed else [("", found)]
        for key, held in inner:
            if held is not None:
                yield from _plain_states(held, (*at, name, key) if key else (*at, name))


def _if_plain(at: tuple[str, ...], annotation: Any) -> Iterator[tuple[tuple[str, ...], Any]]:
    kinds = _kinds(annotation)
    if len(kinds) == 1 and kinds[0] in _PLAIN:
        yield at, kinds[0]
    elif len(kinds) == 1 and isinstance(kinds[0], type) and issubclass(kinds[0], Enum):
        yield at, str


def _kinds(annotation: Any) -> tuple[Any, ...]:
    """Return what an annotation lets in, but for None."""
    alternatives = get_origin(annotation) in (Union, types.UnionType)
    found = get_args(annotation) if alternatives else (annotation,)
    return tuple(each for each in found if each is not type(None))


def _state_channel(kind: Any) -> Channel:
    if kind is str:
        return ca.text(length=500)
    return ca.number() if kind is float else ca.whole()


async def _show_plain(channel: Channel, value: object) -> None:
    """Show a value; one that nobody knows has an alarm, where it is a number."""
    shown = to_json(value)
    if isinstance(channel, ca.Text):
        await ca.show(channel, "" if shown is None else str(shown)[:499])
    elif shown is None:
        await ca.show(channel, channel.value, ca.UNKNOWN)
    elif isinstance(shown, float):
        await ca.show(channel, shown)
    elif isinstance(shown, int):
        fits = -(2**31) <= shown < 2**31  # Channel Access has no longer ones
        newest = shown if fits else channel.value
        await ca.show(channel, int(newest), ca.NO_ALARM if fits else ca.UNKNOWN)
