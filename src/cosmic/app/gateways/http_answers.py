"""What comes over HTTP, read, and the answers of `HttpGateway`."""

import asyncio
import json
from contextlib import suppress
from typing import Any, Final

from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.websockets import WebSocket

from cosmic.app.gateways.http_server import BODY_LIMIT_BYTES
from cosmic.app.gateways.plain import to_json
from cosmic.frame.errors import MoveRefused
from cosmic.frame.network.errors import Busy, CallRefused, RemoteDefect
from cosmic.frame.operation import Operation, Progress


class HttpError(Exception):
    """An answer that is an error.

    Parameters
    ----------
    status : int
        Of HTTP.
    """

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


async def ended(operation: Operation[Any], wait_s: float) -> None:
    """Wait until an operation has ended, at most so long; it goes on whoever is cancelled."""
    loop, over = asyncio.get_running_loop(), asyncio.Event()

    def look(progress: Progress) -> None:
        if progress.done:
            with suppress(RuntimeError):
                loop.call_soon_threadsafe(over.set)

    # It is taken back, as a callback cannot be: who waits for hours comes again and again.
    forget = operation.subscribe(look)
    try:
        with suppress(TimeoutError):
            await asyncio.wait_for(over.wait(), wait_s)
    finally:
        forget()


async def body_of(request: Request) -> dict[str, Any]:
    """Return the JSON object of a request; raises `HttpError`."""
    said = bytearray()
    async for piece in request.stream():
        said += piece
        if len(said) > BODY_LIMIT_BYTES:
            raise HttpError(413, f"a command has at most {BODY_LIMIT_BYTES} bytes")
    return _object(bytes(said) or b"{}")


async def word_of(socket_: WebSocket) -> dict[str, Any]:
    """Return the next JSON object of a WebSocket; raises `HttpError`."""
    try:
        said = await socket_.receive_text()
    except KeyError:
        raise HttpError(400, "messages are text, not bytes") from None
    return _object(said.encode("utf-8", "replace"))


def _object(said: bytes) -> dict[str, Any]:
    try:
        found = json.loads(said)
    except (ValueError, RecursionError) as exc:
        raise HttpError(400, f"what came is not JSON: {str(exc)[:100]}") from exc
    if not isinstance(found, dict):
        raise HttpError(400, "arguments are a JSON object, by their names")
    return found


def seconds_of(request: Request, name: str, default: float, longest_s: float) -> float:
    """Return a time that stands in the address; raises `HttpError`."""
    text = request.query_params.get(name)
    try:
        value = default if text is None else float(text)
    except ValueError:
        value = float("nan")
    if not 0.0 <= value <= longest_s:
        raise HttpError(400, f"{name}: a number of seconds up to {longest_s:g}")
    return value


_STATUS: Final = ((MoveRefused, 409), (Busy, 503), (CallRefused, 400), (RemoteDefect, 500))


def answer_of(error: Exception) -> Response:
    """Return how a failure is told, with the verdict of what was refused."""
    status = next((code for kind, code in _STATUS if isinstance(error, kind)), 422)
    verdict = to_json(error.verdict) if isinstance(error, MoveRefused) else None
    return refusal_of(status, type(error).__name__, str(error), verdict)


def refusal_of(status: int, kind: str, text: str, verdict: object = None) -> Response:
    """Return an answer that is an error."""
    error: dict[str, object] = {"kind": kind, "text": text[:2000]}
    if verdict is not None:
        error["verdict"] = verdict
    headers = {"WWW-Authenticate": "Bearer"} if status == 401 else None
    return JSONResponse({"error": error}, status, headers)
