"""A program that moves the axes of a station until it is killed or frozen."""

import sys
import threading
from collections.abc import Callable

from contract.station_rig import connected
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.api.client import MicoClient
from cosmic.mico.api.mico import mico_of
from cosmic.mico.core.motion.movement import Movement


def say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def main(what: str, endpoint: str) -> None:
    with connected(endpoint, "vision") as client:
        client.take_lease()
        application = MicoClient(client, FailurePolicy())
        application.initialize()
        axis = mico_of(application)["left.x"]
        ended, movement = threading.Event(), Movement()
        renew: Callable[[], object] = bool
        if what == "jog":
            jog = axis.jog(1, 10.0)
            jog.movement.add_callback(lambda _: ended.set())
            renew, movement = jog.renew, jog.movement
        elif what == "trajectory":
            axis.set_closed_loop_frequency(10)
            trajectories = mico_of(application).trajectories
            text = "cosmic-trajectory 1\nplatform FiberStation\nleft.x to 5000 um\nleft.x to 0 um\n"
            trajectories.run(trajectories.parse(text), wait=False)
        else:
            axis.set_closed_loop_frequency(10)
            movement = axis.move_to(5_000.0, wait=False)
            movement.add_callback(lambda _: ended.set())
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
