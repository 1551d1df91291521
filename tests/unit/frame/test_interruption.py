"""A signal that ends the program is heard where it can be heard, and told by its exit code."""

import signal
import sys
import threading

import pytest

from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.interruption import Interrupted, held_back, interruptible

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")


@pytest.mark.parametrize(("one", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_interrupts_and_leaves_handlers_as_they_were(
    one: signal.Signals, code: int
) -> None:
    before = signal.getsignal(one)
    with pytest.raises(Interrupted, match=f"interrupted by {one.name}") as found, interruptible():
        signal.raise_signal(one)
    assert found.value.exit_code == code
    assert signal.getsignal(one) is before
    assert not isinstance(found.value, Exception), "nothing takes it for a failure of its own"


def test_what_is_held_back_is_done_whole() -> None:
    done: list[str] = []
    with pytest.raises(Interrupted, match="SIGTERM"), interruptible(), held_back(done.append):
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGINT)
        done.append("whole")
    assert done == ["SIGTERM", "SIGINT", "whole"]


def test_what_fails_after_a_signal_ended_by_it_and_what_fails_before_did_not() -> None:
    with pytest.raises(Interrupted), interruptible(), held_back():
        signal.raise_signal(signal.SIGTERM)
        raise CosmicError("was aborted")
    with pytest.raises(NotAvailable), interruptible(), held_back():
        raise NotAvailable("is not there")


def test_in_another_thread_there_is_nothing_to_hear() -> None:
    found: list[str] = []

    def run() -> None:
        with interruptible():
            found.append("done")

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert found == ["done"]
