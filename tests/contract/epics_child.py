"""A client of EPICS in a process of its own: a line of JSON in, a line of JSON out.

Run as ``python epics_child.py PORT``; each line is ``[operation, name, value]``.
"""

import json
import os
import sys
from contextlib import suppress


def _main(port: str) -> None:
    os.environ |= {
        "EPICS_CA_SERVER_PORT": port,
        "EPICS_CA_ADDR_LIST": "127.0.0.1",
        "EPICS_CA_AUTO_ADDR_LIST": "NO",
    }
    from caproto import CaprotoTimeoutError
    from caproto.threading.client import Context

    context, known = Context(), {}
    for said in sys.stdin:
        operation, name, value = json.loads(said)
        if operation == "find":
            (found,) = context.get_pvs(name)
            with suppress(CaprotoTimeoutError):
                found.wait_for_connection(timeout=float(value))
            sys.stdout.write(json.dumps(found.connected) + "\n")
            sys.stdout.flush()
            continue
        if name not in known:
            (known[name],) = context.get_pvs(name)
            known[name].wait_for_connection(timeout=10)
        pv = known[name]
        if operation == "put":
            data = value.encode() if isinstance(value, str) else [value]
            answer = pv.write(data, wait=True, timeout=20).status.success
        elif operation == "begin":
            pv.write(value if isinstance(value, list) else [value], wait=False)
            answer = None
        else:
            found = pv.read(data_type="control" if operation == "control" else "time")
            data = found.data
            first = data[0] if len(data) == 1 else bytes(data).rstrip(b"\0")
            answer = first.decode() if isinstance(first, bytes) else float(first)
            if operation == "alarm":
                answer = int(found.metadata.severity)
            elif operation == "control":
                bounds = found.metadata
                answer = [bounds.lower_ctrl_limit, bounds.upper_ctrl_limit]
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    _main(sys.argv[1])
