"""Films, folders of images and addresses through OpenCV."""

import struct
import zlib
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from contract.cameras.mjpeg_server import MjpegServer
from contract.cameras.opencv import HEIGHT, WIDTH, pattern, write_film, write_images
from cosmic.frame.clock import ManualClock, RatedClock
from cosmic.frame.errors import DeviceError, NotConnectedError
from cosmic.vico.hw.interface import Frame, PixelFormat, Roi, VideoSource
from cosmic.vico.hw.opencv import OpenCvCamera, OpenCvLibrary


def opened(source: VideoSource, clock: ManualClock | None = None) -> OpenCvCamera:
    return OpenCvLibrary(clock or ManualClock(), sources=[source]).open(source.address)


def all_of(camera: OpenCvCamera) -> list[Frame]:
    frames = []
    while (frame := camera.receive(0.0)) is not None:
        frames.append(frame)
    return frames


@pytest.mark.parametrize("ending", ["avi", "mkv"])
def test_a_lossless_film_gives_its_images_bit_by_bit(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"film.{ending}"
    write_film(path, 12)
    camera = opened(VideoSource(str(path), paced=False))
    camera.configure(replace(camera.settings, pixel_format=PixelFormat.MONO8))
    camera.start()
    frames = all_of(camera)
    assert [frame.frame_id for frame in frames] == list(range(12))
    for number, frame in enumerate(frames):
        assert np.array_equal(frame.data, pattern(number))
    camera.close()


def test_a_lossy_film_plays_too(tmp_path: Path) -> None:
    write_film(tmp_path / "film.avi", 5, codec="MJPG")
    camera = opened(VideoSource(str(tmp_path / "film.avi"), paced=False))
    camera.start()
    assert len(all_of(camera)) == 5
    camera.close()


def test_a_film_is_played_at_its_own_rate_on_the_platforms_clock(tmp_path: Path) -> None:
    write_film(tmp_path / "film.mkv", 12, rate_hz=50.0)
    clock = ManualClock()
    camera = opened(VideoSource(str(tmp_path / "film.mkv")), clock)
    assert camera.settings.rate_hz == 50.0
    camera.start()
    assert camera.receive(0.0) is None
    clock.advance(0.0601)
    frames = all_of(camera)
    assert [frame.time_s for frame in frames] == pytest.approx([0.02, 0.04, 0.06])
    assert [frame.exposed_s for frame in frames] == pytest.approx([0.0, 0.02, 0.04])
    camera.configure(replace(camera.settings, rate_hz=10.0))
    clock.advance(0.09)
    assert not all_of(camera)
    clock.advance(0.02)
    assert len(all_of(camera)) == 1
    camera.close()


def test_at_its_end_a_film_gives_nothing_more_and_a_loop_begins_anew(tmp_path: Path) -> None:
    write_images(tmp_path / "pictures", 3)
    for loop, expected in ((False, [0, 1, 2]), (True, [0, 1, 2, 0, 1])):
        camera = opened(VideoSource(str(tmp_path / "pictures"), loop=loop, paced=False))
        camera.start()
        frames = [camera.receive(0.0) for _ in range(5)]
        seen = [frame.data for frame in frames if frame is not None]
        assert len(seen) == len(expected)
        for data, number in zip(seen, expected, strict=True):
            assert np.array_equal(data, pattern(number))
        camera.stop()
        camera.start()
        assert camera.receive(0.0) is not None
        camera.close()


def test_images_come_in_the_order_of_their_names_and_other_files_are_left_out(
    tmp_path: Path,
) -> None:
    write_images(tmp_path / "p", 11)
    (tmp_path / "p" / "notes.txt").write_text("nothing to see")
    camera = opened(VideoSource(str(tmp_path / "p"), rate_hz=7.0, paced=False))
    assert camera.settings.rate_hz == 7.0
    camera.start()
    frames = all_of(camera)
    assert len(frames) == 11
    assert np.array_equal(frames[10].data, pattern(10))
    camera.close()


def test_images_of_16_bits_stay_so_and_can_be_had_in_8(tmp_path: Path) -> None:
    deep = pattern(0).astype(np.uint16) * 257
    cv2.imwrite(str(tmp_path / "a.tif"), deep)
    camera = opened(VideoSource(str(tmp_path), paced=False))
    assert camera.ranges.pixel_formats == (PixelFormat.MONO16, PixelFormat.MONO8)
    for pixel_format, wanted in ((PixelFormat.MONO16, deep), (PixelFormat.MONO8, pattern(0))):
        camera.configure(replace(camera.settings, pixel_format=pixel_format))
        camera.start()
        frame = camera.receive(0.0)
        assert frame is not None
        assert np.array_equal(frame.data, wanted)
        camera.stop()
    camera.close()


def test_red_is_the_first_layer_and_a_roi_is_cut_out(tmp_path: Path) -> None:
    blue_green_red = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    blue_green_red[20, 30] = (1, 2, 3)
    cv2.imwrite(str(tmp_path / "a.png"), blue_green_red)
    camera = opened(VideoSource(str(tmp_path), paced=False))
    camera.configure(replace(camera.settings, roi=Roi(30, 20, 8, 4)))
    camera.start()
    frame = camera.receive(0.0)
    assert frame is not None
    assert frame.data.shape == (4, 8, 3)
    assert frame.data[0, 0].tolist() == [3, 2, 1]
    camera.close()


def test_what_is_no_film_is_named_with_the_reason(tmp_path: Path) -> None:
    (tmp_path / "film.mkv").write_bytes(b"this is no film" * 100)
    (tmp_path / "empty").mkdir()
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "a.png").write_bytes(b"no image")
    for name, reason in (
        ("film.mkv", "no images"),
        ("empty", "holds no images"),
        ("broken", "not an image of 8 or 16 bits"),
        ("gone.mkv", "cannot open a camera"),
    ):
        with pytest.raises(NotConnectedError, match=reason):
            opened(VideoSource(str(tmp_path / name)))


def boundless_png() -> bytes:
    """Return a PNG whose head says that it has more pixels than OpenCV takes."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        check = struct.pack(">I", zlib.crc32(kind + body))
        return struct.pack(">I", len(body)) + kind + body + check

    head = struct.pack(">IIBBBBB", 100_000, 100_000, 8, 0, 0, 0, 0)
    body = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(bytes(100)))
    return b"\x89PNG\r\n\x1a\n" + body + chunk(b"IEND", b"")


def test_an_image_that_opencv_fails_at_is_named_at_the_beginning_and_later(tmp_path: Path) -> None:
    (tmp_path / "b.png").write_bytes(boundless_png())
    with pytest.raises(NotConnectedError, match=r"b\.png: it is not an image"):
        opened(VideoSource(str(tmp_path)))
    cv2.imwrite(str(tmp_path / "a.png"), pattern(0))
    camera = opened(VideoSource(str(tmp_path), paced=False))
    camera.start()
    assert camera.receive(0.0) is not None
    with pytest.raises(DeviceError, match=r"b\.png: it cannot be decoded"):
        camera.receive(0.0)
    camera.close()


def test_an_image_of_another_size_ends_the_reception(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), pattern(0))
    cv2.imwrite(str(tmp_path / "b.png"), pattern(0)[:50])
    camera = opened(VideoSource(str(tmp_path), paced=False))
    camera.start()
    camera.receive(0.0)
    for _ in range(2):  # nothing more comes from it
        with pytest.raises(DeviceError, match="160 x 50 px came"):
            camera.receive(0.0)
    camera.close()


def test_a_path_opens_without_being_listed_and_is_played_again_and_again(tmp_path: Path) -> None:
    write_film(tmp_path / "film.mkv", 3, rate_hz=50.0)
    clock = ManualClock()
    library = OpenCvLibrary(clock)
    camera = library.open(str(tmp_path / "film.mkv"))
    camera.start()
    clock.advance(0.2001)
    assert len(all_of(camera)) == 10
    library.close()


def test_an_address_that_does_not_answer_says_so_soon() -> None:
    server = MjpegServer([pattern(0)])
    server.close()
    with pytest.raises(NotConnectedError, match="network address does not open"):
        opened(VideoSource(server.address))


def test_images_of_an_address_are_new_at_every_start() -> None:
    flat = [np.full((48, 64), level, np.uint8) for level in range(0, 250, 5)]
    server = MjpegServer(flat, rate_hz=100.0)
    try:
        camera = OpenCvLibrary(RatedClock()).open(server.address)
        for _ in range(2):
            camera.start()
            first, *_, last = (camera.receive(2.0) for _ in range(25))
            assert first is not None and last is not None
            # The server begins anew with each line.
            assert first.data.mean() < 50.0 < 100.0 < last.data.mean()
            camera.stop()
        camera.close()
    finally:
        server.close()
