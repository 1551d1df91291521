"""What is in a column of the image: every spike, whatever the chunks and the zoom."""

from dataclasses import replace

import numpy as np
import pytest

from cosmic.daqco.gui.plot.columns import LiveColumns
from cosmic.daqco.gui.plot.history import SEGMENT, History
from cosmic.daqco.gui.plot.raster import Look, Raster

RATE_HZ = 15_000.0


def pieces(rng, total):
    """Return sizes between 1 and 900 that add up to `total`."""
    sizes = rng.integers(1, 900, size=total)
    ends = np.cumsum(sizes)
    sizes = sizes[: int(np.searchsorted(ends, total))]
    return [*sizes.tolist(), total - int(sizes.sum())]


def raster(channels, width=500, height=200):
    look = Look(
        colours=("#E69F00",) * channels,
        shown=np.ones(channels, bool),
        low=np.full(channels, -10.0),
        high=np.full(channels, 10.0),
        ground="#000000",
    )
    return Raster(look, width, height)


def spiky(rng, channels, total, spikes):
    values = rng.normal(0.0, 0.2, (channels, total))
    at = np.sort(rng.choice(total, spikes, replace=False))
    rows = rng.integers(0, channels, spikes)
    values[rows, at] = 8.0
    return values, rows, at


@pytest.mark.parametrize("per_column", [1.0, 3.7, 300.0, 1800.0])
def test_every_spike_of_one_sample_is_in_its_live_column(qapp, per_column):
    rng = np.random.default_rng(1)
    total = min(round(500 * per_column), 400_000)
    values, rows, at = spiky(rng, 3, total, 100)
    live, image = LiveColumns(per_column), raster(3)
    done = 0
    for size in pieces(rng, total):
        image.put(*live.feed(done, values[:, done : done + size]))
        done += size
    for row, sample in zip(rows, at, strict=True):
        number = int(np.floor(sample / per_column + 1e-12))
        assert image.column(number)[1][row] == pytest.approx(8.0)
    for number in rng.integers(0, int(total / per_column) - 1, 50):
        begin, end = np.ceil(np.array([number, number + 1]) * per_column - 1e-9).astype(int)
        assert image.column(number)[1] == pytest.approx(values[:, begin:end].max(axis=1))
        assert image.column(number)[0] == pytest.approx(values[:, begin:end].min(axis=1))


def test_every_spike_is_a_pixel_of_the_image(qapp):
    rng = np.random.default_rng(2)
    values, _, at = spiky(rng, 1, 150_000, 60)
    live, image = LiveColumns(300.0), raster(1)
    for begin in range(0, 150_000, 150):
        image.put(*live.feed(begin, values[:, begin : begin + 150]))
    top = round(199 * (10.0 - 8.0) / 20.0)
    for sample in at:
        assert image.image.pixelColor(int(sample // 300), top).name() == "#e69f00"


@pytest.mark.parametrize("per_column", [1.5, 40.0, 600.0, 9000.0])
def test_no_spike_is_lost_when_the_image_is_made_from_the_history(per_column):
    rng = np.random.default_rng(3)
    total = 5 * SEGMENT + 777
    values, rows, at = spiky(rng, 2, total, 80)
    history = History(2, RATE_HZ)
    done = 0
    for size in pieces(rng, total):
        history.append(done, values[:, done : done + size])
        done += size
    found = history.view().columns(0, int(total / per_column) + 1, per_column)
    for row, sample in zip(rows, at, strict=True):
        number = int(sample / per_column)
        near = found.high[row, max(0, number - 1) : number + 1]  # a block may begin before
        assert near.max() == pytest.approx(8.0)


def test_a_view_of_the_history_does_not_move_on():
    history = History(1, 100.0)
    history.append(0, np.zeros((1, 50)))
    view = history.view()
    history.append(50, np.ones((1, 50)))
    assert view.end == 50
    assert view.samples(0, 100)[1].shape == (1, 50)
    assert np.nanmax(view.columns(0, 20, 5.0).high) == 0.0


def test_the_history_forgets_what_is_older_than_a_minute():
    history = History(4, 1000.0)
    for begin in range(0, 200_000, 1000):
        history.append(begin, np.zeros((4, 1000)))
    view = history.view()
    assert view.end - view.first == 60_000
    assert len(view.segments) <= 60_000 // SEGMENT + 2


def test_the_history_of_a_very_fast_board_stays_within_its_memory():
    history = History(32, 1e6)
    for begin in range(0, 4_000_000, 100_000):
        history.append(begin, np.zeros((32, 100_000)))
    held = sum(segment.raw.nbytes for segment in history.view().segments)
    assert held < 230 * 2**20


def test_lost_samples_leave_a_hole_in_the_image(qapp):
    live, image = LiveColumns(10.0), raster(1, width=50)
    image.put(*live.feed(0, np.ones((1, 100))))
    image.put(*live.feed(200, np.ones((1, 100))))
    shown = [bool(np.isfinite(image.column(number)[0][0])) for number in range(30)]
    assert shown == [True] * 10 + [False] * 10 + [True] * 10
    drawn = [
        any(image.image.pixelColor(x, y).name() == "#e69f00" for y in range(image.height))
        for x in range(30)
    ]
    assert drawn == shown
    history = History(1, 1000.0)
    history.append(0, np.ones((1, 100)))
    history.append(200, np.ones((1, 100)))
    again = np.isfinite(history.view().columns(0, 30, 10.0).low[0])
    assert again.tolist() == shown


def test_a_slow_signal_is_a_line_without_steps_or_holes(qapp):
    live, image = LiveColumns(0.1), raster(1, width=100)
    for number in range(11):
        found = live.feed(number, np.array([[float(number)]]))
        if found:
            image.put(*found)
    lows = np.array([image.column(number)[0][0] for number in range(100)])
    assert lows == pytest.approx(np.arange(100) * 0.1, abs=1e-5)


def test_an_image_made_anew_looks_as_the_live_one_did(qapp):
    rng = np.random.default_rng(4)
    values = rng.normal(0.0, 3.0, (2, 32_000))
    live, image, history = LiveColumns(64.0), raster(2), History(2, RATE_HZ)
    for begin in range(0, 32_000, 150):
        image.put(*live.feed(begin, values[:, begin : begin + 150]))
        history.append(begin, values[:, begin : begin + 150])
    again = raster(2)
    again.show(0, history.view().columns(0, 500, 64.0))
    assert again.image == image.image


def test_a_live_image_paints_new_columns_only(qapp):
    live, image = LiveColumns(100.0), raster(1)
    for begin in range(0, 500_000, 250):
        image.put(*live.feed(begin, np.zeros((1, 250))))
    assert image.painted <= 5000 + 2000  # each column, and one under way at each refresh


def test_another_look_reaches_columns_that_nothing_was_put_into(qapp):
    image = raster(1)
    live = LiveColumns(10.0)
    image.put(*live.feed(0, np.zeros((1, 1000))))  # a fifth of the width
    image.set_look(replace(image.look, ground="#ffffff"))
    corners = {image.image.pixelColor(x, 1).name() for x in range(1, image.width, 7)}
    assert "#000000" not in corners
