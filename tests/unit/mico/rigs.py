"""Small platforms for tests of the core."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from PySide6.QtCore import Qt, SignalInstance

from cosmic.frame.clock import WALL, RatedClock
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.settings import MicoSettings
from unit.mico.scripted_controller import ScriptedController

KINDS = {"L": "linear", "R": "rotary", "N": "open-loop"}


def settings(layout: Sequence[str] = ("LLN",), **changes: object) -> MicoSettings:
    positioners = []
    for device, letters in enumerate(layout):
        for channel, letter in enumerate(letters):
            if letter not in KINDS:
                continue
            one = {
                "name": f"d{device}.c{channel}",
                "device": device,
                "channel": channel,
                "kind": KINDS[letter],
            }
            if letter == "L":
                one |= {"limits_um": (-5000.0, 5000.0), "start_um": 0.0}
            if letter == "R":
                one |= {"limits_deg": (-160.0, 160.0), "start_deg": 0.0}
            positioners.append(one)
    return MicoSettings.model_validate({"positioner": positioners, **changes})


@contextmanager
def mico(
    layout: Sequence[str] = ("LLN",),
    *,
    instant: bool = True,
    prepare: Callable[[ScriptedController], None] | None = None,
    configured: Sequence[str] | None = None,
    **changes: object,
) -> Iterator[tuple[Mico, ScriptedController]]:
    controller = ScriptedController(layout, instant=instant)
    if prepare:
        prepare(controller)
    application = MicoApplication(
        controller,
        settings(configured or layout, **changes),
        clock=RatedClock(1.0),
        policy=FailurePolicy(),
    )
    application.initialize()
    try:
        api = Mico(application)
        wait_until(lambda: all(a.details.position is not None or a.error for a in api))
        yield api, controller
    finally:
        controller.block.set()
        application.shut_down()


def wait_until(condition: Callable[[], bool], timeout_s: float = 20.0) -> None:
    end = WALL.now_s() + timeout_s
    while not condition():
        assert WALL.now_s() < end, "it did not happen"
        WALL.sleep(0.002)


def listen(signal: SignalInstance) -> list[object]:
    """Collect what a signal carries, in whatever thread it is emitted."""
    heard: list[object] = []
    signal.connect(lambda what: heard.append(what), Qt.ConnectionType.DirectConnection)
    return heard
