"""`HttpGateway`: commands, state, images and files of a station over HTTP and WebSocket."""

import asyncio
import json
import logging
import secrets
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from hashlib import sha256
from importlib.resources import files
from itertools import count
from math import inf
from typing import Any, Final, TypeVar

from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, HTTPConnection, Request
from starlette.responses import (
    FileResponse,
    HTMLResponse,
    JSONResponse,
    Response,
    StreamingResponse,
)
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from cosmic.app.configuration.gateways import HttpClient, HttpSettings
from cosmic.app.gateways.catalogue import commands_of
from cosmic.app.gateways.http_answers import (
    HttpError,
    answer_of,
    body_of,
    ended,
    refusal_of,
    seconds_of,
    word_of,
)
from cosmic.app.gateways.http_lines import MOST_LINES, HttpLines
from cosmic.app.gateways.http_server import BEAT_S, HttpServer, listening
from cosmic.app.gateways.hub import Hub, Unfollow
from cosmic.app.gateways.image_files import encoded_image, newest_image, shown_jpeg
from cosmic.app.gateways.mcp import McpTools, McpUses
from cosmic.app.gateways.openapi import described
from cosmic.app.gateways.plain import to_json
from cosmic.app.gateways.session import Approve, GatewaySession, Order
from cosmic.app.gateways.websocket_line import Handover, WebSocketLine
from cosmic.daqco.api.daqco import Daqco
from cosmic.frame.clock import WALL
from cosmic.frame.declaration import Declared, declaration_of
from cosmic.frame.errors import CosmicError, OperationCancelled
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.network.caller import MOVE_LIMIT_S, Access
from cosmic.frame.network.errors import Busy
from cosmic.frame.network.host import Host
from cosmic.frame.network.lease import LeaseState
from cosmic.frame.network.refusals import RefusalCount
from cosmic.frame.network.station import Station
from cosmic.frame.operation import Operation

logger = logging.getLogger(__name__)

T = TypeVar("T")

MOST_REQUESTS_S: Final = 200.0
"""So many requests a second of one client are answered; what is more gets 429."""
MOST_STOPS_S: Final = 20.0
"""So many stops a second of one client are carried out beyond that."""
MOST_WAITING: Final = 32
"""So many commands wait for one application."""
LONGEST_WAIT_S: Final = 60.0
MCP_WAIT_S: Final = 45.0
"""So long a tool of MCP waits for the end of what it began; common clients wait for 60 s."""
FIRST_WORD_S: Final = 3.0
MOST_OPERATIONS: Final = 256
SLOWED_AFTER: Final = 20


class _Share:
    """How many of something a client has had of late."""

    def __init__(self) -> None:
        self._left = inf
        self._looked_s = 0.0

    def take(self, now_s: float, most_s: float) -> bool:
        """Take one; False where there were more than `most_s` a second."""
        gained = (now_s - self._looked_s) * most_s
        self._left, self._looked_s = min(most_s, self._left + gained), now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


@dataclass
class _User:
    """A client that is known by its token, with its session."""

    settings: HttpClient
    session: GatewaySession
    operations: dict[str, Operation[Any]] = field(default_factory=dict)
    numbers: "count[int]" = field(default_factory=lambda: count(1))
    lines: int = 0
    requests: _Share = field(default_factory=_Share)
    stops: _Share = field(default_factory=_Share)
    heard_s: float = 0.0

    def keep(self, operation: Operation[Any]) -> str:
        """Keep an operation under a number."""
        number = str(next(self.numbers))
        self.operations[number] = operation
        for old in [each for each, one in self.operations.items() if one.done]:
            if len(self.operations) > MOST_OPERATIONS:
                del self.operations[old]
        return number

    def going_on(self, number: str) -> Operation[Any]:
        """Return an operation by its number; raises `HttpError`."""
        found = self.operations.get(number)
        if found is None:
            raise HttpError(404, f"there is no operation {number[:20]!r}")
        return found


class HttpGateway:
    """A station over HTTP; `close` it in every case.

    Parameters
    ----------
    hosts : mapping of str to Host
        The declared applications.
    facts : mapping
        What the station says of itself.
    approve : callable or None
        Asked before a command that moves is carried out.

    Raises
    ------
    NotAvailable
        It cannot listen there.
    """

    def __init__(
        self,
        station: Station,
        hosts: Mapping[str, Host],
        settings: HttpSettings,
        facts: Mapping[str, object],
        approve: Approve | None = None,
    ) -> None:
        self._station = station
        self._hosts = dict(hosts)
        self._facts = dict(facts)
        self._settings = settings
        kinds: dict[str, type[Declared]] = {name: type(each.served) for name, each in hosts.items()}
        self._hub = Hub(station, {name: each.served for name, each in hosts.items()})
        self._openapi = described(kinds)
        self._tools = McpTools(kinds)
        self._waiting_s = {
            (name, each.function): each.declared.need.timeout_s
            for name, kind in kinds.items()
            for each in commands_of(name, kind)
        }
        self._stops = {
            (name, each.function)
            for name, kind in kinds.items()
            for each in commands_of(name, kind)
            if each.declared.need.at_once
        }
        self._approve = approve
        self._users = {
            sha256(each.token.encode()).digest(): self._user(each) for each in settings.client
        }
        self._handover: Handover | None = None  # made in the loop, by the first line
        self._refusals = RefusalCount(WALL)
        self._queues = {
            name: JobQueue(f"{name} over HTTP", station.policy)
            for name in (*hosts, "", "stops", "unfollow")
        }
        self._lines = HttpLines()
        application = self._application()
        self._socket = listening(settings)
        self._server = HttpServer(
            application, self._socket, settings, station, self._end_silent_motion, self._lines
        )
        self._server.start()

    @property
    def address(self) -> str:
        """Where it is reached."""
        host, port = self._socket.getsockname()[:2]
        shown = f"[{host}]" if ":" in host else host
        return f"{'https' if self._settings.certificate else 'http'}://{shown}:{port}"

    def close(self) -> None:
        """Stop what clients have set in motion and answer no more; any state."""
        for user in self._users.values():
            user.session.close("the HTTP gateway closes")
        self._server.request_end()
        self._server.join()
        self._hub.close()
        for queue in self._queues.values():
            queue.request_end()
            queue.join()

    def _end_silent_motion(self) -> None:
        for user in self._users.values():
            user.session.end_silent_motion()

    def _user(self, settings: HttpClient) -> _User:
        access = Access[settings.access.upper()]
        session = GatewaySession(self._station, settings.name, access, self._approve, door="http")
        return _User(settings, session)

    def _application(self) -> Starlette:
        def route(path: str, answer: Callable[..., Any], *methods: str) -> Route:
            return Route(path, self._guarded(answer), methods=list(methods))

        return Starlette(
            routes=[
                Route("/", self._page, methods=["GET"]),
                Route("/openapi.json", self._description, methods=["GET"]),
                route("/api/station", self._about, "GET"),
                route("/api/control", self._control, "POST", "DELETE"),
                route("/api/operations/{number}", self._operation, "GET", "DELETE"),
                route("/api/images/{camera}", self._image, "GET"),
                route("/api/files", self._files, "GET"),
                route("/api/files/{name}", self._file, "GET"),
                WebSocketRoute("/api/events", self._events),
                route("/mcp", self._mcp, "POST"),
                route("/mcp", self._mcp_line, "GET"),
                route("/mcp", self._mcp_end, "DELETE"),
                route("/api/{application}/{path:path}", self._state, "GET"),
                route("/api/{application}/{path:path}", self._command, "POST"),
            ]
        )

    # Who asks

    def _guarded(self, answer: Callable[..., Any]) -> Callable[[Request], Any]:
        async def guarded(request: Request) -> Response:
            try:
                user = await self._known(request)
                found: Response = await answer(request, user)
                return found
            except HttpError as exc:
                return refusal_of(exc.status, "HttpError", str(exc))
            except CosmicError as exc:
                return answer_of(exc)
            except ClientDisconnect:
                return Response(status_code=400)
            except Exception as exc:  # noqa: BLE001 - a defect: told, and the others go on
                failure = self._station.policy.report(exc, f"HTTP {request.url.path[:100]}")
                return refusal_of(500, "RemoteDefect", failure.text)

        return guarded

    async def _known(self, request: Request) -> _User:
        kind, _, token = request.headers.get("authorization", "").partition(" ")
        user = self._user_of(token.strip()) if kind.lower() == "bearer" else None
        if user is None:
            await self._slow_down(request)
            raise HttpError(401, "send the header Authorization: Bearer TOKEN")
        if not self._lines.know(request.client, user):
            raise HttpError(429, f"a client has at most {MOST_LINES} connections")
        now_s = WALL.now_s()
        user.heard_s = now_s
        user.session.beat()
        admitted = user.requests.take(now_s, MOST_REQUESTS_S) or (
            self._is_stop(request) and user.stops.take(now_s, MOST_STOPS_S)
        )
        if not admitted:
            raise HttpError(429, f"more than {MOST_REQUESTS_S:g} requests a second")
        return user

    async def _slow_down(self, stranger: HTTPConnection) -> None:
        """Have who shows wrong tokens again and again wait for the answer."""
        where = stranger.client.host if stranger.client else "?"
        if self._refusals.note(where) > SLOWED_AFTER:
            await asyncio.sleep(1.0)

    def _is_stop(self, request: Request) -> bool:
        """Return whether a request is a command that waits for nothing."""
        named = request.path_params
        with suppress(HttpError):
            function, _ = self._address(named.get("application", ""), named.get("path", ""))
            return request.method == "POST" and (named["application"], function) in self._stops
        return False

    def _user_of(self, token: str) -> _User | None:
        found = self._users.get(sha256(token.encode("utf-8", "replace")).digest())
        if found is None or not secrets.compare_digest(
            found.settings.token.encode(), token.encode("utf-8", "replace")
        ):
            return None
        return found

    # What anybody may see

    async def _page(self, _request: Request) -> Response:
        text = files("cosmic.app.gateways").joinpath("page.html").read_text(encoding="utf-8")
        return HTMLResponse(text, headers={"Content-Security-Policy": _POLICY})

    async def _description(self, _request: Request) -> Response:
        return JSONResponse(self._openapi)

    # Station, control, operations

    async def _about(self, _request: Request, user: _User) -> Response:
        return JSONResponse(
            {
                "station": self._station.name,
                **{name: to_json(value) for name, value in self._facts.items()},
                "you": user.settings.name,
                "access": user.settings.access,
                "in_control": user.session.in_control,
                "control": to_json(self._station.lease.state),
            }
        )

    async def _control(self, request: Request, user: _User) -> Response:
        longest_s = self._settings.keep_control_s
        keep_s = seconds_of(request, "keep", MOVE_LIMIT_S, longest_s)
        keep = max(keep_s, MOVE_LIMIT_S) if request.method == "POST" else None
        return JSONResponse(to_json(await self._controlled(user, keep)))

    async def _controlled(self, user: _User, keep_s: float | None) -> object:
        """Take the right to move for so much silence, or give it back for None."""
        if keep_s is None:
            await self._job("stops", user.session.release_control, "control")
        else:
            take = partial(user.session.take_control, keep_s=keep_s)
            await self._job("stops", take, "control")
        state: LeaseState = self._station.lease.state
        return {"in_control": user.session.in_control, "control": state}

    async def _operation(self, request: Request, user: _User) -> Response:
        number = request.path_params["number"]
        found = user.going_on(number)
        if request.method == "DELETE":
            found.cancel()
        return await self._going_on(request, user, number, found)

    async def _going_on(
        self, request: Request, user: _User, number: str, operation: Operation[Any]
    ) -> Response:
        await self._watched(
            request, user, operation, seconds_of(request, "wait", 0.0, LONGEST_WAIT_S)
        )
        if not operation.done:
            progress = operation.progress
            shown = {
                "operation": number,
                "title": progress.title,
                "done": False,
                "fraction": progress.fraction,
                "text": progress.text,
            }
            return JSONResponse(shown, 202)
        failure = operation.failure
        if failure is not None:
            return answer_of(failure)
        result = to_json(operation.result)
        return JSONResponse({"operation": number, "done": True, "result": result})

    async def _watched(
        self, request: Request, user: _User, operation: Operation[Any], wait_s: float
    ) -> None:
        """Wait for an operation; who waits is alive, and one that hangs up stops it."""
        until_s = WALL.now_s() + wait_s
        while not operation.done and WALL.now_s() < until_s:
            left_s = min(BEAT_S, until_s - WALL.now_s())
            await ended(operation, max(left_s, 0.001))
            if await request.is_disconnected():
                _give_up(operation)
                raise HttpError(400, "hung up")
            user.session.beat()

    # Commands and state

    async def _command(self, request: Request, user: _User) -> Response:
        application = request.path_params["application"]
        function, keys = self._address(application, request.path_params["path"])
        try:
            # Refused before anything is carried out; but a stop is, whatever it is said with.
            seconds_of(request, "wait", 0.0, LONGEST_WAIT_S)
            arguments = await body_of(request)
        except HttpError:
            if not self._is_stop(request):
                raise
            arguments = {}
        order = user.session.order(application, function, arguments, keys)
        queue = "stops" if order.found.mark.at_once else application
        result = await self._carried_out(request, user, order, queue)
        if isinstance(result, Operation):
            return await self._going_on(request, user, user.keep(result), result)
        return JSONResponse({"result": to_json(result)})

    async def _mcp(self, request: Request, user: _User) -> Response:
        async def call(
            application: str, function: str, arguments: dict[str, Any], keys: tuple[str, ...]
        ) -> object:
            order = user.session.order(application, function, arguments, keys, door="mcp")
            queue = "stops" if order.found.mark.at_once else application
            result = await self._carried_out(request, user, order, queue)
            if isinstance(result, Operation):
                return await follow(user.keep(result), MCP_WAIT_S, False)
            return result

        async def follow(number: str, wait_s: float, cancel: bool) -> object:
            found = user.going_on(number)
            if cancel:
                found.cancel()
            await self._watched(request, user, found, min(wait_s, LONGEST_WAIT_S))
            if not found.done:
                said = {"operation": number, "goes_on": found.title}
                return said | {"text": found.progress.text}
            return found.result

        async def look(application: str, path: str) -> object:
            return await self._looked_up(application, [one for one in path.split("/") if one])

        async def control(keep_s: float | None) -> object:
            longest_s = self._settings.keep_control_s
            return await self._controlled(user, keep_s and min(max(keep_s, 1.0), longest_s))

        uses = McpUses(call, look, control, follow)
        message = await body_of(request)
        answer = await self._tools.answer(message, uses)
        if answer is None:
            return Response(status_code=202)
        begins = message.get("method") == "initialize"  # clients open a line only for a session
        named = {"Mcp-Session-Id": secrets.token_hex(16)} if begins else {}
        return JSONResponse(answer, headers=named)

    async def _mcp_line(self, _request: Request, user: _User) -> Response:
        """Hold a line open, by which the program is known to be there."""

        async def alive() -> AsyncIterator[bytes]:
            user.lines += 1
            try:
                while True:
                    yield b": alive\n\n"
                    user.session.beat()
                    await asyncio.sleep(BEAT_S)
            finally:
                self._hung_up(user)

        return StreamingResponse(alive(), media_type="text/event-stream")

    async def _mcp_end(self, _request: Request, user: _User) -> Response:
        why = f"{user.settings.name} ended its session"
        await self._job("stops", lambda: user.session.lose_motion(why), "the end of a session")
        return Response(status_code=200)

    async def _carried_out(self, request: Request, user: _User, order: Order, queue: str) -> object:
        if queue != "stops" and self._queues[queue].waiting >= MOST_WAITING:
            raise Busy(f"too many commands wait for {queue}")
        job: Operation[object] = Operation(order.title)
        wanted = partial(_check_wanted, job)
        self._queues[queue].put(lambda: user.session.carry_out(order, wanted), job)
        wait_s = max(self._waiting_s.get((order.application, order.found.name), 0.0), 2.0)
        await self._watched(request, user, job, wait_s)
        if job.done:
            return job.result
        _give_up(job)
        if job.done:
            raise Busy(f"{order.title} had not begun after {wait_s:g} s and was not carried out")
        raise Busy(f"{order.title} takes longer than {wait_s:g} s; what it begins is ended")

    def _address(self, application: str, path: str) -> tuple[str, tuple[str, ...]]:
        """Return the function and the keys that a path names."""
        host = self._host(application)
        parts, keys, left = [], [], [each for each in path.split("/") if each]
        kind = type(host.served)
        while len(left) > 1:
            inner, keyed = _part(kind, left[0])
            parts.append(left.pop(0))
            if keyed:
                keys.append(left.pop(0))
            kind = inner
        if not left:
            raise HttpError(404, "name a command at the end of the path")
        return ".".join((*parts, left[0])), tuple(keys)

    def _host(self, application: str) -> Host:
        found = self._hosts.get(application)
        if found is None:
            there = ", ".join(self._hosts)
            raise HttpError(404, f"there is no {application[:40]!r} here; there are {there}")
        return found

    async def _state(self, request: Request, user: _User) -> Response:
        del user
        steps = [each for each in request.path_params["path"].split("/") if each]
        if not steps or steps[0] != "state":
            raise HttpError(404, "state stands under state; commands are sent with POST")
        found = await self._looked_up(request.path_params["application"], steps[1:])
        return JSONResponse(to_json(found))

    async def _looked_up(self, application: str, steps: list[str]) -> object:
        """Return one value of the state of an application, or all of it."""
        host = self._host(application)
        values: Any = (await self._job("", host.state, "state")).values
        for step in steps:
            values = values if isinstance(values, dict) else to_json(values)
            if not isinstance(values, dict) or step not in values:
                raise HttpError(404, f"there is no {step[:40]!r} in the state")
            values = values[step]
        return values

    async def _job(self, queue: str, action: Callable[[], T], title: str) -> T:
        if self._queues[queue].waiting >= 4 * MOST_WAITING:
            raise Busy("too many requests wait")
        job = self._queues[queue].submit(action, title)
        until_s = WALL.now_s() + 10.0
        while not job.done and WALL.now_s() < until_s:
            await ended(job, 1.0)
        return job.result

    # Images and files

    async def _image(self, request: Request, user: _User) -> Response:
        camera, _, ending = request.path_params["camera"].rpartition(".")
        if ending not in ("png", "tif", "jpg"):
            raise HttpError(404, "the name of an image ends in .png, .tif or .jpg")

        def made() -> bytes:
            image = newest_image(user.session, camera)
            served: Any = self._host("vico").served
            return encoded_image(image, ending, served.camera_handles[camera].axes)

        coded = await self._job("", made, "an image")
        kinds = {"png": "image/png", "tif": "image/tiff", "jpg": "image/jpeg"}
        return Response(coded, media_type=kinds[ending], headers={"Cache-Control": "no-store"})

    async def _files(self, _request: Request, user: _User) -> Response:
        del user
        daqco = self._daqco()
        found = await self._job("", lambda: daqco.recordings(daqco.directory), "files")
        return JSONResponse([{"name": each.name} for each in found])

    async def _file(self, request: Request, user: _User) -> Response:
        del user
        daqco, name = self._daqco(), request.path_params["name"]
        found = await self._job("", lambda: daqco.recordings(daqco.directory), "files")
        for each in found:
            if each.name == name:
                return FileResponse(each, filename=name)
        raise HttpError(404, f"there is no recording {name[:60]!r}")

    def _daqco(self) -> Daqco:
        found = self._host("daqco").served
        if not isinstance(found, Daqco):
            raise HttpError(404, "no recordings here")
        return found

    # Events

    async def _events(self, socket_: WebSocket) -> None:
        await socket_.accept()
        if self._handover is None:
            self._handover = Handover()
        line = WebSocketLine(socket_, self._handover)
        user: _User | None = None
        ends: list[Unfollow] = []
        try:
            first = await asyncio.wait_for(word_of(socket_), FIRST_WORD_S)
            found = self._user_of(str(first.get("token", "")))
            if found is None:
                await self._slow_down(socket_)
                await socket_.close(4401, 'the first message is {"token": ...}')
                return
            if not self._lines.know(socket_.client, found):
                raise HttpError(429, f"a client has at most {MOST_LINES} connections")
            beat = found.session.beat
            if first.get("looks_only") is True:  # it is there for no program that moves
                beat = _nothing
            else:
                found.lines += 1
                user = found
            await line.send(json.dumps({"topic": "hello", "payload": found.settings.name}))
            sending = asyncio.create_task(line.run(beat))
            try:
                await self._follow_words(socket_, first, line, ends)
            finally:
                line.end()
                sending.cancel()
                with suppress(asyncio.CancelledError):
                    await sending
        except (WebSocketDisconnect, TimeoutError, RuntimeError):
            pass  # gone, or never said who it is
        except HttpError as exc:
            with suppress(RuntimeError, WebSocketDisconnect):
                await socket_.close(4400, str(exc)[:100])
        finally:
            self._hung_up(user)  # before all else: what moves ends with the line
            self._queues["unfollow"].submit(partial(_end_all, ends), "unfollow")

    def _hung_up(self, user: _User | None) -> None:
        if user is None:
            return
        user.lines -= 1
        if user.lines == 0:
            user.session.hang_up()

    async def _follow_words(
        self,
        socket_: WebSocket,
        first: Mapping[str, Any],
        line: WebSocketLine,
        ends: list[Unfollow],
    ) -> None:
        word = first
        while True:
            await self._follow(word, line, ends)
            word = await word_of(socket_)

    async def _follow(
        self, word: Mapping[str, Any], line: WebSocketLine, ends: list[Unfollow]
    ) -> None:
        wanted = word.get("follow", [])
        if not isinstance(wanted, list) or len(wanted) > 32 or len(ends) > 64:
            raise HttpError(400, "follow: a list of up to 32 topics")
        for topic in wanted:
            encode = None
            if isinstance(topic, str) and topic.endswith("/shown"):
                encode = shown_jpeg
            try:
                ends.append(self._hub.follow(str(topic), line.put, encode))
            except KeyError:
                raise HttpError(400, f"there is no topic {str(topic)[:60]!r}") from None


_POLICY: Final = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "connect-src 'self' ws: wss:; frame-ancestors 'none'"
)


def _check_wanted(job: Operation[object]) -> None:
    if job.cancel_requested:
        raise OperationCancelled(f"{job.title}: nobody waits for it any more")


def _give_up(job: Operation[Any]) -> None:
    """Have it not begin, or end it and what it begins."""

    def end(ended: Operation[Any]) -> None:
        if ended.failure is None and isinstance(ended.result, Operation):
            ended.result.cancel()

    job.cancel()
    job.add_callback(end)


def _nothing() -> None:
    """Take no note."""


def _end_all(ends: list[Unfollow]) -> None:
    for each in ends:
        each()


def _part(kind: type[Declared], name: str) -> tuple[type[Declared], bool]:
    found = declaration_of(kind).parts.get(name)
    if found is None:
        there = ", ".join(declaration_of(kind).parts) or "none"
        raise HttpError(404, f"there is no part {name[:40]!r}; there are {there}")
    return found.kind, found.keyed
