"""ViCo is used in the same way at home and from another station, over either transport."""

import re
import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pytest
import tifffile

from contract.station_rig import connected, free_port, listening
from contract.vico_rig import (
    LIMIT_S,
    VicoRig,
    following,
    hosted,
    soon,
    used_locally,
    vico_rig,
    with_exposure,
)
from cosmic.frame.errors import (
    ConfigError,
    CosmicError,
    MoveCancelled,
    MoveRefused,
    NotAvailable,
    RecordingExistsError,
)
from cosmic.frame.network.caller import Access
from cosmic.frame.network.errors import CallRefused
from cosmic.frame.network.line_settings import Line
from cosmic.frame.network.station import Station
from cosmic.frame.network.transport import Rule
from cosmic.frame.threads import declare_gui_thread
from cosmic.frame.verdict import Reason
from cosmic.vico.api import camera_images
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.api.camera_images import RemoteImages
from cosmic.vico.api.sent_image import SentImage
from cosmic.vico.api.vico import Vico
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.recording.reading import open_image_recording
from cosmic.vico.hw.interface import Trigger
from cosmic.vico.hw.peripherals import LensAxis
from unit.vico.vision import drawn_fibres

TRANSPORTS = ["station"]
STATE = "vico/state"


def images_topic(camera: str) -> str:
    return f"vico/camera_handles/{camera}/images"


def shown_topic(camera: str) -> str:
    return f"vico/camera_handles/{camera}/shown"


@pytest.fixture(params=["home", *TRANSPORTS])
def rig(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[VicoRig]:
    with vico_rig(request.param, tmp_path) as made:
        yield made
    assert not made.home.failures


@pytest.fixture(params=TRANSPORTS)
def away(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[VicoRig]:
    with vico_rig(request.param, tmp_path) as made:
        yield made
    assert not made.home.failures


def take_lease(rig: VicoRig) -> None:
    if rig.client is not None:
        rig.client.take_lease()


def noise(seed: int, shape: tuple[int, ...] = (48, 64), kind: Any = np.uint8) -> Any:
    return np.random.default_rng(seed).integers(0, 255, shape, kind)


def while_waiting(rig: VicoRig, ask: Callable[[], Any], level: int) -> Any:
    """Ask for the next image, and give one as soon as somebody waits for it."""
    with ThreadPoolExecutor(1) as pool:
        answer = pool.submit(ask)
        assert soon(lambda: answer.done() or (rig.home.camera.keep_coming(noise(level)) or False))
        return answer.result(LIMIT_S)


# --- what there is ----------------------------------------------------------------------------


def test_a_camera_reports_what_it_is_and_what_is_in_force(rig: VicoRig) -> None:
    camera = rig.vico.camera()
    assert list(rig.vico.cameras) == ["top"]
    assert (camera.name, camera.title) == ("top", "From above")
    assert soon(lambda: camera.running)
    thread = rig.home.application.unit("top").thread
    assert (camera.info, camera.ranges, camera.settings) == (
        thread.info,
        thread.ranges,
        thread.settings,
    )
    assert camera.problem == ""
    assert [each.on for each in camera.algorithms] == [False] * len(camera.algorithms)
    assert "ffv1" in [each.name for each in camera.formats]
    with pytest.raises(ConfigError, match="bottom"):
        rig.vico.camera("bottom")


def test_settings_are_in_force_when_their_task_has_ended(rig: VicoRig) -> None:
    camera = rig.vico.camera()
    camera.configure(with_exposure(camera.settings, 0.02)).wait(LIMIT_S)
    assert camera.settings is not None
    assert camera.settings.exposure_s == 0.02
    refused = camera.configure(with_exposure(camera.settings, 9.0))
    with pytest.raises(ConfigError, match=r"from 0\.0001 to 0\.05 s"):
        refused.wait(LIMIT_S)
    assert camera.settings.exposure_s == 0.02


def test_stopping_and_starting_is_reported(rig: VicoRig) -> None:
    camera, noticed = rig.vico.camera(), Event()
    forget = rig.vico.on_change(noticed.set)
    camera.stop().wait(LIMIT_S)
    assert not camera.running
    assert noticed.wait(LIMIT_S)
    forget()
    camera.start().wait(LIMIT_S)
    assert camera.running


def test_algorithms_and_background_are_switched(rig: VicoRig) -> None:
    camera = rig.vico.camera()
    camera.switch("focus", on=True)
    assert next(each for each in camera.algorithms if each.name == "focus").on
    rig.home.camera.push(noise(1))
    assert soon(lambda: camera.focus)
    with pytest.raises(ConfigError, match="no algorithm 'nonsense'"):
        camera.switch("nonsense", on=True)
    camera.set_background()
    rig.home.camera.push(*[rig.home.camera.grey(100 + n) for n in range(9)])
    assert soon(lambda: camera.has_background)
    camera.clear_background()
    assert soon(lambda: not camera.has_background)


def test_cameras_are_looked_for(rig: VicoRig) -> None:
    rig.vico.rescan().wait(LIMIT_S)
    assert [each.key for each in rig.vico.found] == ["P1"]
    rig.vico.use("top", "P1").wait(LIMIT_S)


# --- images ---------------------------------------------------------------------------------


def test_a_snap_is_exposed_after_the_call(rig: VicoRig) -> None:
    rig.home.camera.push(noise(1))
    image = while_waiting(rig, lambda: rig.vico.snap(timeout_s=LIMIT_S), 2)
    assert image.dtype == np.uint8
    assert np.array_equal(image, noise(2))


def test_no_image_in_time_says_why(rig: VicoRig) -> None:
    camera = rig.vico.camera()
    with pytest.raises(NotAvailable, match=r"no image of top in 0\.1 s: none arrived"):
        camera.next_image(0.1)
    camera.stop().wait(LIMIT_S)
    with pytest.raises(NotAvailable, match="it is stopped"):
        camera.next_image(0.1)


def test_the_newest_image_comes_with_all_that_is_known_of_it(rig: VicoRig) -> None:
    camera = rig.vico.camera()
    rig.home.camera.push(noise(4, kind=np.uint16))
    thread = rig.home.application.unit("top").thread
    assert soon(lambda: thread.newest is not None)
    assert soon(lambda: camera.latest() is not None)
    found, there = camera.latest(), thread.newest
    assert found is not None and there is not None
    assert np.array_equal(found.data, there.data)
    assert found.data.dtype == np.uint16
    assert not found.data.flags.writeable
    assert (found.camera, found.lost_before) == ("top", 0)
    assert found.circumstances == there.circumstances
    assert (found.frame.exposed_s, found.frame.pixel_format) == (
        there.frame.exposed_s,
        there.frame.pixel_format,
    )


def test_fibres_are_found_and_placed_on_the_platform(tmp_path: Path) -> None:
    lines = [drawn_fibres.arc((60.0, 120.0), 0.2, 300.0, 0.6)]
    image = drawn_fibres.drawn_image(lines, [9.0], shape=(320, 480)).astype(np.uint8)
    with vico_rig("station", tmp_path, size_px=(480, 320)) as rig:
        found, there = [
            while_waiting_for_fibres(rig, vico, image)
            for vico in (rig.vico, Vico(rig.home.application))
        ]
    assert len(found) == len(there) == 1
    assert found[0].length_px == there[0].length_px
    assert found[0].ends_um == pytest.approx(there[0].ends_um, abs=1e-6)
    assert found[0].doubts == there[0].doubts


def while_waiting_for_fibres(rig: VicoRig, vico: Vico, image: Any) -> Any:
    with ThreadPoolExecutor(1) as pool:
        answer = pool.submit(vico.find_fibres, timeout_s=LIMIT_S)
        assert soon(lambda: answer.done() or (rig.home.camera.keep_coming(image) or False))
        return answer.result(LIMIT_S)


def test_what_machine_vision_sees_is_shown(away: VicoRig) -> None:
    lines = [drawn_fibres.arc((8.0, 20.0), 0.1, 40.0, 0.1)]
    image = drawn_fibres.drawn_image(lines, [5.0], shape=(48, 64)).astype(np.uint8)
    camera = away.vico.camera()
    camera.switch("fibres", on=True)
    assert camera.analysis is None  # from now on it is received

    def seen() -> bool:
        away.home.camera.push(image.copy())
        return camera.analysis is not None

    assert soon(seen)
    newest = camera.analysis
    vision = away.home.application.unit("top").vision.newest
    assert newest is not None and vision is not None
    assert newest.image.data.shape == (48, 64)
    there = vision.results["fibres"]
    assert isinstance(there, tuple)
    assert [each.length_px for each in newest.fibres] == [each.length_px for each in there]


def test_plans_trigger_it(rig: VicoRig, tmp_path: Path) -> None:
    camera = rig.vico.camera()
    now = camera.settings
    assert now is not None
    camera.configure(replace(now, trigger=Trigger.SOFTWARE)).wait(LIMIT_S)
    camera.plan_images(tmp_path)
    status = camera.trigger()
    status.wait(LIMIT_S)
    assert camera.read()["top_mean"]["value"] == 77.0
    # The image itself is not read: documents of its file stand for it.
    assert set(camera.describe()) - set(camera.read()) == {"top_image"}
    assert list(tmp_path.glob("top_*.tif"))


# --- streams ----------------------------------------------------------------------------------


def test_every_frame_arrives_complete_and_in_order(away: VicoRig) -> None:
    got: list[SentImage] = []

    def receive(payload: object) -> None:
        if isinstance(payload, SentImage):
            got.append(payload)

    assert away.client is not None
    topic = images_topic("top")
    subscription = away.client.subscribe(topic, Rule.ALL, receive)
    try:
        assert soon(lambda: away.station.wanted(topic))
        sent = [noise(seed, (300, 400), np.uint16) for seed in range(60)]
        away.home.camera.push(*sent)
        assert soon(lambda: len(got) == len(sent))
        assert [each.frame_id for each in got] == list(range(60))
        assert all(np.array_equal(a.data, b) for a, b in zip(got, sent, strict=True))
        assert subscription.lost == 0
    finally:
        subscription.close()


def test_nothing_is_drawn_while_nobody_looks(
    away: VicoRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(camera_images, "IDLE_S", 0.2)
    taken: list[CameraImage] = []
    away.home.application.unit("top").thread.subscribe(taken.append)
    away.home.camera.push(*[noise(n) for n in range(20)])
    assert soon(lambda: len(taken) == 20)
    assert away.home.camera.drawn == 0
    camera = away.vico.camera()

    def looked() -> bool:
        away.home.camera.push(noise(30))
        return away.remote is not None and camera.latest() is not None and is_live(camera)

    assert soon(looked)
    assert soon(lambda: not away.station.wanted(shown_topic("top")))


def is_live(camera: CameraHandle) -> bool:
    assert isinstance(camera.images, RemoteImages)
    return camera.images.live


def test_an_image_that_the_line_dropped_is_asked_for(
    away: VicoRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = away.vico.camera()
    monkeypatch.setattr(Station, "wanted", lambda _, topic: topic != shown_topic("top"))
    take_back = declare_gui_thread()
    try:
        away.home.camera.push(noise(1))
        assert soon(lambda: camera.latest() is not None)
        away.home.camera.push(noise(2))

        def shown() -> bool:
            found = camera.latest()
            return found is not None and np.array_equal(found.data, noise(2))

        assert soon(shown)
    finally:
        take_back()


def test_the_live_view_is_corrected_by_the_background(away: VicoRig) -> None:
    camera, pushed = away.vico.camera(), away.home.camera
    ground = pushed.grey(100)
    ground[:, 32:] = 200
    camera.set_background()
    pushed.push(*[ground.copy() for _ in range(8)])
    assert soon(lambda: camera.has_background)

    def even() -> bool:
        pushed.keep_coming(ground.copy())
        found = camera.latest()
        return is_live(camera) and found is not None and int(np.ptp(found.data)) <= 1

    assert soon(even)
    assert np.array_equal(
        while_waiting(away, lambda: away.vico.snap(timeout_s=LIMIT_S), 4), noise(4)
    )


def test_a_state_that_was_overtaken_is_passed_over(away: VicoRig) -> None:
    assert away.remote is not None
    assert away.client is not None
    known: Any = away.client.call("vico", "state")
    notified: list[tuple[str, ...]] = []
    got = Event()
    forget = away.vico.on_change(lambda: notified.append(tuple(away.vico.cameras)))
    assert away.client is not None
    fence = away.client.subscribe(STATE, Rule.LATEST, lambda _: got.set())
    away.station.publish(
        STATE,
        replace(known, number=known.number - 1, values={**known.values, "camera_handles": {}}),
    )
    assert got.wait(LIMIT_S)
    away.vico.camera().switch("focus", on=True)  # a newer one follows
    assert soon(lambda: notified)
    assert set(notified) == {("top",)}
    forget()
    fence.close()


def test_a_slow_view_delays_no_call(away: VicoRig) -> None:
    go_on, seen = Event(), []

    def slow(payload: object) -> None:
        if isinstance(payload, SentImage):
            seen.append(payload.frame_id)
            go_on.wait(LIMIT_S)

    assert away.client is not None
    subscription = away.client.subscribe(shown_topic("top"), Rule.LATEST, slow)
    try:
        assert soon(lambda: away.station.wanted(shown_topic("top")))

        def stuck() -> bool:
            away.home.camera.keep_coming(noise(1, (1200, 1600)))
            return bool(seen)

        assert soon(stuck)
        for number in range(30):  # each raises after 2 s without an answer
            away.home.camera.keep_coming(noise(number % 3, (1200, 1600)))
            away.client.call("vico", "now_s")
        assert len(seen) == 1
        go_on.set()
        number = away.home.camera.given

        def caught_up() -> bool:  # a full line may have dropped what was the newest then
            away.home.camera.keep_coming(noise(5, (1200, 1600)))
            return seen[-1] >= number

        assert soon(caught_up)
        assert len([each for each in seen if each < number]) < 15  # it was spared most of them
    finally:
        go_on.set()
        subscription.close()


# --- files ------------------------------------------------------------------------------------


def test_a_recording_holds_what_was_taken(rig: VicoRig, tmp_path: Path) -> None:
    camera = rig.vico.camera()
    frames = [noise(n) for n in range(12)]
    with rig.vico.record(tmp_path / "run.mkv") as path:
        assert camera.recording.active
        rig.home.camera.push(*frames)
        recordings = rig.home.application.unit("top").recordings
        assert soon(lambda: recordings.state.written == 12)
    assert not camera.recording.active
    assert (camera.recording.written, camera.recording.dropped) == (12, 0)
    with open_image_recording(path) as recording:
        pairs = zip(recording, frames, strict=True)
        assert all(np.array_equal(each.data, sent) for each, sent in pairs)
    with pytest.raises(RecordingExistsError):
        camera.record(path)


def test_a_path_without_a_root_begins_on_the_stations_disk(away: VicoRig, tmp_path: Path) -> None:
    camera = away.vico.camera()
    with away.vico.record("run.mkv"):
        away.home.camera.push(noise(1))
        assert soon(lambda: away.home.application.unit("top").recordings.state.written)
    assert (tmp_path / "run.mkv").exists()
    assert camera.directory == tmp_path
    assert camera.remote


def test_who_may_only_look_sees_all_and_changes_nothing(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    line = Line(endpoint, listens=True, station="fibres")
    with (
        used_locally(tmp_path, rate=1.0) as home,
        hosted(home) as station,
        listening(station, line, lambda _: Access.VIEW),
        connected(endpoint, "guest") as client,
        following(client, home.policy) as remote,
    ):
        vico = remote.api
        rig = VicoRig(home, vico, station)
        assert np.array_equal(while_waiting(rig, lambda: vico.snap(timeout_s=LIMIT_S), 3), noise(3))
        assert vico.camera().latest() is not None
        with pytest.raises(CallRefused, match="may not call"):
            vico.camera().stop()
        assert vico.lens is not None
        running = home.application.peripherals.home()
        vico.lens.abort()
        with pytest.raises(MoveCancelled):
            running.wait(LIMIT_S)


def test_images_and_time_lapses_are_written(rig: VicoRig, tmp_path: Path) -> None:
    camera = rig.vico.camera()
    rig.home.camera.push(noise(5))
    assert soon(lambda: camera.latest() is not None)
    taken = datetime.now(UTC)
    camera.stop().wait(LIMIT_S)
    assert soon(lambda: (datetime.now(UTC) - taken).total_seconds() > 2.5)
    camera.snap(tmp_path / "one.tif").wait(LIMIT_S)
    camera.start().wait(LIMIT_S)
    with tifffile.TiffFile(tmp_path / "one.tif") as file:
        found = re.search(r"AcquisitionDate>([^<]+)<", file.ome_metadata or "")
    assert found is not None
    said = datetime.fromisoformat(found[1])
    assert abs((said - taken).total_seconds()) < 1.5  # of the image, not of the snap
    with pytest.raises(RecordingExistsError):
        camera.snap(tmp_path / "one.tif").wait(LIMIT_S)
    # Half a second of the wall: a busy computer that is later than that has missed a picture.
    lapse = camera.time_lapse(tmp_path / "lapse", "tiff", interval_s=10.0, count=3)

    def over() -> bool:
        rig.home.camera.push(noise(6))
        return lapse.done

    assert soon(over)
    lapse.wait(1.0)
    assert len(list((tmp_path / "lapse").glob("*.tif*"))) == 3


def test_a_time_lapse_ends_where_no_image_came_until_after_its_end(tmp_path: Path) -> None:
    with vico_rig("home", tmp_path) as rig:
        camera, clock = rig.vico.camera(), rig.home.application.clock
        lapse = camera.time_lapse(tmp_path / "lapse", "tiff", interval_s=0.1, count=2)
        began_s = clock.now_s()
        assert soon(lambda: clock.now_s() - began_s > 1.0)
        rig.home.camera.push(noise(6))
        lapse.wait(LIMIT_S)
        assert camera.recording.written == 0


def test_a_time_lapse_that_failed_ends_no_recording_after_it(tmp_path: Path) -> None:
    with vico_rig("home", tmp_path) as rig:
        camera, pushed = rig.vico.camera(), rig.home.camera
        lapse = camera.time_lapse(tmp_path / "lapse", "tiff", interval_s=1.0, count=3)
        pushed.push(noise(1))
        assert soon(lambda: camera.recording.written)
        shutil.rmtree(tmp_path / "lapse")
        assert soon(lambda: lapse.done and camera.recording.failure)
        camera.record(tmp_path / "after", "tiff")
        began_s = rig.home.application.clock.now_s()
        assert soon(lambda: rig.home.application.clock.now_s() - began_s > 4.0)
        for seed in range(5):
            pushed.push(noise(seed))
            assert soon(lambda count=seed + 1: camera.recording.written == count)
        assert camera.recording.active
        camera.stop_recording(wait=True)
        rig.home.failures.clear()


# --- lens and light ---------------------------------------------------------------------------


def test_lens_and_light_carry_out_commands(rig: VicoRig) -> None:
    take_lease(rig)
    lens, light = rig.vico.lens, rig.vico.light
    assert lens is not None and light is not None
    assert [each.name for each in lens.steps] == ["0.5x", "1x", "2x"]
    assert "generation" in lens.name
    lens.home().wait(LIMIT_S)
    lens.zoom_to(1.0).wait(LIMIT_S)
    assert lens.zoom == pytest.approx(1.0, rel=0.01)
    lens.seek_focus(1234).wait(LIMIT_S)
    focus = lens.state(LensAxis.FOCUS)
    assert focus is not None
    assert abs(focus.position_counts - 1234) <= 2
    with pytest.raises(ConfigError, match="not in the table"):
        lens.zoom_to(7.0)
    with pytest.raises(CosmicError, match="9999999"):
        lens.seek_focus(9_999_999).wait(LIMIT_S)
    light.set_percent(20.0).wait(LIMIT_S)
    assert light.percent == 20.0
    with pytest.raises(ConfigError, match="not between 0 and 100"):
        light.set_percent(101.0)
    lens.reopen().wait(LIMIT_S)
    assert lens.problem == light.problem == ""


@pytest.mark.parametrize("where", ["home", *TRANSPORTS])
def test_a_movement_of_the_lens_is_ended_early(where: str, tmp_path: Path) -> None:
    with vico_rig(where, tmp_path, rate=1.0) as rig:
        take_lease(rig)
        lens = rig.vico.lens
        assert lens is not None
        task = lens.seek_focus(7900)
        lens.abort()
        with pytest.raises(MoveCancelled, match="aborted"):
            task.wait(LIMIT_S)
        task = lens.home()
        assert soon(lambda: task.progress.text)
        task.cancel()
        with pytest.raises(MoveCancelled):
            task.wait(LIMIT_S)
        focus = rig.home.application.peripherals.state.focus
        assert focus is not None
        assert focus.position_counts > 100


def test_moving_the_lens_needs_the_right_to_move(away: VicoRig) -> None:
    lens = away.vico.lens
    assert lens is not None
    for wish in (lens.home, lambda: lens.zoom_to(1.0), lens.autofocus):
        with pytest.raises(MoveRefused) as caught:
            wish()
        assert caught.value.verdict.reason is Reason.NO_LEASE
    lens.abort()
    assert away.vico.light is not None
    away.vico.light.set_percent(30.0).wait(LIMIT_S)


def test_the_lens_stops_when_who_moves_it_is_gone(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with used_locally(tmp_path, rate=1.0) as home, hosted(home, endpoint):
        peripherals = home.application.peripherals
        with connected(endpoint) as client, following(client, home.policy) as remote:
            client.take_lease()
            lens = remote.api.lens
            assert lens is not None
            task = lens.home()
            assert soon(lambda: peripherals.state.moving)
        assert soon(lambda: not peripherals.state.moving)
        with pytest.raises(CosmicError):
            task.wait(LIMIT_S)
        zoom = peripherals.state.zoom
        assert zoom is not None


# --- places -----------------------------------------------------------------------------------


def test_pixels_are_points_on_the_platform(rig: VicoRig) -> None:
    take_lease(rig)
    camera, places = rig.vico.camera(), rig.home.places
    rig.home.camera.push(noise(1))
    assert soon(lambda: camera.latest() is not None)
    assert camera.calibration_problem == ""
    assert camera.platform_um((10.0, 5.0)) == pytest.approx((90.0, 70.0))
    assert list(camera.targets) == list(rig.vico.tools) == ["left", "right"]
    assert camera.calibrated == tuple(places.calibrated)
    assert camera.click_to_move((10.0, 5.0), "left") == "left moves"
    assert places.moved == [((10.0, 5.0), "left")]
    camera.calibrate_stage("left").wait(LIMIT_S)
    with pytest.raises(NotAvailable, match="no axis turns the plate"):
        camera.find_rotation_centre()
    assert rig.vico.rotation_centre() is None


def test_a_click_into_an_image_that_has_changed_moves_nothing(away: VicoRig) -> None:
    take_lease(away)
    camera, places = away.vico.camera(), away.home.places
    away.home.camera.push(noise(1))
    assert soon(lambda: camera.latest() is not None)
    shown = camera.latest()
    assert shown is not None and camera.images.transform is not None
    places.shift_um = 130.0
    with pytest.raises(NotAvailable, match="has changed since"):
        camera.images.transform.move_to(shown, (10.0, 5.0), "left")
    assert places.moved == []


# --- a window ---------------------------------------------------------------------------------


def test_a_window_never_waits_and_hears_of_refusals(away: VicoRig, tmp_path: Path) -> None:
    camera, lens = away.vico.camera(), away.vico.lens
    assert lens is not None
    take_back = declare_gui_thread()
    try:
        camera.latest()
        (tmp_path / "there.mkv").write_bytes(b"kept")
        camera.record(tmp_path / "there.mkv")
        home = lens.home()
        camera.software_trigger()
        camera.stop()
    finally:
        take_back()
    assert soon(lambda: home.done)
    assert isinstance(home.failure, MoveRefused)
    assert soon(lambda: not camera.running)
    assert (tmp_path / "there.mkv").read_bytes() == b"kept"

    take_back = declare_gui_thread()
    try:
        camera.record(tmp_path / "there.mkv")
    finally:
        take_back()
    assert soon(lambda: camera.refused)
    camera.start().wait(LIMIT_S)
    assert camera.refused == ""


def test_a_remote_handle_has_no_camera_of_its_own(away: VicoRig) -> None:
    """Whatever a script can read of it is known without one."""
    lens, light = away.vico.lens, away.vico.light
    assert lens is not None and light is not None
    for handle in (away.vico, away.vico.camera(), lens, light):
        names = [name for name in dir(handle) if not name.startswith("_")]
        read = [name for name in names if isinstance(getattr(type(handle), name, None), property)]
        assert len(read) > 5
        for name in read:
            if name != "application":
                getattr(handle, name)


# --- away and back ----------------------------------------------------------------------------


def test_a_station_that_goes_away_says_so_and_comes_back(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with ExitStack() as stack:
        home = stack.enter_context(used_locally(tmp_path))
        first = stack.enter_context(ExitStack())
        first.enter_context(hosted(home, endpoint))
        client = stack.enter_context(connected(endpoint))
        remote = stack.enter_context(following(client, home.policy))
        vico = remote.api
        camera, lens = vico.camera(), vico.lens
        assert soon(lambda: camera.running)
        home.camera.push(noise(1))
        assert soon(lambda: camera.latest() is not None)

        first.close()
        assert soon(lambda: "fibres is away" in camera.problem)
        assert not camera.running
        assert (camera.settings, camera.info, tuple(vico.tools)) == (None, None, ())
        assert lens is not None and vico.light is not None
        assert "fibres is away" in lens.problem
        assert "fibres is away" in vico.light.problem
        with pytest.raises(NotAvailable):
            vico.snap()

        stack.enter_context(hosted(home, endpoint))
        assert soon(lambda: camera.running and not camera.problem)
        rig = VicoRig(home, vico, Station("other", home.policy))
        assert np.array_equal(while_waiting(rig, lambda: vico.snap(timeout_s=LIMIT_S), 9), noise(9))

        def newest() -> bool:
            home.camera.push(noise(10))
            found = camera.latest()
            return found is not None and np.array_equal(found.data, noise(10))

        assert soon(newest)
