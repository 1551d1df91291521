"""The description of the HTTP interface, OpenAPI 3.1, and of the same commands for MCP."""

from collections.abc import Iterator, Mapping
from typing import Any, Final

from cosmic.app.gateways.catalogue import Command, commands_of
from cosmic.app.gateways.plain import Schemas, to_json
from cosmic.frame.declaration import Declared, result_of
from cosmic.frame.errors import CosmicError
from cosmic.frame.version import __version__

Kinds = Mapping[str, type[Declared]]

_ERRORS: Final = {
    "400": "An argument is unknown, missing or not of its kind.",
    "401": "The token is missing or unknown.",
    "409": "The gate, the stop or the right to move refused it; the verdict says why.",
    "422": "The command failed; the text says why.",
    "503": "Too many commands wait.",
}


def described(kinds: Kinds) -> dict[str, Any]:
    """Return the OpenAPI document of applications, by their names."""
    schemas = Schemas()
    paths: dict[str, Any] = {}
    for name, kind in kinds.items():
        paths[f"/api/{name}/state"] = {"get": _state(name)}
        for each in commands_of(name, kind):
            paths[path_of(each)] = {"post": _command(each, schemas)}
    paths |= _FIXED
    return {
        "openapi": "3.1.0",
        "info": {
            "title": "CoSMic",
            "version": __version__,
            "description": "Made from the declarations of the applications: each command is here.",
        },
        "paths": paths,
        "components": {
            "schemas": schemas.components,
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        },
        "security": [{"token": []}],
    }


def path_of(command: Command) -> str:
    """Return the path of a command; what stands in braces is the key of a part."""
    steps = [command.place.application]
    for part, keyed in zip(command.place.parts, command.place.keyed, strict=True):
        steps.append(part)
        if keyed:
            steps.append(f"{{{key_name(part)}}}")
    return f"/api/{'/'.join((*steps, command.declared.name))}"


def key_name(part: str) -> str:
    """Return what the key of a part is called, such as "axes_key"."""
    return f"{part}_key"


def _command(command: Command, schemas: Schemas) -> dict[str, Any]:
    need = command.declared.need
    words = [
        word
        for word, there in (
            ("Moves: needs the right to move.", need.moves),
            ("Reads: changes nothing.", need.reads),
            ("Overtakes every other command.", need.overtakes),
        )
        if there
    ]
    result = command.declared.result
    inner = result_of(result)
    wait = {
        "name": "wait",
        "in": "query",
        "schema": {"type": "number", "minimum": 0, "maximum": 60},
        "description": "How many seconds to wait for the end of what goes on.",
    }
    keys = [
        {"name": key_name(part), "in": "path", "required": True, "schema": {"type": "string"}}
        for part, keyed in zip(command.place.parts, command.place.keyed, strict=True)
        if keyed
    ]
    answers: dict[str, Any] = {
        "200": _answer("Done.", {"result": _described_result(result, inner, schemas)}),
        "202": _answer("It goes on.", _GOES_ON),
    }
    answers |= {code: _answer(text, _ERROR) for code, text in _ERRORS.items()}
    return {
        "operationId": f"{command.place.application}.{command.function}",
        "tags": [command.place.application],
        "summary": command.summary,
        "description": "\n\n".join((*words, command.text)),
        "parameters": [*keys, wait],
        "requestBody": {
            "content": {"application/json": {"schema": arguments_of(command, schemas)}},
            "required": bool(command.declared.required),
        },
        "responses": answers,
    }


def arguments_of(command: Command, schemas: Schemas) -> dict[str, Any]:
    """Return the schema of the arguments of a command."""
    properties = {}
    for name, kind in command.declared.parameters.items():
        found = dict(schemas.of(kind))
        if name in command.defaults:
            found["default"] = to_json(command.defaults[name])
        properties[name] = found
    return {
        "type": "object",
        "properties": properties,
        "required": sorted(command.declared.required),
        "additionalProperties": False,
    }


def _described_result(result: Any, inner: Any, schemas: Schemas) -> dict[str, Any]:
    return schemas.of(inner if inner is not None else result)


def _answer(text: str, properties: Mapping[str, Any]) -> dict[str, Any]:
    schema = {"type": "object", "properties": dict(properties)}
    return {"description": text, "content": {"application/json": {"schema": schema}}}


def _state(name: str) -> dict[str, Any]:
    return {
        "operationId": f"{name}.state",
        "tags": [name],
        "summary": f"The state of {name}; a path below it leads to one value.",
        "responses": {"200": _answer("As JSON.", {})},
    }


def mcp_tools(kinds: Kinds) -> list[dict[str, Any]]:
    """Return the same commands as tools of the Model Context Protocol."""
    return [_tool(each) for each in _each(kinds)]


def tool_name(command: Command) -> str:
    """Return what a command is called as a tool, such as "mico_axes_begin"."""
    return f"{command.place.application}.{command.function}".replace(".", "_")


def _each(kinds: Kinds) -> Iterator[Command]:
    for name, kind in kinds.items():
        yield from commands_of(name, kind)


def _tool(command: Command) -> dict[str, Any]:
    schemas = Schemas("#/$defs/")
    schema = arguments_of(command, schemas)
    for part, keyed in zip(command.place.parts, command.place.keyed, strict=True):
        if keyed:
            schema["properties"][key_name(part)] = {"type": "string"}
            schema["required"] = sorted((*schema["required"], key_name(part)))
    if schemas.components:
        schema["$defs"] = schemas.components
    need = command.declared.need
    return {
        "name": tool_name(command),
        "title": command.summary,
        "description": command.text,
        "inputSchema": schema,
        "annotations": {
            "readOnlyHint": need.reads,
            "destructiveHint": need.moves,
            "openWorldHint": False,
        },
    }


_ERROR: Final = {
    "error": {
        "type": "object",
        "properties": {
            "kind": {"enum": sorted(each.__name__ for each in CosmicError.__subclasses__())},
            "text": {"type": "string"},
            "verdict": {"type": "object"},
        },
    }
}
_GOES_ON: Final = {
    "operation": {"type": "string"},
    "title": {"type": "string"},
    "done": {"type": "boolean"},
    "fraction": {"type": "number"},
    "text": {"type": "string"},
}


def _simple(method: str, name: str, text: str, *path: str) -> dict[str, Any]:
    return {
        method: {
            "operationId": name,
            "summary": text,
            "parameters": [
                {"name": each, "in": "path", "required": True, "schema": {"type": "string"}}
                for each in path
            ],
            "responses": {"200": {"description": "Done."}},
        }
    }


_FIXED: Final[dict[str, Any]] = {
    "/api/station": _simple("get", "station", "What the station says of itself."),
    "/api/control": _simple("post", "take_control", "Take the right to move.")
    | _simple("delete", "release_control", "Give it back; what moves by it stops."),
    "/api/operations/{number}": _simple("get", "operation", "How far it is.", "number")
    | _simple("delete", "cancel", "End it early.", "number"),
    "/api/images/{camera}.{ending}": _simple(
        "get", "image", "The newest image: png, tif or jpg.", "camera", "ending"
    ),
    "/api/files": _simple("get", "files", "The newest recordings."),
    "/api/files/{name}": _simple("get", "file", "One recording.", "name"),
}
