"""10,000 hostile messages over HTTP and Channel Access, beside one client of EPICS that moves.

A third of the attackers of HTTP know the token. Each message is a line of its own: broken heads,
bodies of wrong lengths and kinds, numbers that are none, unknown records and operations, noise. The
good client holds the right to move all the time; its moves are to end where it said, in the time
that they took before. Nobody takes the right from it, and no answer is a defect (500).
"""

import logging
import os
import random
import socket
import struct
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from itertools import cycle
from typing import Any

from benchmarks.figures import Figure, main, percentile
from benchmarks.gateways import Served, served

NAME = "gateways_hostile"
HOST = "127.0.0.1"
AXIS = "/api/mico/axes/left.x/begin"
PATHS = (
    *(AXIS, f"{AXIS}?wait=nan", "/mcp", "/api/control?keep=-1", "/api/../../etc/passwd"),
    *("/api/files/..%2f..%2fetc%2fpasswd", "/api/images/none.png", "/api/operations/99"),
    *("/api/mico/state/axes/%00", "/api/approvals/approve", "/%ff%fe"),
)
TOOL = b'{"jsonrpc":"2.0","id":1,"method":"tools/call","params":%s}'
BODIES = (
    *(b"{", b"[]", b"null", b"[" * 30_000, b"A" * 70_000, b'{"motion": null}'),
    *(
        b'{"motion": {"kind": "MoveTo", "target": %s, "unit": "um"}}' % each
        for each in (b"NaN", b"1e999", b"1e300", b'"5"')
    ),
    b'{"motion": {"kind": "Jog", "direction": 1, "speed": 1e9}}',
    TOOL % b'{"name":"take_control","arguments":{"keep_s":"NaN"}}',
    TOOL % b'{"name":"mico_axes_begin","arguments":[]}',
    TOOL % b'{"name":["x"],"arguments":{}}',
)
RECORDS = (
    *(b"BENCH:left_x.VAL", b"BENCH:left_x", b"BENCH:control", b"BENCH:nothing", b"\xff" * 30),
    *(b"BENCH:mico:axes:left_x:begin", b"BENCH:left_x.TWF"),
)
NUMBERS = (float("nan"), float("inf"), 1e300, 5.0)


def http_message(chance: random.Random, token: str) -> bytes:
    """Return what is sent over one line to HTTP."""
    kind = chance.randrange(12)
    if kind == 0:
        return chance.randbytes(300)
    if kind == 1:
        head = (
            "GET /api/events HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        )
        key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
        return (head + key).encode() + chance.randbytes(50)
    body = chance.choice(BODIES)
    length = chance.choice((len(body), len(body), len(body) + 1000, -1, 10**12))
    method = chance.choice(("POST", "POST", "GET", "DELETE", "PUT", "FOO"))
    head = (
        f"{method} {chance.choice(PATHS)} HTTP/1.1\r\nHost: x\r\n"
        f"Authorization: Bearer {chance.choice((token, 'x' * 30, ''))}\r\n"
        f"Content-Length: {length}\r\nConnection: close\r\n\r\n"
    )
    return head.encode() + body


def ca_message(chance: random.Random, _token: str) -> bytes:
    """Return what is sent over one line to Channel Access."""

    def head(*numbers: int) -> bytes:
        return struct.pack(">HHHHII", *numbers)

    noise = chance.randbytes(chance.randrange(300))
    name = chance.choice(RECORDS)
    name += bytes(8 - len(name) % 8)
    hello = head(0, 0, 0, 13, 0, 0)
    hello += b"".join(head(code, 8, 0, 0, 0, 0) + b"evil\0\0\0\0" for code in (20, 21))
    known = hello + head(18, len(name), 0, 0, 1, 13) + name
    kind = chance.choice((6, 20, 0, 35, 99))
    count = chance.choice((1, 0, 65_535))
    value = struct.pack(">d", chance.choice(NUMBERS))
    return chance.choice(
        (
            noise,
            hello + noise,
            known + head(19, 8, kind, 1, chance.randrange(3), 1) + value,
            known + head(4, chance.choice((8, 0, 65_535)), kind, count, 0, 7) + noise,
            known + head(1, 16, kind, count, 0, chance.randrange(9)) + bytes(16),
            known + head(15, 0, kind, count, chance.randrange(5), 3),
            hello + 50 * known,
            known + head(chance.randrange(65_536), 65_535, 0, 0xFFFF, 0xFFFFFFFF, 0xFFFFFFFF),
        )
    )


def shot(port: int, message: bytes, patience_s: float) -> str:
    """Send one message and return the status of the answer, where there is one."""
    with socket.socket() as line, suppress(OSError):
        line.settimeout(patience_s)
        line.connect((HOST, port))
        line.sendall(message)
        answer = line.recv(200)
        return answer[9:12].decode("latin-1") if answer.startswith(b"HTTP") else "bytes"
    return "nothing"


class GoodClient:
    """Moves an axis to and fro over EPICS, and holds the right to move."""

    def __init__(self, port: int) -> None:
        os.environ |= {
            "EPICS_CA_SERVER_PORT": str(port),
            "EPICS_CA_ADDR_LIST": HOST,
            "EPICS_CA_AUTO_ADDR_LIST": "NO",
        }
        from caproto.threading.client import Context  # it reads the environment when it is loaded

        self._context: Any = Context()
        names = ("BENCH:left_x", "BENCH:left_x.RBV", "BENCH:control")
        self._target, self._place, control = self._context.get_pvs(*names)
        for each in (self._target, self._place, control):
            each.wait_for_connection(timeout=60)
        control.write([1], wait=True, timeout=60)
        self._targets = cycle((10.0, 11.0))
        self.wrong = 0

    def move_ms(self) -> float:
        """Make one move and return how long it took."""
        target, begun_s = next(self._targets), time.perf_counter()
        done = self._target.write([target], wait=True, timeout=60).status.success
        taken_ms = 1e3 * (time.perf_counter() - begun_s)
        self.wrong += not done or abs(self._place.read(timeout=60).data[0] - target) > 1.0
        return taken_ms

    def moves_during(self, work: Callable[[], object]) -> list[float]:
        """Move until `work` has ended, once at least."""
        thread, taken = threading.Thread(target=work), [self.move_ms()]
        thread.start()
        while thread.is_alive():
            taken.append(self.move_ms())
        thread.join()
        return taken

    def close(self) -> None:
        """End the line, and the right to move with it."""
        self._context.disconnect()


def attack(station: Served, count: int) -> Counter[str]:
    """Send `count` messages from four threads; return how they were answered."""
    token = station.http.headers["Authorization"].partition(" ")[2]
    web = station.http.base_url.port or 0
    found: Counter[str] = Counter()

    def go(seed: int) -> None:
        chance = random.Random(seed)
        for _ in range(count // 4):
            if seed % 2:
                found[shot(web, http_message(chance, token), 0.3)] += 1
            else:
                found[shot(station.epics_port, ca_message(chance, token), 0.05)] += 1

    threads = [threading.Thread(target=go, args=(seed,)) for seed in range(4)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    return found


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    logging.getLogger("cosmic").setLevel(logging.ERROR)
    count, quiet_s = (80, 1.0) if quick else (10_000, 20.0)
    with served() as station:
        client = GoodClient(station.epics_port)
        before = client.moves_during(lambda: time.sleep(quiet_s))
        answers: Counter[str] = Counter()
        during = client.moves_during(lambda: answers.update(attack(station, count)))
        held = "EPICS" in station.http.get("/api/station").json()["control"]["holder"]
        client.close()
    defects = sum(number for status, number in answers.items() if status.startswith("5"))
    return [
        Figure(NAME, "messages", float(sum(answers.values())), ""),
        Figure(NAME, "answers that were defects", float(defects), "", 0.0),
        Figure(NAME, "moves of the good client", float(len(during)), ""),
        Figure(NAME, "moves that were refused or went wrong", float(client.wrong), "", 0.0),
        Figure(NAME, "right to move lost", float(not held), "", 0.0),
        Figure(NAME, "move, p50, before", percentile(before, 50), "ms"),
        Figure(NAME, "move, p50, beside", percentile(during, 50), "ms"),
        Figure(NAME, "move, p99, before", percentile(before, 99), "ms"),
        Figure(NAME, "move, p99, beside", percentile(during, 99), "ms"),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
