"""A camera that sends its images over HTTP as JPEG after JPEG, on loopback."""

import threading
from collections.abc import Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import cv2
import numpy as np
from typing_extensions import override


class MjpegServer:
    """Serves `images` again and again at `rate_hz` until it is closed."""

    def __init__(
        self, images: Sequence[np.ndarray], *, rate_hz: float = 50.0, port: int = 0
    ) -> None:
        self._ended = threading.Event()
        coded = [cv2.imencode(".jpg", each)[1].tobytes() for each in images]
        server = self._make(coded, 1.0 / rate_hz, self._ended, port)
        self._server = server
        self.port = int(server.server_address[1])
        self.address = f"http://127.0.0.1:{self.port}/video.mjpg"
        self._thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Cut every line; nothing listens afterwards."""
        self._ended.set()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(5.0)

    @staticmethod
    def _make(
        coded: Sequence[bytes], period_s: float, ended: threading.Event, port: int
    ) -> ThreadingHTTPServer:
        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=cut")
                self.end_headers()
                number = 0
                while not ended.wait(period_s):
                    part = coded[number % len(coded)]
                    head = (
                        f"--cut\r\nContent-Type: image/jpeg\r\nContent-Length: {len(part)}\r\n\r\n"
                    )
                    try:
                        self.wfile.write(head.encode() + part + b"\r\n")
                    except OSError:
                        return
                    number += 1

            @override
            def log_message(self, format: str, *args: object) -> None:
                pass

        class Server(ThreadingHTTPServer):
            daemon_threads = True
            block_on_close = True
            allow_reuse_address = True

        return Server(("127.0.0.1", port), Handler)
