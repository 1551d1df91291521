"""Numbers and times of frames from GigE Vision, without a camera."""

import pytest

from cosmic.vico.hw.bus_frames import FrameNumbers, FrameTimes


def missing(given: list[int]) -> int:
    return given[-1] + 1 - len(given)


def numbered(raw_numbers: list[int]) -> tuple[list[int], int]:
    numbers = FrameNumbers()
    given = [numbers.whole(raw) for raw in raw_numbers]
    return given, missing(given)


def test_a_gap_on_the_wire_is_a_loss() -> None:
    assert numbered([7, 8, 11]) == ([0, 1, 4], 2)


def test_the_sixteen_bit_counter_of_the_standard_leaves_zero_out() -> None:
    assert numbered([65534, 65535, 1, 2]) == ([0, 1, 2, 3], 0)


def test_a_camera_that_counts_through_zero_is_understood() -> None:
    assert numbered([65534, 65535, 0, 1]) == ([0, 1, 2, 3], 0)
    assert numbered([0, 1, 65535, 1]) == ([0, 1, 65535, 65537], 65534)


def test_a_loss_over_the_wrap_is_counted() -> None:
    assert numbered([65534, 3]) == ([0, 4], 3)


def test_a_counter_of_64_bit_does_not_wrap() -> None:
    assert numbered([65535, 65536, 65540]) == ([0, 1, 5], 3)


def test_a_number_that_goes_back_or_repeats_takes_the_next_place() -> None:
    assert numbered([100, 99, 100, 100]) == ([0, 1, 2, 3], 0)


def test_an_incomplete_frame_keeps_a_number_that_can_be_true() -> None:
    numbers = FrameNumbers()
    assert [numbers.whole(1), numbers.doubtful(3), numbers.whole(4)] == [0, 2, 3]


@pytest.mark.parametrize("stale", [0, 2, 6, 40000, 65530])
def test_a_strangers_number_in_an_incomplete_frame_moves_nothing(stale: int) -> None:
    numbers = FrameNumbers()
    given = [numbers.whole(5), numbers.whole(6), numbers.doubtful(stale), numbers.whole(8)]
    assert given == [0, 1, 2, 3]


def test_a_stream_may_begin_with_an_incomplete_frame() -> None:
    numbers = FrameNumbers()
    assert [numbers.doubtful(0), numbers.whole(2), numbers.whole(3)] == [0, 1, 2]


def test_a_frame_that_waited_to_be_read_was_complete_earlier() -> None:
    times = FrameTimes()
    assert times.complete_s(10.0, 0.010, 1.0) == 10.0
    assert times.complete_s(11.0, 0.110, 1.0) == pytest.approx(10.9)


def test_a_clock_that_runs_faster_counts_the_wait_in_its_own_time() -> None:
    times = FrameTimes()
    times.complete_s(10.0, 0.0, 20.0)
    assert times.complete_s(11.0, 0.01, 20.0) == pytest.approx(10.8)


def test_a_clock_that_was_set_is_no_long_wait() -> None:
    times = FrameTimes()
    assert times.complete_s(10.0, -3600.0, 1.0) == 10.0
    assert times.complete_s(10.1, 3600.0, 1.0) >= 5.0


def test_a_first_packet_seen_late_is_recognised_by_the_cameras_clock() -> None:
    times = FrameTimes()
    ms = 1_000_000
    assert times.delay_s(1000 * ms, 7 * ms) == 0.0
    assert times.delay_s(1033 * ms, 40 * ms) == 0.0
    assert times.delay_s(1096 * ms, 73 * ms) == pytest.approx(0.030, abs=1e-4)
    assert times.delay_s(1099 * ms, 106 * ms) == pytest.approx(0.0, abs=1e-4)


def test_a_camera_without_a_clock_is_never_late() -> None:
    times = FrameTimes()
    assert times.delay_s(5, 0) == times.delay_s(10**12, 0) == 0.0


def test_a_camera_whose_clock_is_set_back_is_not_late_for_ever() -> None:
    times = FrameTimes()
    second = 10**9
    times.delay_s(100 * second, 50 * second)
    times.delay_s(101 * second, 1 * second)
    assert times.delay_s(102 * second, 2 * second) == pytest.approx(0.0, abs=1e-3)
