"""The declared commands as tools of the Model Context Protocol, answered over HTTP."""

import json
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any, Final

from cosmic.app.gateways.catalogue import Command, commands_of
from cosmic.app.gateways.http_answers import HttpError
from cosmic.app.gateways.openapi import key_name, mcp_tools, tool_name
from cosmic.app.gateways.plain import to_json
from cosmic.frame.declaration import Declared
from cosmic.frame.errors import CosmicError
from cosmic.frame.network.errors import CallRefused
from cosmic.frame.version import __version__

USUAL_KEEP_S: Final = 30.0
"""So long a program may be silent and keep the right to move: it thinks between two calls."""
PROTOCOL: Final = "2025-06-18"
_NO_METHOD: Final = -32601
_BAD_PARAMS: Final = -32602
_BAD_REQUEST: Final = -32600

Call = Callable[[str, str, dict[str, Any], tuple[str, ...]], Awaitable[object]]
"""`call(application, function, arguments, keys)` carries out a command and awaits its end."""

Look = Callable[[str, str], Awaitable[object]]
"""`look(application, path)` returns the state of an application, or one value of it."""

Control = Callable[[float | None], Awaitable[object]]
"""`control(keep_s)` takes the right to move for so much silence, or gives it back for None."""

Follow = Callable[[str, float, bool], Awaitable[object]]
"""`follow(operation, wait_s, cancel)` awaits the end of what goes on, or says that it goes on."""


@dataclass(frozen=True, slots=True)
class McpUses:
    """What tools are carried out by; each may raise `CosmicError` or `HttpError`."""

    call: Call
    look: Look
    control: Control
    follow: Follow


class McpTools:
    """Answers the messages of MCP: each command is a tool; others read, take control and wait."""

    def __init__(self, kinds: Mapping[str, type[Declared]]) -> None:
        self._tools = [*_fixed_tools(kinds), *mcp_tools(kinds)]
        self._commands: dict[str, Command] = {
            tool_name(each): each
            for name, kind in kinds.items()
            for each in commands_of(name, kind)
        }

    async def answer(self, message: Mapping[str, Any], uses: McpUses) -> dict[str, Any] | None:
        """Return the answer to a message; None to one that wants none."""
        number, method = message.get("id"), message.get("method")
        if not (number is None or isinstance(number, str | int) or _is_finite(number)):
            return _error(None, _BAD_REQUEST, "an id is a text or a number")
        if message.get("jsonrpc") != "2.0" or not isinstance(method, str):
            return _error(number, _BAD_REQUEST, "no message of JSON-RPC 2.0")
        if number is None:
            return None
        parameters = message.get("params", {})
        if not isinstance(parameters, dict):
            return _error(number, _BAD_PARAMS, "params are an object")
        return await self._answered(number, method, parameters, uses)

    async def _answered(
        self, number: object, method: str, parameters: Mapping[str, Any], uses: McpUses
    ) -> dict[str, Any]:
        if method == "initialize":
            return _result(number, _WELCOME)
        if method == "ping":
            return _result(number, {})
        if method == "tools/list":
            return _result(number, {"tools": self._tools})
        if method != "tools/call":
            return _error(number, _NO_METHOD, f"there is no method {method[:40]!r}")
        name, given = str(parameters.get("name", "")), parameters.get("arguments", {})
        if not isinstance(given, dict):
            found = self._commands.get(name)
            if found is None or not found.declared.need.at_once:
                return _error(number, _BAD_PARAMS, "arguments are an object")
            given = {}  # a stop is carried out whatever it is said with
        if name in _FIXED:
            return await self._done(number, name, given, uses)
        return await self._called(number, name, given, uses.call)

    async def _done(
        self, number: object, name: str, given: Mapping[str, Any], uses: McpUses
    ) -> dict[str, Any]:
        """Carry out a tool that is no command of an application."""
        try:
            result = await _FIXED[name](given, uses)
        except HttpError as exc:
            return _error(number, _BAD_PARAMS, str(exc)[:1000])
        except CosmicError as exc:
            return _result(number, _failed(exc))
        return _result(number, _said(json.dumps(to_json(result)), failed=False))

    async def _called(
        self, number: object, name: str, given: Mapping[str, Any], call: Call
    ) -> dict[str, Any]:
        found = self._commands.get(name)
        if found is None:
            return _error(number, _BAD_PARAMS, "there is no such tool")
        arguments, keys = dict(given), []
        for part, keyed in zip(found.place.parts, found.place.keyed, strict=True):
            if keyed:
                keys.append(str(arguments.pop(key_name(part), "")))
        try:
            result = await call(found.place.application, found.function, arguments, tuple(keys))
        except CallRefused as exc:
            return _error(number, _BAD_PARAMS, str(exc)[:1000])
        except CosmicError as exc:
            return _result(number, _failed(exc))
        return _result(number, _said(json.dumps(to_json(result)), failed=False))


def _is_finite(value: object) -> bool:
    return isinstance(value, float) and isfinite(value)


def _seconds(given: Mapping[str, Any], name: str, default_s: float, *, least_s: float) -> float:
    found = given.get(name, default_s)
    plain = isinstance(found, (int, float)) and not isinstance(found, bool)
    if not plain or not least_s <= found < inf:
        raise HttpError(400, f"{name}: a number of seconds from {least_s:g} on")
    return float(min(found, 1e9))


async def _look(given: Mapping[str, Any], uses: McpUses) -> object:
    return await uses.look(str(given.get("application", "")), str(given.get("path", "")))


async def _take(given: Mapping[str, Any], uses: McpUses) -> object:
    return await uses.control(_seconds(given, "keep_s", USUAL_KEEP_S, least_s=1.0))


async def _release(_given: Mapping[str, Any], uses: McpUses) -> object:
    return await uses.control(None)


async def _follow(given: Mapping[str, Any], uses: McpUses) -> object:
    wait_s = _seconds(given, "wait_s", 20.0, least_s=0.0)
    return await uses.follow(str(given.get("operation", "")), wait_s, given.get("end") is True)


_FIXED: Final[Mapping[str, Callable[[Mapping[str, Any], McpUses], Awaitable[object]]]] = {
    "read_state": _look,
    "take_control": _take,
    "release_control": _release,
    "follow_operation": _follow,
}


def _fixed_tools(kinds: Iterable[str]) -> list[dict[str, Any]]:
    seconds = {"type": "number", "minimum": 0}
    return [
        _tool(
            "read_state",
            "Read the state of an application",
            "The state of an application, or one value of it by its path.",
            {
                "application": {"enum": list(kinds)},
                "path": {"type": "string", "description": 'Such as "axes/left.x".'},
            },
            ("application",),
            reads=True,
        ),
        _tool(
            "take_control",
            "Take the right to move",
            "One program at a time moves things. The right is kept for keep_s seconds after your "
            "last call, at most as long as the platform allows. What moves for you ends 1 s after "
            "your last call was answered, unless your client holds the event stream of this "
            "session open: wait for its end with follow_operation.",
            {"keep_s": {**seconds, "default": USUAL_KEEP_S}},
        ),
        _tool(
            "release_control",
            "Give the right to move back",
            "What moves for you stops. Do so when you have finished.",
            {},
        ),
        _tool(
            "follow_operation",
            "Wait for what goes on",
            "The result of an operation that another tool began, or how far it is after wait_s "
            "seconds. With end, it is ended.",
            {
                "operation": {"type": "string"},
                "wait_s": {**seconds, "default": 20, "maximum": 60},
                "end": {"type": "boolean", "default": False},
            },
            ("operation",),
        ),
    ]


def _tool(
    name: str,
    title: str,
    text: str,
    properties: Mapping[str, Any],
    required: tuple[str, ...] = (),
    *,
    reads: bool = False,
) -> dict[str, Any]:
    return {
        "name": name,
        "title": title,
        "description": text,
        "inputSchema": {
            "type": "object",
            "properties": dict(properties),
            "required": list(required),
            "additionalProperties": False,
        },
        "annotations": {"readOnlyHint": reads, "destructiveHint": False, "openWorldHint": False},
    }


_WELCOME: Final = {
    "protocolVersion": PROTOCOL,
    "capabilities": {"tools": {}},
    "serverInfo": {"name": "CoSMic", "version": __version__},
    "instructions": "Commands of a microrobotic platform. What moves needs the right to move "
    "(take_control), and is refused with its reason by the gate.",
}


def _result(number: object, result: Mapping[str, Any]) -> dict[str, Any]:
    return {"jsonrpc": "2.0", "id": number, "result": dict(result)}


def _error(number: object, code: int, text: str) -> dict[str, Any]:
    return {"jsonrpc": "2.0", "id": number, "error": {"code": code, "message": text}}


def _failed(error: CosmicError) -> dict[str, Any]:
    return _said(f"{type(error).__name__}: {error}"[:1000], failed=True)


def _said(text: str, *, failed: bool) -> dict[str, Any]:
    return {"content": [{"type": "text", "text": text}], "isError": failed}
