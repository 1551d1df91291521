"""A program that moves the axes of a station until it is killed or frozen."""

import sys
import threading

from contract.station_rig import connected
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.api.elsewhere import MicoElsewhere
from cosmic.mico.api.mico import mico_of


def say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def main(what: str, endpoint: str) -> None:
    with connected(endpoint, "vision") as client:
        client.take_lease()
        application = MicoElsewhere(client, FailurePolicy())
        application.initialize()
        axis = mico_of(application)["left.x"]
        ended = threading.Event()
        if what == "jog":
            jog = axis.jog(1, 10.0)
            jog.movement.add_callback(lambda _: ended.set())
            renew, movement = jog.renew, jog.movement
        else:
            axis.set_closed_loop_frequency(10)
            movement = axis.move_to(5_000.0, wait=False)
            movement.add_callback(lambda _: ended.set())
            renew = lambda: None  # noqa: E731
        say("moving")
        until_s = WALL.now_s() + 30.0
        while not ended.wait(0.04) and WALL.now_s() < until_s:
            renew()
        try:
            say(f"reached {movement.wait(0.0)}")
        except CosmicError as exc:
            say(f"ended: {exc}")
        sys.stdin.readline()
        application.shut_down()


if __name__ == "__main__":
    main(*sys.argv[1:])
