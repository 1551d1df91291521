"""The declared commands as tools of the Model Context Protocol, answered over HTTP."""

import json
from collections.abc import Awaitable, Callable, Iterable, Mapping
from typing import Any, Final

from cosmic.app.gateways.catalogue import Command, commands_of
from cosmic.app.gateways.openapi import key_name, mcp_tools, tool_name
from cosmic.app.gateways.plain import to_json
from cosmic.frame.declaration import Declared
from cosmic.frame.errors import CosmicError
from cosmic.frame.network.errors import CallRefused
from cosmic.frame.version import __version__

STATE_TOOL: Final = "read_state"
PROTOCOL: Final = "2025-06-18"
_NO_METHOD: Final = -32601
_BAD_PARAMS: Final = -32602
_BAD_REQUEST: Final = -32600

Call = Callable[[str, str, dict[str, Any], tuple[str, ...]], Awaitable[object]]
"""`call(application, function, arguments, keys)` carries out a command and awaits its end."""

Look = Callable[[str, str], Awaitable[object]]
"""`look(application, path)` returns the state of an application, or one value of it."""


class McpTools:
    """Answers the messages of MCP; each command is a tool, and one reads the state."""

    def __init__(self, kinds: Mapping[str, type[Declared]]) -> None:
        self._kinds = tuple(kinds)
        self._tools = [_state_tool(kinds), *mcp_tools(kinds)]
        self._commands: dict[str, Command] = {
            tool_name(each): each
            for name, kind in kinds.items()
            for each in commands_of(name, kind)
        }

    async def answer(
        self, message: Mapping[str, Any], call: Call, look: Look
    ) -> dict[str, Any] | None:
        """Return the answer to a message; None to one that wants none."""
        number, method = message.get("id"), message.get("method")
        if message.get("jsonrpc") != "2.0" or not isinstance(method, str):
            return _error(number, _BAD_REQUEST, "no message of JSON-RPC 2.0")
        if number is None:
            return None
        parameters = message.get("params", {})
        if not isinstance(parameters, dict):
            return _error(number, _BAD_PARAMS, "params are an object")
        if method == "initialize":
            return _result(number, _WELCOME)
        if method == "ping":
            return _result(number, {})
        if method == "tools/list":
            return _result(number, {"tools": self._tools})
        if method == "tools/call":
            if parameters.get("name") == STATE_TOOL:
                return await self._looked(number, parameters.get("arguments"), look)
            return await self._called(number, parameters, call)
        return _error(number, _NO_METHOD, f"there is no method {method[:40]!r}")

    async def _looked(self, number: object, given: object, look: Look) -> dict[str, Any]:
        wanted = given if isinstance(given, dict) else {}
        application, path = wanted.get("application"), wanted.get("path", "")
        if application not in self._kinds or not isinstance(path, str):
            return _error(number, _BAD_PARAMS, f"application is one of {', '.join(self._kinds)}")
        try:
            found = await look(application, path)
        except LookupError as exc:
            return _error(number, _BAD_PARAMS, str(exc)[:1000])
        return _result(number, _said(json.dumps(to_json(found)), failed=False))

    async def _called(
        self, number: object, parameters: Mapping[str, Any], call: Call
    ) -> dict[str, Any]:
        found = self._commands.get(str(parameters.get("name", "")))
        given = parameters.get("arguments", {})
        if found is None or not isinstance(given, dict):
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
            return _result(number, _said(f"{type(exc).__name__}: {exc}"[:1000], failed=True))
        return _result(number, _said(json.dumps(to_json(result)), failed=False))


def _state_tool(kinds: Iterable[str]) -> dict[str, Any]:
    return {
        "name": STATE_TOOL,
        "title": "Read the state of an application",
        "description": "The state of an application, or one value of it by its path.",
        "inputSchema": {
            "type": "object",
            "properties": {
                "application": {"enum": list(kinds)},
                "path": {"type": "string", "description": 'Such as "axes/left.x".'},
            },
            "required": ["application"],
            "additionalProperties": False,
        },
        "annotations": {"readOnlyHint": True, "destructiveHint": False, "openWorldHint": False},
    }


_WELCOME: Final = {
    "protocolVersion": PROTOCOL,
    "capabilities": {"tools": {}},
    "serverInfo": {"name": "CoSMic", "version": __version__},
    "instructions": "Commands of a microrobotic platform. What moves needs the right to move "
    "(POST /api/control), and is refused with its reason by the gate.",
}


def _result(number: object, result: Mapping[str, Any]) -> dict[str, Any]:
    return {"jsonrpc": "2.0", "id": number, "result": dict(result)}


def _error(number: object, code: int, text: str) -> dict[str, Any]:
    return {"jsonrpc": "2.0", "id": number, "error": {"code": code, "message": text}}


def _said(text: str, *, failed: bool) -> dict[str, Any]:
    return {"content": [{"type": "text", "text": text}], "isError": failed}
