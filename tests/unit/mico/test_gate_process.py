"""The gate's own process: what it answers, and what happens when it does not."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from cosmic.frame.clock import WALL
from cosmic.mico.core.collision import helper_link
from cosmic.mico.core.collision.checker import AxisSpan, Spans
from cosmic.mico.core.collision.helper_link import GateProcess, NoAnswerError
from cosmic.mico.core.collision.model import SceneModel
from unit.mico.gate_handlers import HANDLERS
from unit.mico.rigs import wait_until
from unit.mico.small_scenes import turntable, two_arms

LOADING_S = 20.0
TESTS = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX are sent")


@contextmanager
def running(model: SceneModel | None = None, **options: float) -> Iterator[GateProcess]:
    gate = GateProcess(model or two_arms(), handlers=HANDLERS, **options)
    gate.start()
    try:
        yield gate
    finally:
        gate.close()


@pytest.fixture(autouse=True)
def _handlers_can_be_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(TESTS), prepend=os.pathsep)


@pytest.fixture
def gate() -> Iterator[GateProcess]:
    with running() as made:
        yield made


def move(end: float, axis: str = "left.x") -> Spans:
    spans = {axis: AxisSpan(0.0, 0.0, 0.0) for axis in two_arms().axes}
    return {**spans, axis: AxisSpan(min(0.0, end), max(0.0, end), 0.0, moving=True)}


FREE, BLOCKED = move(1000.0), move(3000.0)


def answers(gate: GateProcess) -> bool:
    try:
        return gate.check(FREE).clear
    except NoAnswerError:
        return False


def comes_back(gate: GateProcess) -> bool:
    wait_until(lambda: answers(gate), LOADING_S)
    return not gate.check(BLOCKED).clear


def signalled(gate: GateProcess, number: int) -> int:
    pid = gate.pid
    assert pid is not None
    os.kill(pid, number)
    return pid


def gone(pid: int) -> bool:
    """True when there is no such process, or only its entry waiting to be collected."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


# --- answers ----------------------------------------------------------------------------------


def test_who_cannot_wait_gets_the_answer_at_once_or_none(gate: GateProcess) -> None:
    prompt = gate.check_promptly(FREE, within_s=5.0)
    assert prompt is not None
    assert prompt.clear
    signalled(gate, signal.SIGSTOP)
    began_s = WALL.now_s()
    assert gate.check_promptly(FREE) is None
    assert WALL.now_s() - began_s < 0.5
    signalled(gate, signal.SIGCONT)
    assert gate.check(FREE).clear
    assert gate.restarts == 0


def test_the_answer_to_who_did_not_wait_is_not_taken_for_that_to_another(gate: GateProcess) -> None:
    signalled(gate, signal.SIGSTOP)
    assert gate.check_promptly(FREE) is None
    assert gate.check_promptly(BLOCKED) is None
    signalled(gate, signal.SIGCONT)
    assert not gate.check(BLOCKED).clear
    assert gate.check(FREE).clear


def test_it_answers_as_the_pure_gate_does(gate: GateProcess) -> None:
    assert gate.check(FREE).clear
    refused = gate.check(BLOCKED)
    assert refused.approach is not None
    assert refused.approach.bodies == ("left_z", "right_z")
    assert gate.check(BLOCKED, frozenset({("left_z", "right_z")})).clear


def test_it_reports_the_nearest_pair(gate: GateProcess) -> None:
    nearest = gate.nearest({"left.x": 1500.0})
    assert nearest is not None
    assert nearest.distance_um == pytest.approx(500.0)
    aside = gate.nearest({"left.x": 1500.0}, frozenset({("left_z", "right_z")}))
    assert aside is not None
    assert aside.distance_um == pytest.approx(1000.0)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_number_that_is_none_gets_no_answer(gate: GateProcess, bad: float) -> None:
    with pytest.raises(NoAnswerError, match="not finite"):
        gate.nearest({"left.x": bad})
    answer = gate.check({**FREE, "left.x": AxisSpan(0.0, float("nan"), 0.0, moving=True)})
    assert not answer.clear
    assert "left.x" in answer.reason
    assert gate.restarts == 0


def test_it_reports_how_far_a_refused_movement_may_go(gate: GateProcess) -> None:
    assert gate.clear_travel(BLOCKED, "left.x") == pytest.approx(1995.0, abs=1.0)
    reached = gate.clear_travel(BLOCKED, "left.x") or 0.0
    assert gate.check(move(reached)).clear


def test_there_is_no_free_travel_for_a_body_inside_its_margin(gate: GateProcess) -> None:
    inside = {**FREE, "left.x": AxisSpan(1997.0, 3000.0, 1997.0, moving=True)}
    assert gate.clear_travel(inside, "left.x") is None


def test_there_is_no_free_travel_where_the_position_is_unknown(gate: GateProcess) -> None:
    assert gate.clear_travel({**FREE, "left.x": AxisSpan(0.0, 3000.0)}, "left.x") is None
    both_ways = AxisSpan(-3000.0, 3000.0, 0.0, moving=True)
    assert gate.clear_travel({**FREE, "left.x": both_ways}, "left.x") is None


def test_free_travel_without_end_is_looked_for_up_to_the_hard_stop(gate: GateProcess) -> None:
    endless = AxisSpan(0.0, float("inf"), 0.0, moving=True)
    found = gate.clear_travel({**FREE, "left.x": endless}, "left.x")
    assert found == pytest.approx(1995.0, abs=1.0)


def test_the_free_travel_of_a_turning_axis_is_in_degrees() -> None:
    with running(turntable()) as gate:
        spans = {axis: AxisSpan(0.0, 0.0, 0.0) for axis in turntable().axes}
        spans["left.z"] = AxisSpan(-300.0, -300.0, -300.0)
        spans["table.rotation"] = AxisSpan(0.0, 90.0, 90.0, moving=True)
        found = gate.clear_travel(spans, "table.rotation")
    assert found is not None
    assert 1.0 < found < 10.0


def test_other_kinds_of_question_are_answered_by_the_functions_named(gate: GateProcess) -> None:
    assert gate.ask("echo", {"a": 1}) == {"a": 1}
    with pytest.raises(NoAnswerError, match="nonsense"):
        gate.ask("nonsense", None)
    with pytest.raises(NoAnswerError, match="ValueError: no idea"):
        gate.ask("fail", None)
    assert gate.restarts == 0


def test_a_hundred_checks_at_once_are_all_answered_right_and_in_time(gate: GateProcess) -> None:
    began_s = WALL.now_s()
    with ThreadPoolExecutor(8) as pool:
        clear = list(pool.map(lambda n: gate.check(FREE if n % 2 else BLOCKED).clear, range(100)))
    assert clear == [bool(n % 2) for n in range(100)]
    assert WALL.now_s() - began_s < 5.0
    assert gate.restarts == 0


def test_the_process_loads_neither_qt_nor_what_reads_scenes(gate: GateProcess) -> None:
    loaded = gate.ask("loaded", None)
    assert isinstance(loaded, list)
    unwanted = {"PySide6", "pydantic", "trimesh", "yourdfpy", "lxml", "OpenGL", "pyqtgraph"}
    assert unwanted.isdisjoint(loaded)


def test_the_process_has_frozen_what_it_loaded_and_makes_little_since(gate: GateProcess) -> None:
    for _ in range(200):
        gate.check(FREE)
    answer = gate.ask("frozen", None)
    assert isinstance(answer, tuple)
    frozen, old = answer
    assert frozen > 10_000
    assert old < 1000  # a full collection looks through these only


def test_a_file_in_the_working_directory_is_not_taken_for_a_module(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "numpy.py").write_text("raise ImportError('the wrong one')")
    monkeypatch.chdir(tmp_path)
    with running() as gate:
        wait_until(lambda: answers(gate), LOADING_S)  # with the wrong one it never does


# --- faults -----------------------------------------------------------------------------------


def test_a_process_killed_in_the_middle_of_a_check_refuses_and_is_replaced() -> None:
    with running(answer_s=20.0) as gate, ThreadPoolExecutor(1) as pool:
        pid = signalled(gate, signal.SIGSTOP)
        waiting = pool.submit(gate.check, FREE)
        wait_until(lambda: gate.busy)
        os.kill(pid, signal.SIGKILL)
        with pytest.raises(NoAnswerError, match="being restarted"):
            waiting.result(5.0)
        assert comes_back(gate)
        assert gate.restarts == 1
        assert gate.pid != pid
        assert gone(pid)


def test_a_process_that_died_between_two_checks_refuses_and_is_replaced(gate: GateProcess) -> None:
    signalled(gate, signal.SIGKILL)
    with pytest.raises(NoAnswerError):
        gate.check(FREE)
    assert comes_back(gate)


def test_while_a_new_process_comes_up_checks_are_refused_without_waiting(
    gate: GateProcess,
) -> None:
    signalled(gate, signal.SIGKILL)
    with pytest.raises(NoAnswerError):
        gate.check(FREE)
    signalled(gate, signal.SIGSTOP)
    began_s = WALL.now_s()
    with pytest.raises(NoAnswerError, match="restarted"):
        gate.check(FREE)
    assert WALL.now_s() - began_s < 0.5
    signalled(gate, signal.SIGCONT)
    assert comes_back(gate)


def test_a_hanging_process_refuses_in_time_and_is_replaced() -> None:
    with running(answer_s=0.3) as gate:
        pid = signalled(gate, signal.SIGSTOP)
        began_s = WALL.now_s()
        with pytest.raises(NoAnswerError, match=r"within 0\.3 s"):
            gate.check(FREE)
        assert 0.25 < WALL.now_s() - began_s < 2.0
        assert comes_back(gate)
        assert gone(pid)


def test_a_process_that_does_not_come_up_again_is_replaced_once_more() -> None:
    with running(start_s=10.0) as gate:
        gate._start_s = 0.05
        signalled(gate, signal.SIGKILL)
        with pytest.raises(NoAnswerError):
            gate.check(FREE)
        stuck = signalled(gate, signal.SIGSTOP)
        wait_until(lambda: not answers(gate) and gate.pid != stuck, LOADING_S)
        gate._start_s = 10.0
        assert comes_back(gate)


@pytest.mark.parametrize("kind", ["hang", "crash", "rubbish", "half", "endless"])
def test_any_bad_end_of_a_question_is_no_answer_and_a_new_process(
    gate: GateProcess, kind: str
) -> None:
    began_s = WALL.now_s()
    with pytest.raises(NoAnswerError):
        gate.ask(kind, None, 0.5)
    assert WALL.now_s() - began_s < 4.0
    assert comes_back(gate)
    assert gate.restarts == 1


def test_a_crash_is_named_and_its_traceback_logged(
    gate: GateProcess, caplog: pytest.LogCaptureFixture
) -> None:
    with pytest.raises(NoAnswerError, match="signal 11"):
        gate.ask("crash", None)
    assert "gate_handlers.py" in caplog.text


def test_a_late_answer_is_never_taken_for_that_to_another_question(gate: GateProcess) -> None:
    assert gate.ask("say", [(1, True, "too early")]) == "too early"
    assert gate.ask("echo", "mine") == "mine"


def test_an_answer_to_a_question_never_asked_is_a_fault(gate: GateProcess) -> None:
    with pytest.raises(NoAnswerError, match="question 99"):
        gate.ask("say", [(99, True, None)])
    assert comes_back(gate)


@pytest.mark.parametrize("bad", [(1, 2), ("1", True, None), (1, "yes", None)])
def test_an_answer_out_of_shape_is_a_fault(gate: GateProcess, bad: tuple[object, ...]) -> None:
    with pytest.raises(NoAnswerError):
        gate.ask("say", [bad])
    assert comes_back(gate)


def test_an_answer_of_the_wrong_kind_to_a_check_is_a_fault(gate: GateProcess) -> None:
    gate.ask("say", [(1, True, None), (2, True, "clear")])  # the second waits for the check
    with pytest.raises(NoAnswerError, match="its answer is a str"):
        gate.check(FREE)
    assert comes_back(gate)


def test_after_five_failures_in_a_row_it_stays_down_until_it_is_started_again(
    gate: GateProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail_once(_: int) -> None:
        wait_until(lambda: answers(gate) or _is_down(gate), LOADING_S)
        signalled(gate, signal.SIGKILL)
        with pytest.raises(NoAnswerError):
            gate.check(FREE)

    monkeypatch.setattr(helper_link, "FAILURES_WITHIN_S", 1000.0)
    for number in range(5):
        fail_once(number)
    with pytest.raises(NoAnswerError, match=r"stays down\. Press Rescan"):
        gate.check(FREE)
    assert gate.pid is None
    assert not gate.alive
    gate.start()
    assert gate.check(FREE).clear


def _is_down(gate: GateProcess) -> bool:
    return gate.pid is None


def test_a_scene_that_cannot_be_loaded_is_reported_at_the_start() -> None:
    model = two_arms()
    broken = replace(model.pieces[0], vertices_um=model.pieces[0].vertices_um[:0])
    gate = GateProcess(replace(model, pieces=(broken, *model.pieces[1:])))
    with pytest.raises(NoAnswerError, match="could not load the scene"):
        gate.start()
    assert gate.pid is None
    with pytest.raises(NoAnswerError):
        gate.check(FREE)


def test_a_process_that_cannot_be_started_is_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    gate = GateProcess(two_arms())
    with pytest.raises(NoAnswerError):
        gate.start()
    with pytest.raises(NoAnswerError):
        gate.check(FREE)
    gate.close()


# --- start and end ----------------------------------------------------------------------------


def test_a_question_before_the_start_is_refused() -> None:
    gate = GateProcess(two_arms())
    with pytest.raises(NoAnswerError, match="not started"):
        gate.check(FREE)


def test_closing_ends_the_process_and_may_be_repeated(gate: GateProcess) -> None:
    pid = gate.pid
    assert gate.alive
    gate.close()
    gate.close()
    assert pid is not None
    assert gone(pid)
    with pytest.raises(NoAnswerError, match="closed"):
        gate.check(FREE)


def test_closing_ends_a_check_that_waits() -> None:
    with running(answer_s=30.0) as gate, ThreadPoolExecutor(1) as pool:
        signalled(gate, signal.SIGSTOP)
        waiting = pool.submit(gate.check, FREE)
        wait_until(lambda: gate.busy)
        gate.close()
        with pytest.raises(NoAnswerError):
            waiting.result(5.0)
        assert gate.pid is None


def test_it_can_be_started_again_after_it_was_closed(gate: GateProcess) -> None:
    gate.close()
    gate.start()
    assert gate.check(FREE).clear


def test_an_interrupt_from_the_keyboard_does_not_end_it(gate: GateProcess) -> None:
    pid = signalled(gate, signal.SIGINT)
    assert gate.check(FREE).clear
    assert gate.pid == pid


PARENT = """
import sys
from cosmic.mico.core.collision import helper_link
from cosmic.mico.core.collision.helper_link import GateProcess
from unit.mico.small_scenes import two_arms
gate = GateProcess(two_arms())
gate.start()
print(gate.pid, flush=True)
sys.stdin.read()
"""


def _end_of(parent: Callable[["subprocess.Popen[str]"], object]) -> int:
    with subprocess.Popen(
        [sys.executable, "-c", PARENT], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        pid = int(process.stdout.readline())
        assert not gone(pid)
        parent(process)
    return pid


def test_it_does_not_outlive_a_parent_that_is_killed() -> None:
    pid = _end_of(lambda parent: parent.kill())
    wait_until(lambda: gone(pid), LOADING_S)


def test_it_does_not_outlive_a_script_that_forgets_to_close_it() -> None:
    pid = _end_of(lambda parent: parent.stdin and parent.stdin.close())
    wait_until(lambda: gone(pid), LOADING_S)


def test_a_script_without_a_main_guard_can_start_it(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(PARENT.replace("sys.stdin.read()", "gate.close()"))
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.split()) == 1


# --- a slow host ------------------------------------------------------------------------------


def test_a_process_that_is_starved_for_a_while_is_waited_for(gate: GateProcess) -> None:
    pid = signalled(gate, signal.SIGSTOP)
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(gate.check, FREE)
        wait_until(lambda: gate.busy)
        WALL.sleep(1.5)
        os.kill(pid, signal.SIGCONT)
        assert waiting.result(5.0).clear
    assert gate.restarts == 0
