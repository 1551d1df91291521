"""Plans of bluesky run on the simulated platform, with bluesky's own RunEngine."""

import json
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bluesky import RunEngine, protocols
from bluesky import plan_stubs as bps
from bluesky.plans import count, fly, grid_scan, list_scan, rel_list_scan, rel_scan, scan
from bluesky.preprocessors import fly_during_wrapper, monitor_during_wrapper
from bluesky.simulators import check_limits
from bluesky.suspenders import SuspendCeil, SuspendFloor
from bluesky.utils import FailedStatus, RunEngineInterrupted
from event_model import DocumentNames, schema_validators

import cosmic
from cosmic.mico.api.axis import Axis
from cosmic.mico.core.motion.positioner import Status
from system.simulated_platform import wait_until

Documents = list[tuple[str, dict[str, Any]]]

FAST_HZ, SLOW_HZ = 5000, 30


@pytest.fixture(scope="module")
def rig() -> Iterator[cosmic.Rig]:
    with cosmic.connect(rate=20.0, applications=("mico", "daqco")) as rig:
        yield rig


@pytest.fixture(scope="module")
def engine() -> RunEngine:
    return RunEngine({}, context_managers=[])


@pytest.fixture
def x(rig: cosmic.Rig) -> Iterator[Axis]:
    """Give an axis at 0; afterwards it is fast again, and nothing is stopped."""
    axis = rig.mico["left.x"]
    rig.mico.move({"left.x": 0.0, "left.y": 0.0})
    yield axis
    rig.reset_stop()
    axis.set_closed_loop_frequency(FAST_HZ)
    standing_um(axis)


@pytest.fixture
def documents(engine: RunEngine) -> Iterator[Documents]:
    """Give the documents of what runs, each checked against its schema."""
    heard: Documents = []

    def hear(name: str, document: dict[str, Any]) -> None:
        schema_validators[DocumentNames[name]].validate(document)
        heard.append((name, document))

    token = engine.subscribe(hear)
    yield heard
    engine.unsubscribe(token)
    if engine.state != "idle":
        engine.abort()


def events(documents: Documents) -> list[dict[str, Any]]:
    return [document["data"] for name, document in documents if name == "event"]


def ending(documents: Documents) -> str:
    return str(documents[-1][1]["exit_status"])


def at(axis: Axis, place: float, act: Callable[[], object]) -> Callable[[], None]:
    """Have `act` called once, when the axis has passed a place; returns what takes it back."""
    done = threading.Event()

    def look(state: Any) -> None:
        if state.shown_position is not None and state.shown_position > place and not done.is_set():
            done.set()
            act()

    return axis.subscribe(look)


def standing_um(axis: Axis) -> float:
    """Wait until an axis stands and return where."""
    wait_until(lambda: axis.state is Status.OK)
    position_um = axis.position_um
    assert position_um is not None
    return position_um


# What the devices are


@pytest.mark.parametrize("kind", ["axis", "group", "channel"])
def test_devices_have_the_shapes_of_bluesky(rig: cosmic.Rig, kind: str) -> None:
    device, shapes = {
        "axis": (rig.mico["left.x"], ("Locatable", "Stoppable", "Checkable")),
        "group": (rig.mico.group("left.x", "left.y"), ("Locatable", "Stoppable", "Checkable")),
        "channel": (rig.daqco["force"], ("Triggerable", "Flyable", "EventPageCollectable")),
    }[kind]
    for shape in ("Readable", "Configurable", "HasHints", "HasParent", *shapes):
        assert isinstance(device, getattr(protocols, shape)), shape
    assert device.read().keys() == device.describe().keys()
    assert device.read_configuration().keys() == device.describe_configuration().keys()
    assert set(device.hints["fields"]) <= device.read().keys()
    for key in device.describe().values():
        assert key["source"] and key["dtype"] == "number" and key["shape"] == []
        assert key["units"] in {"um", "uN"}
    assert "." not in device.name


def test_readings_are_stamped_with_the_time_of_the_day(rig: cosmic.Rig, x: Axis) -> None:
    for device in (x, rig.daqco["force"]):
        for reading in device.read().values():
            assert time.time() - 60.0 < reading["timestamp"] <= time.time()


def test_src_does_not_import_bluesky() -> None:
    src = Path(__file__).resolve().parents[2] / "src"
    lines = (line for file in src.rglob("*.py") for line in file.read_text("utf-8").splitlines())
    assert not [line for line in lines if line.lstrip().startswith(("import bl", "from bl"))]


# Scans


def test_a_scan_reads_the_force_at_every_place(
    rig: cosmic.Rig, engine: RunEngine, x: Axis, documents: Documents
) -> None:
    engine(scan([rig.daqco["force"]], x, 0.0, 100.0, 3))
    assert [each["left_x"] for each in events(documents)] == pytest.approx([0, 50, 100], abs=1.0)
    for each in events(documents):
        assert each["force"] == pytest.approx(1.0, abs=0.5)
        assert 0.1 < each["force_std"] < 1.0
    assert ending(documents) == "success"


def test_a_grid_of_two_axes_visits_every_place(
    rig: cosmic.Rig, engine: RunEngine, x: Axis, documents: Documents
) -> None:
    y = rig.mico["left.y"]
    engine(grid_scan([], x, 0.0, 20.0, 2, y, 0.0, 40.0, 2, snake_axes=True))
    there = [(each["left_x"], each["left_y"]) for each in events(documents)]
    assert np.array(there) == pytest.approx(np.array([(0, 0), (0, 40), (20, 40), (20, 0)]), abs=1.0)


def test_a_group_goes_to_a_list_of_places(
    rig: cosmic.Rig, engine: RunEngine, x: Axis, documents: Documents
) -> None:
    group = rig.mico.group("left.x", "left.y")
    engine(list_scan([], group, [(10.0, 0.0), (20.0, -30.0)]))
    there = [(each["left_x"], each["left_y"]) for each in events(documents)]
    assert np.array(there) == pytest.approx(np.array([(10, 0), (20, -30)]), abs=1.0)
    assert group.locate()["readback"] == pytest.approx({"left_x": 20, "left_y": -30}, abs=1.0)


def test_a_relative_scan_comes_back_to_where_it_began(
    rig: cosmic.Rig, engine: RunEngine, x: Axis, documents: Documents
) -> None:
    x.move_to(30.0)
    engine(rel_scan([], x, -10.0, 10.0, 2))
    assert [each["left_x"] for each in events(documents)] == pytest.approx([20, 40], abs=1.0)
    assert x.position_um == pytest.approx(30.0, abs=1.0)


def test_the_setpoint_is_what_a_plan_asked_for_until_something_else_moves_it(x: Axis) -> None:
    x.set(12.5).wait(5.0)
    assert x.locate()["setpoint"] == 12.5
    x.move_to(50.0)
    where = x.locate()
    assert where["setpoint"] == where["readback"] == pytest.approx(50.0, abs=1.0)


# What must not be done


def test_limits_and_collisions_are_found_without_moving(rig: cosmic.Rig, x: Axis) -> None:
    before = x.position_um
    with pytest.raises(cosmic.LimitError):
        check_limits(scan([], x, 0.0, 9000.0, 3))
    with pytest.raises(cosmic.CollisionError, match="jaw"):
        group = rig.mico.group("left.x", "right.x")
        check_limits(list_scan([], group, [(0.0, 0.0), (4000.0, -4000.0)]))
    check_limits(scan([], x, 0.0, 100.0, 3))
    assert x.position_um == pytest.approx(before, abs=0.5)


@pytest.mark.parametrize("target", [9000.0, float("nan"), "5 V"])
def test_a_refused_move_ends_the_plan_as_a_failure(
    engine: RunEngine, x: Axis, documents: Documents, target: Any
) -> None:
    with pytest.raises(FailedStatus) as failed:
        engine(list_scan([], x, [10.0, target]))
    assert isinstance(failed.value.__cause__, cosmic.MoveRefused)
    assert ending(documents) == "fail"
    assert x.position_um == pytest.approx(10.0, abs=1.0)


def test_a_collision_ends_the_plan_as_a_failure_and_nothing_moves(
    rig: cosmic.Rig, engine: RunEngine, x: Axis
) -> None:
    group = rig.mico.group("left.x", "right.x")
    with pytest.raises(FailedStatus) as failed:
        engine(bps.mv(group, (4000.0, -4000.0)))
    assert isinstance(failed.value.__cause__, cosmic.CollisionError)
    assert x.position_um == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize("value", [(1.0,), 5.0, {"left.z": 1.0}, {}])
def test_targets_that_do_not_fit_a_group_fail(rig: cosmic.Rig, x: Axis, value: Any) -> None:
    status = rig.mico.group("left.x", "left.y").set(value)
    assert isinstance(status.exception(), cosmic.ConfigError)
    assert status.movement is None


def test_a_group_needs_axes_that_are_there(rig: cosmic.Rig) -> None:
    with pytest.raises(cosmic.ConfigError):
        rig.mico.group()
    with pytest.raises(cosmic.UnknownAxisError):
        rig.mico.group("left.x", "left.q")


# Stopping and pausing


def test_a_stop_in_the_middle_of_a_plan_ends_it_as_a_failure(
    rig: cosmic.Rig, engine: RunEngine, x: Axis, documents: Documents
) -> None:
    x.set_closed_loop_frequency(SLOW_HZ)
    forget = at(x, 20.0, lambda: rig.stop("enough"))
    with pytest.raises(FailedStatus) as failed:
        engine(scan([], x, 0.0, 3000.0, 2))
    forget()
    assert isinstance(failed.value.__cause__, cosmic.StoppedError)
    assert ending(documents) == "fail"
    assert standing_um(x) < 2000.0


def test_the_failure_of_one_axis_of_a_group_fails_the_whole(rig: cosmic.Rig, x: Axis) -> None:
    x.set_closed_loop_frequency(SLOW_HZ)
    group = rig.mico.group("left.x", "left.y")
    heard: list[object] = []
    status = group.set((3000.0, 5.0))
    status.add_callback(heard.append)
    x.halt()
    assert isinstance(status.exception(5.0), cosmic.MoveCancelled)
    wait_until(lambda: heard)  # told once the status has ended
    assert heard == [status]


def test_a_paused_plan_stands_still_and_makes_its_move_again(
    engine: RunEngine, x: Axis, documents: Documents
) -> None:
    x.set_closed_loop_frequency(SLOW_HZ)
    forget = at(x, 20.0, engine.request_pause)
    with pytest.raises(RunEngineInterrupted):
        engine(scan([], x, 0.0, 2000.0, 2))
    forget()
    assert standing_um(x) < 1900.0
    x.set_closed_loop_frequency(FAST_HZ)
    engine.resume()
    assert [each["left_x"] for each in events(documents)] == pytest.approx([0, 2000], abs=1.0)
    assert ending(documents) == "success"


def test_an_aborted_plan_leaves_nothing_moving(
    engine: RunEngine, x: Axis, documents: Documents
) -> None:
    x.set_closed_loop_frequency(SLOW_HZ)
    forget = at(x, 20.0, engine.request_pause)
    with pytest.raises(RunEngineInterrupted):
        engine(scan([], x, 0.0, 2000.0, 2))
    forget()
    engine.abort("enough")
    assert ending(documents) == "abort"
    assert standing_um(x) < 1900.0


# Watching while a plan runs


def test_what_moves_and_what_is_felt_is_monitored_during_a_plan(
    rig: cosmic.Rig, engine: RunEngine, x: Axis, documents: Documents
) -> None:
    x.set_closed_loop_frequency(SLOW_HZ * 20)
    watched = [x, rig.daqco["force"].live, rig.mico.live_clearance]
    for device in watched:
        assert isinstance(device, protocols.Subscribable | protocols.Readable)
    y = rig.mico["left.y"]
    engine(monitor_during_wrapper(scan([y], x, 0.0, 300.0, 2), watched))
    streams = {
        document["uid"]: document["name"] for name, document in documents if name == "descriptor"
    }
    seen: dict[str, list[float]] = {}
    for name, document in documents:
        if name == "event" and streams[document["descriptor"]] != "primary":
            for key, value in document["data"].items():
                seen.setdefault(key, []).append(value)
    assert seen.keys() == {"left_x", "force_live", "clearance_um"}
    assert max(seen["left_x"]) == pytest.approx(300, abs=2)
    assert len(seen["left_x"]) > 3
    assert len(seen["force_live"]) > 3
    assert min(seen["clearance_um"]) > 0.0
    count = len(documents)
    x.move_to(0.0)
    assert len(documents) == count, "nothing is monitored once the plan is over"


def test_a_plan_is_suspended_while_the_force_is_too_high_and_then_goes_on(
    rig: cosmic.Rig, engine: RunEngine, x: Axis, documents: Documents
) -> None:
    force = rig.daqco["force"]
    scale = rig.daqco.scales["force"]
    high = replace(scale, coefficients=(scale.coefficients[0] + 500.0, *scale.coefficients[1:]))
    suspender = SuspendCeil(force.live, 300.0, resume_thresh=200.0)
    engine.install_suspender(suspender)
    rig.daqco.disarm_limit("force")
    rig.daqco.set_scale("force", high)  # it is felt from now on
    threading.Timer(1.0, lambda: rig.daqco.set_scale("force", scale)).start()
    try:
        wait_until(lambda: force.live.get() > 300.0)
        begun_s = time.monotonic()
        engine(scan([], x, 0.0, 20.0, 2))
    finally:
        engine.remove_suspender(suspender)
        rig.daqco.set_scale("force", scale)
    assert time.monotonic() - begun_s > 0.5
    assert ending(documents) == "success"
    assert [each["left_x"] for each in events(documents)] == pytest.approx([0, 20], abs=1.0)


def test_a_plan_stops_moving_while_bodies_are_too_near(
    rig: cosmic.Rig, engine: RunEngine, x: Axis, documents: Documents
) -> None:
    distance_um = rig.mico.clearance().distance_um
    wait_until(lambda: rig.mico.live_clearance.get() == pytest.approx(distance_um, abs=1.0))
    suspender = SuspendFloor(rig.mico.live_clearance, distance_um + 10.0)
    engine.install_suspender(suspender)
    threading.Timer(0.7, engine.request_pause).start()
    try:
        with pytest.raises(RunEngineInterrupted):
            engine(scan([], x, 100.0, 200.0, 2))
    finally:
        engine.remove_suspender(suspender)
    assert standing_um(x) == pytest.approx(0.0, abs=1.0)
    engine.abort("seen")


# Settings and groups


def test_settings_that_a_plan_changes_are_in_its_documents(
    rig: cosmic.Rig, engine: RunEngine, x: Axis, documents: Documents
) -> None:
    force, group = rig.daqco["force"], rig.mico.group("left.x", "left.y")

    def plan() -> Any:
        old, new = yield from bps.configure(x, {"frequency_hz": 1000})
        assert new["left_x_frequency_hz"]["value"] == 1000 != old["left_x_frequency_hz"]["value"]
        yield from bps.configure(force, {"force_average_s": 0.05})
        yield from bps.configure(group, {"left_y_frequency_hz": 2000})
        yield from count([force, group])

    engine(plan())
    (descriptor,) = [document for name, document in documents if name == "descriptor"]
    told = descriptor["configuration"]
    assert told["force"]["data"]["force_average_s"] == 0.05
    assert told["left_x_and_left_y"]["data"]["left_x_frequency_hz"] == 1000
    assert told["left_x_and_left_y"]["data"]["left_y_frequency_hz"] == 2000
    force.average_s = 0.1
    rig.mico["left.y"].set_closed_loop_frequency(FAST_HZ)
    for device, wrong in ((x, "zero"), (force, "rate_hz"), (group, "right_x_frequency_hz")):
        with pytest.raises(cosmic.ConfigError, match="cannot be set"):
            device.configure({wrong: 1})
    with pytest.raises(cosmic.MoveRefused):
        x.configure({"frequency_hz": 10**6})


def test_a_group_goes_to_distances_and_comes_back(
    rig: cosmic.Rig, engine: RunEngine, x: Axis, documents: Documents
) -> None:
    rig.mico.move({"left.x": 30.0, "left.y": -10.0})
    engine(rel_list_scan([], rig.mico.group("left.x", "left.y"), [(5.0, 0.0), (10.0, -20.0)]))
    there = [(each["left_x"], each["left_y"]) for each in events(documents)]
    assert np.array(there) == pytest.approx(np.array([(35, -10), (40, -30)]), abs=1.0)
    assert standing_um(x) == pytest.approx(30.0, abs=1.0)


def test_a_group_with_a_name_is_read_beside_its_own_axes(
    rig: cosmic.Rig, engine: RunEngine, x: Axis, documents: Documents
) -> None:
    arm = rig.mico.group("left.x", "left.y", name="arm")
    assert arm.read().keys() == arm.describe().keys() == {"arm_left_x", "arm_left_y"}
    engine(list_scan([x], arm, [(5.0, 0.0), (10.0, 5.0)]))
    for each in events(documents):
        assert each["left_x"] == pytest.approx(each["arm_left_x"], abs=1.0)


# Detectors


def test_an_average_is_made_of_samples_taken_after_the_trigger(
    rig: cosmic.Rig, engine: RunEngine
) -> None:
    force = rig.daqco["force"]
    force.average_s = 0.5
    chunks: list[Any] = []
    forget = rig.daqco.subscribe(chunks.append)
    triggered_s = rig.daqco.application.clock.now_s()
    force.trigger().wait(5.0)
    forget()
    force.average_s = 0.1
    samples = np.concatenate([each.values[0] for each in chunks])
    times_s = np.concatenate(
        [each.time_s + np.arange(each.samples) / each.rate_hz for each in chunks]
    )
    reading = force.read()["force"]["value"]
    # One taken at that very moment counts: a clock that waits for samples stands between two.
    after = np.flatnonzero(times_s >= triggered_s - 1e-9)
    means = [samples[first : first + 500].mean() for first in after]
    assert min(abs(np.array(means) - reading)) < 1e-9


@pytest.mark.parametrize("duration_s", [0.0, -1.0, float("nan"), 1e6])
def test_an_average_over_no_time_is_refused(rig: cosmic.Rig, duration_s: float) -> None:
    with pytest.raises(cosmic.ConfigError):
        rig.daqco["force"].average_s = duration_s
    assert rig.daqco["force"].average_s == 0.1


def test_only_active_channels_are_given(rig: cosmic.Rig) -> None:
    with pytest.raises(cosmic.ConfigError, match="force"):
        rig.daqco["forse"]
    assert "force" in rig.daqco
    assert [each.name for each in rig.daqco] == list(rig.daqco.channels)


def test_a_trigger_fails_when_acquisition_ends_or_does_not_run(
    engine: RunEngine, documents: Documents
) -> None:
    with cosmic.connect(rate=20.0, applications=("daqco",)) as rig:
        force = rig.daqco["force"]
        force.average_s = 500.0
        status, flight = force.trigger(), force.kickoff()
        flight.wait(5.0)
        rig.daqco.stop()
        assert isinstance(status.exception(5.0), cosmic.NotAvailable)
        assert isinstance(force.complete().exception(5.0), cosmic.NotAvailable)
        with pytest.raises(FailedStatus):
            engine(count([force]))
        assert ending(documents) == "fail"


def test_every_sample_of_a_flight_is_collected_once(
    rig: cosmic.Rig, engine: RunEngine, x: Axis, documents: Documents
) -> None:
    force = rig.daqco["force"]
    engine(fly_during_wrapper(scan([force], x, 0.0, 50.0, 2), [force]))
    pages = [document for name, document in documents if name == "event_page"]
    times_s = np.concatenate([each["data"]["force_time_s"] for each in pages])
    assert np.diff(times_s) == pytest.approx(1.0 / rig.daqco.rate_hz, abs=1e-9)
    assert len(events(documents)) == 2
    stamps = np.concatenate([each["timestamps"]["force"] for each in pages])
    assert np.ptp(stamps) == pytest.approx(np.ptp(times_s) / 20.0, abs=1e-4)


def test_a_flight_is_collected_while_it_goes_on(
    rig: cosmic.Rig, engine: RunEngine, documents: Documents
) -> None:
    force = rig.daqco["force"]

    def plan() -> Any:
        yield from bps.open_run()
        yield from bps.kickoff(force, wait=True)
        yield from bps.collect(force)
        yield from bps.complete(force, wait=True)
        yield from bps.collect(force)
        yield from bps.close_run()

    engine(plan())
    pages = [document for name, document in documents if name == "event_page"]
    assert len(pages) == 2
    times_s = np.concatenate([each["data"]["force_time_s"] for each in pages])
    assert np.diff(times_s) == pytest.approx(1.0 / rig.daqco.rate_hz, abs=1e-9)


def test_a_flight_that_never_began_cannot_be_completed(rig: cosmic.Rig) -> None:
    status = rig.daqco["aux"].complete()
    assert isinstance(status.exception(), cosmic.NotAvailable)
    assert not list(rig.daqco["aux"].collect_pages())


def test_a_plan_that_only_flies_gives_one_stream(
    rig: cosmic.Rig, engine: RunEngine, documents: Documents
) -> None:
    engine(fly([rig.daqco["force"]]))
    streams = [document["name"] for name, document in documents if name == "descriptor"]
    assert streams == ["force"]


def test_a_camera_in_a_scan_keeps_a_fresh_image_of_every_place(
    engine: RunEngine, documents: Documents, tmp_path: Path
) -> None:
    with cosmic.connect(rate=4.0) as rig:
        camera = rig.vico.camera()
        assert isinstance(camera, protocols.Triggerable | protocols.Configurable)
        with pytest.raises(cosmic.NotAvailable):
            camera.read()
        (tmp_path / f"{camera.name}_00007.png").touch()
        camera.plan_images(tmp_path, fibres=True)
        engine(scan([camera], rig.mico["right.x"], 0.0, 100.0, 2))
        external = {f"{camera.name}_image"}
        assert camera.read().keys() | external == camera.describe().keys()
        assert set(camera.hints["fields"]) <= camera.read().keys()
        kept = [Path(each[f"{camera.name}_file"]) for each in events(documents)]
        assert [each.name[-9:] for each in kept] == ["00008.tif", "00009.tif"]
        assert all(each.stat().st_size > 10_000 for each in kept)
        first, second = events(documents)
        told = [document for name, document in documents if name.startswith("stream_")]
        (folder, *images) = told
        assert folder["uri"] == f"file://localhost{tmp_path.as_posix()}/"
        names = [folder["parameters"]["template"].format(n["indices"]["start"]) for n in images]
        assert names == [each.name for each in kept], "tiled finds the same files"
        assert [each["seq_nums"]["start"] for each in images] == [1, 2]
        json.dumps(documents)
        for name, document in documents:
            schema_validators[DocumentNames[name]].validate(document)
        assert first[f"{camera.name}_frame"] < second[f"{camera.name}_frame"]
        assert first[f"{camera.name}_fibres"] > 0
        assert first[f"{camera.name}_fibre_length_um"] > 500.0
        with pytest.raises(cosmic.ConfigError):
            camera.plan_images(tmp_path, suffix=".jpg")
        camera.plan_images()
        assert f"{camera.name}_file" not in camera.describe()
        status = camera.trigger()
    assert status.exception(5.0) is None or isinstance(status.exception(), cosmic.CosmicError)


def test_a_plan_paused_between_trigger_and_reading_has_one_image_a_point(
    engine: RunEngine, documents: Documents, tmp_path: Path
) -> None:
    with cosmic.connect(applications=("vico",), rate=4.0) as rig:
        camera = rig.vico.camera()
        camera.plan_images(tmp_path)

        def plan() -> Iterator[Any]:
            yield from bps.stage(camera)
            yield from bps.open_run()
            for point in range(3):
                yield from bps.checkpoint()
                yield from bps.create()
                yield from bps.trigger(camera, wait=True)
                if point < 2 and len(list(tmp_path.glob("*.tif"))) == 2 * point + 1:
                    yield from bps.pause()
                yield from bps.read(camera)
                yield from bps.save()
            yield from bps.close_run()

        with pytest.raises(RunEngineInterrupted):
            engine(plan())
        with pytest.raises(RunEngineInterrupted):
            engine.resume()
        engine.resume()
        kept = [Path(each[f"{camera.name}_file"]) for each in events(documents)]
        assert [each.name[-9:] for each in kept] == ["00002.tif", "00004.tif", "00005.tif"]
        told = [document for name, document in documents if name.startswith("stream_")]
        (folder, *images) = told
        names = [folder["parameters"]["template"].format(n["indices"]["start"]) for n in images]
        assert names == [each.name for each in kept]
        assert [each["seq_nums"]["start"] for each in images] == [1, 2, 3]


def test_images_kept_as_png_are_named_by_their_paths_alone(
    engine: RunEngine, documents: Documents, tmp_path: Path
) -> None:
    with cosmic.connect(rate=4.0) as rig:
        camera = rig.vico.camera()
        camera.plan_images(tmp_path, suffix=".png")
        engine(scan([camera], rig.mico["right.x"], 0.0, 20.0, 2))
    told = [name for name, _ in documents if name.startswith("stream_")]
    assert told == [], "what writes documents into tiled takes no PNG, and ends the plan"
    (descriptor,) = (document for name, document in documents if name == "descriptor")
    assert not any("external" in each for each in descriptor["data_keys"].values())
    kept = [Path(each[f"{camera.name}_file"]) for each in events(documents)]
    assert [each.suffix for each in kept] == [".png", ".png"]
    assert all(each.is_file() for each in kept)
