"""The thread in which HTTP is served, and where it listens."""

import asyncio
import socket
from collections.abc import Callable
from typing import Final, cast

import uvicorn
from starlette.applications import Starlette
from typing_extensions import override
from uvicorn.protocols.http.h11_impl import H11Protocol

from cosmic.app.configuration.gateways import HttpSettings
from cosmic.app.gateways.http_lines import HttpLines
from cosmic.app.gateways.line_watch import keep_watch
from cosmic.frame.errors import NotAvailable
from cosmic.frame.network.station import Station
from cosmic.frame.threads import WorkerThread

BODY_LIMIT_BYTES: Final = 64 * 1024
MOST_PENDING: Final = 128
"""So many lines may wait to be accepted."""
BEAT_S: Final = 0.2
PING_S: Final = 0.4


class HttpServer(WorkerThread):
    """Serves an application in a loop of its own, and ends the right to move of the silent.

    Parameters
    ----------
    look : callable
        Called every `BEAT_S`; it returns at once.
    lines : HttpLines
        Takes note of each line.
    """

    def __init__(
        self,
        application: Starlette,
        bound: socket.socket,
        settings: HttpSettings,
        station: Station,
        look: Callable[[], object],
        lines: HttpLines,
    ) -> None:
        super().__init__(f"{station.name} over HTTP", station.policy)
        self._bound = bound
        self._lease = station.lease
        self._look = look
        self._lines = lines
        self._server = uvicorn.Server(
            uvicorn.Config(
                application,
                log_config=None,
                access_log=False,
                lifespan="off",
                http=_protocol(lines),
                ws="websockets-sansio",
                ws_max_size=BODY_LIMIT_BYTES,
                # Each line would compress each message anew, which is most of what lines cost.
                ws_per_message_deflate=False,
                ws_ping_interval=PING_S,
                ws_ping_timeout=PING_S,
                timeout_keep_alive=5,
                timeout_graceful_shutdown=1,
                h11_max_incomplete_event_size=16 * 1024,
                server_header=False,
                proxy_headers=False,  # a line is known by its own address, whatever it says
                ssl_certfile=settings.certificate or None,
                ssl_keyfile=settings.key or None,
            )
        )

    @override
    def run_body(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        watching = asyncio.create_task(self._watch())
        try:
            await self._server.serve(sockets=[self._bound])
        finally:
            watching.cancel()

    async def _watch(self) -> None:
        """Let the right to move lapse of whoever fell silent, and end what moves before."""
        while True:
            await asyncio.sleep(BEAT_S)
            self._lease.poll()
            self._look()
            self._lines.look()

    @override
    def request_end(self) -> None:
        super().request_end()
        self._server.should_exit = True


def _protocol(lines: HttpLines) -> type[asyncio.Protocol]:
    class Line(H11Protocol):
        @override
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            made = cast("asyncio.Transport", transport)
            super().connection_made(made)
            lines.come(self.client, made)

    return Line


def listening(settings: HttpSettings) -> socket.socket:
    """Return a socket that listens where the settings say.

    Raises
    ------
    NotAvailable
        Somebody else listens there, or it is no address of this computer.
    """
    host, port = settings.where
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        # By its protocol's number, or asyncio leaves Nagle's delay on: 40 ms an answer.
        made = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
        try:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            keep_watch(made)  # what it accepts inherits it
            made.bind((host, port))
            made.listen(MOST_PENDING)  # from now on who comes is answered, if a little later
        except OSError:
            made.close()
            raise
    except OSError as exc:
        raise NotAvailable(
            f"HTTP cannot listen at {settings.listen}: {exc.strerror or exc}; choose another "
            "address with --http"
        ) from exc
    return made
