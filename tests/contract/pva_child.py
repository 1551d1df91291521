"""A client of PV Access in a process of its own: prints what it sees as lines of JSON.

Run as ``python pva_child.py PORT NAME``; it says how the first image is, writes to it, and follows
until there was another.
"""

import json
import sys
from queue import Queue

from p4p.client.thread import Context, RemoteError

PATIENCE_S = 30.0


def _main(port: str, name: str) -> None:
    where = {"EPICS_PVA_ADDR_LIST": "", "EPICS_PVA_NAME_SERVERS": f"127.0.0.1:{port}"}
    where["EPICS_PVA_AUTO_ADDR_LIST"] = "NO"
    came: Queue = Queue()
    with Context("pva", conf=where, useenv=False) as context:
        line = context.monitor(name, came.put)
        while (image := came.get(timeout=PATIENCE_S)).raw.uniqueId == 0:
            pass  # as it was made
        first = image.raw.uniqueId
        found = {
            "shape": image.shape,
            "kind": image.dtype.str,
            "total": int(image.astype(int).sum()),
            "colour": image.attrib["ColorMode"],
            "time_s": image.timestamp,
        }
        try:
            context.put(name, image, timeout=PATIENCE_S)
        except RemoteError as exc:
            found["refused"] = str(exc)
        sys.stdout.write(json.dumps(found) + "\n")
        sys.stdout.flush()
        while came.get(timeout=PATIENCE_S).raw.uniqueId == first:
            pass
        line.close()
    sys.stdout.write("another\n")


if __name__ == "__main__":
    _main(*sys.argv[1:])
