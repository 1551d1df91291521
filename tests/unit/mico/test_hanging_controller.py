"""A library that does not return from a call for one device takes nothing else along."""

import logging
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import cosmic
from cosmic.frame.clock import WALL, RatedClock
from cosmic.frame.errors import DeviceTimeout, NotConnectedError
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.core.motion.manager import Mode
from cosmic.mico.hw.interface import Channel
from unit.mico.rigs import listen, mico, settings, wait_until
from unit.mico.scripted_controller import ScriptedController

TWO = ("LLN", "LLN")
EVERYTHING = ("receive", "ask_position", "ask_activity", "move_to", "stop")
PROMPT_S = 0.5


class Hang:
    """Lets calls for the first device hang from `begin` to `end`."""

    def __init__(self) -> None:
        self.hanging = False
        self._free = threading.Event()

    def into(self, controller: ScriptedController, *calls: str) -> None:
        for name in calls:
            setattr(controller, name, self._hung(getattr(controller, name)))

    def _hung(self, call: Callable[..., Any]) -> Callable[..., Any]:
        def hung(at: Channel | int, *args: Any, **kwargs: Any) -> Any:
            if self.hanging and (at.device if isinstance(at, Channel) else at) == 0:
                self._free.wait(60)
            return call(at, *args, **kwargs)

        return hung

    def end(self) -> None:
        self.hanging = False
        self._free.set()


@pytest.fixture
def hang() -> Iterator[Hang]:
    made = Hang()
    yield made
    made.end()


def prompt(call: Callable[[], object]) -> bool:
    before_s = WALL.now_s()
    call()
    return WALL.now_s() - before_s < PROMPT_S


@pytest.mark.parametrize("calls", [("ask_position",), ("receive",), EVERYTHING])
def test_a_hang_is_named_and_everything_else_goes_on(hang, caplog, calls):
    with mico(TWO, instant=False) as (rig, controller):
        hang.into(controller, *calls)
        manager = rig.application.manager
        shown = listen(manager.devices[0].state_changed)
        moving = rig["d0.c0"].move_to(100.0, wait=False)
        wait_until(lambda: rig["d0.c0"].details.in_motion)
        hang.hanging = True
        with pytest.raises(DeviceTimeout, match=r"device 0 \(d0\.c0.*not returned.*unplug it"):
            moving.wait(20)
        assert any(each.name == "d0.c1" and "not returned" in each.error for each in shown)
        assert "not returned from a call" in caplog.text
        with pytest.raises(cosmic.MoveRefused, match=r"not returned|last read"):
            rig["d0.c1"].move_to(1.0)
        with pytest.raises(NotConnectedError, match="not returned"):
            manager.rescan()

        controller.instant = True
        assert rig["d1.c1"].move_to(1.0) == 1.0
        assert prompt(rig["d0.c0"].halt)
        controller.calls.clear()
        assert prompt(lambda: manager.stop("test"))
        assert {each[1].channel for each in controller.of("stop") if each[1].device == 1} == {
            0,
            1,
            2,
        }
        manager.reset_stop()

        hang.end()
        wait_until(lambda: Channel(0, 0) in {each[1] for each in controller.of("stop")})
        wait_until(lambda: not manager.devices[0].stall)
        wait_until(lambda: not rig["d0.c0"].details.in_motion)
        wait_until(lambda: not rig["d0.c1"].details.error)
        assert rig["d0.c1"].move_to(2.0) == 2.0
        assert "returned, and goes on" in caplog.text


def test_an_order_that_waits_while_the_device_hangs_fails_and_never_begins(hang):
    with mico(TWO, instant=False) as (rig, controller):
        hang.into(controller, "ask_position")
        hang.hanging = True
        wait_until(lambda: rig.application.manager.devices[0].calls.suspect)
        queued = rig["d0.c1"].move_to(7.0, wait=False)
        with pytest.raises(DeviceTimeout, match="not returned"):
            queued.wait(20)
        hang.end()
        wait_until(lambda: not rig.application.manager.devices[0].stall)
        assert rig["d0.c0"].move_to(1.0, wait=False)
        wait_until(lambda: bool(controller.of("move_to")))
        assert [each[1:3] for each in controller.of("move_to")] == [(Channel(0, 0), 1.0)]


def test_a_stop_returns_where_the_whole_library_hangs_and_that_was_not_reported_yet(hang):
    with mico(TWO, instant=False) as (rig, controller):
        hang.into(controller, *EVERYTHING)
        manager = rig.application.manager
        hang.hanging = True
        wait_until(lambda: manager.devices[0].calls.suspect)
        assert not manager.devices[0].stall
        assert prompt(lambda: manager.stop("test"))
        assert len({each[1] for each in controller.of("stop") if each[1].device == 1}) == 3
        hang.end()
        wait_until(lambda: Channel(0, 0) in {each[1] for each in controller.of("stop")})


def test_a_stop_soon_after_the_library_began_to_hang_returns(hang):
    with mico(TWO, instant=False) as (rig, controller):
        hang.into(controller, *EVERYTHING)
        rig["d0.c0"].move_to(100.0, wait=False)
        wait_until(lambda: rig["d0.c0"].details.in_motion)
        hang.hanging = True
        WALL.sleep(0.9)
        stopping = threading.Thread(target=rig.application.manager.stop, args=("test",))
        stopping.start()
        stopping.join(PROMPT_S)
        returned = not stopping.is_alive()
        hang.end()
        stopping.join()
        assert returned


def test_a_stop_that_the_library_does_not_carry_out_is_reported(hang, caplog):
    with mico(TWO, instant=False) as (rig, controller):
        hang.into(controller, "stop")
        manager = rig.application.manager
        announced: list[str | None] = []
        manager.latch.subscribe(lambda state: announced.append(state.reason))
        moving = rig["d1.c0"].move_to(100.0, wait=False)
        wait_until(lambda: rig["d1.c0"].details.in_motion)
        hang.hanging = True
        stopping = threading.Thread(target=manager.stop, args=("test",))
        stopping.start()
        try:
            wait_until(lambda: "a stop is not carried out" in rig["d0.c0"].details.error)
            assert stopping.is_alive()
            assert announced == ["test"]
            assert "device 0 (d0.c0, d0.c1, d0.c2): a stop is not carried out" in caplog.text
            with pytest.raises(cosmic.StoppedError):
                moving.wait(5.0)
            assert not rig["d1.c0"].details.error
            assert prompt(lambda: manager.stop("again"))
        finally:
            hang.end()
            stopping.join()
        wait_until(lambda: not rig["d0.c0"].details.error)
        assert "has returned from the stop" in caplog.text


def test_a_library_that_hangs_even_in_closing_is_left_behind(hang, caplog):
    with mico(TWO) as (rig, controller):
        hang.into(controller, *EVERYTHING)
        closes = controller.close
        done = threading.Event()

        def close() -> None:
            done.wait(60)
            closes()

        controller.close = close
        hang.hanging = True
        wait_until(lambda: rig.application.manager.devices[0].stall)
        rig.application.shut_down()
        assert rig.application.manager.mode is Mode.CLOSED
        for who in ("device 0", "listener 0", "closing the controllers"):
            assert f"{who} hangs in the library and was left behind" in caplog.text
        hang.end()
        done.set()
        wait_until(lambda: ("close",) in controller.calls)


def test_closing_does_not_wait_for_ever_for_devices_that_are_being_opened(caplog):
    controller = ScriptedController()
    free, opens, in_it = threading.Event(), controller.open, threading.Event()

    def hang(serials=()):
        in_it.set()
        free.wait(60)
        return opens(serials)

    controller.open = hang
    application = MicoApplication(
        controller, settings(), clock=RatedClock(1.0), policy=FailurePolicy()
    )
    with caplog.at_level(logging.INFO):
        looking = application.initialize_later()
        assert in_it.wait(10)
        application.shut_down()
    assert "opening the devices does not return" in caplog.text
    free.set()
    assert application.join()
    assert ("close",) in controller.calls
    assert looking.done
    assert not any(device.isRunning() for device in application.manager.devices.values())
