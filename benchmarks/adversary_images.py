"""The way in of ViCo: what a hostile program does to cameras, lens and lamp, drawn at random."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from benchmarks.adversary_attacks import NONSENSE, Attack
from cosmic.app.rig import Rig
from cosmic.frame.operation import Task
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.hw.interface import CameraSettings, Roi, Trigger

BEGUN: Final = 8
"""So many operations are remembered, to be cancelled."""


class ImageAttack(Attack):
    """Images, settings and recordings; and what moves: lens, clicks, and calibrations by tools."""

    def __init__(self, rig: Rig, seed: int, folder: Path, name: str = "images") -> None:
        super().__init__(name, seed, 0.02)
        self._vico = rig.vico
        self._folder = folder
        self._begun: list[Task] = []
        self.acts = [
            (3, self._start), (1, self._stop), (3, self._configure), (2, self._image),
            (0.3, self._fibres), (2, self._switch), (1, self._background),
            (1, self._record), (1, self._end_record), (0.5, self._time_lapse), (0.5, self._snap),
            (3, self._lens), (0.5, self._focus), (2, self._lamp), (1, self._abort),
            (6, self._click), (1, self._calibrate), (0.5, self._rotation), (2, self._cancel),
            (4, self._nonsense),
        ]  # fmt: skip

    @property
    def _camera(self) -> CameraHandle:
        return self._vico.camera(self.chance.choice(list(self._vico.cameras)))

    def _begin(self, task: Task) -> None:
        self._begun = [*self._begun[1 - BEGUN :], task]

    def _cancel(self) -> None:
        if self._begun:
            self.chance.choice(self._begun).cancel()

    # Images

    def _start(self) -> None:
        self._begin(self._camera.start())

    def _stop(self) -> None:
        self._begin(self._camera.stop())

    def _configure(self) -> None:
        camera = self._camera
        now = camera.settings
        if now is not None:
            self._begin(camera.configure(self._hostile(now)))

    def _hostile(self, now: CameraSettings) -> CameraSettings:
        def size() -> int:
            return self.chance.choice((64, 640, 1281, 0, -8, 2**31))

        change: dict[str, Any] = self.chance.choice(
            (
                {"exposure_s": self.chance.choice((1e-3, 0.01, 0.0, -1.0, float("nan")))},
                {"rate_hz": self.chance.choice((5.0, 30.0, 1e9, 0.0))},
                {"roi": Roi(size(), size(), size(), size())},
                {"binning": self.chance.choice((1, 2, 3, 0))},
                {"trigger": self.chance.choice(tuple(Trigger))},
                {"trigger": Trigger.FREE_RUN},
            )
        )
        return replace(now, **change)

    def _image(self) -> None:
        self._camera.next_image(self.chance.choice((0.0, 0.05, 0.3)))

    def _fibres(self) -> None:
        self._vico.find_fibres(timeout_s=0.3)

    def _switch(self) -> None:
        camera = self._camera
        known = [each.name for each in camera.algorithms]
        camera.switch(self.chance.choice([*known, "nothing"]), on=self.chance.random() < 0.5)

    def _background(self) -> None:
        camera = self._camera
        self.chance.choice((camera.set_background, camera.clear_background))()

    # Files

    def _path(self, suffix: str) -> Path:
        return self.chance.choice((self._folder / f"hostile{suffix}", Path("/nowhere/x" + suffix)))

    def _record(self) -> None:
        form = self.chance.choice(("ffv1", "tiff", "hdf5", "gif"))
        self._camera.record(self._path(".mkv"), form, overwrite=True)

    def _end_record(self) -> None:
        self._camera.stop_recording()

    def _time_lapse(self) -> None:
        period_s = self.chance.choice((0.1, 0.0, -1.0, 1e9))
        self._begin(self._camera.time_lapse(self._path(".tiff"), interval_s=period_s, count=3))

    def _snap(self) -> None:
        self._begin(self._camera.snap(self._path(".png"), overwrite=True))

    # What moves

    def _lens(self) -> None:
        lens = self._vico.lens
        if lens is not None:
            counts = self.chance.choice((0, 3000, 60_000, -5, 2**40))
            move = self.chance.choice((lens.seek_zoom, lens.seek_focus, lambda _: lens.home()))
            self._begin(move(counts))

    def _focus(self) -> None:
        if self._vico.lens is not None:
            self._begin(self._vico.lens.autofocus())

    def _lamp(self) -> None:
        if self._vico.light is not None:
            self._begin(self._vico.light.dim(self.chance.choice((0.0, 40.0, 100.0, 101.0, -1.0))))

    def _abort(self) -> None:
        if self._vico.lens is not None:
            self._vico.lens.abort()

    def _click(self) -> None:
        camera = self._camera
        point_px = (self.chance.uniform(-50.0, 1400.0), self.chance.uniform(-50.0, 1100.0))
        camera.click_to_move(point_px, self.chance.choice([*camera.targets, "nobody"]))

    def _calibrate(self) -> None:
        self._begin(self._vico.calibrate_stage(self.chance.choice([*self._vico.tools, "nobody"])))

    def _rotation(self) -> None:
        self._begin(self._vico.find_rotation_centre())

    def _nonsense(self) -> None:
        value, camera, lens, light = (
            self.chance.choice(NONSENSE), self._camera, self._vico.lens, self._vico.light,
        )  # fmt: skip
        calls: list[Callable[[Any], object]] = [
            camera.configure,
            camera.next_image,
            camera.snap,
            lambda it: camera.record(it, it),
            lambda it: camera.switch(it, on=it),
            lambda it: camera.click_to_move(it, it),
            lambda it: camera.click_to_move((it, it), "left"),
            lambda it: camera.click((1.0, it), (it, it), "left"),
            lambda it: camera.time_lapse(it, interval_s=it, count=it),
            self._vico.calibrate_stage,
            self._vico.camera,
        ]
        if lens is not None:
            calls += [lens.seek_zoom, lens.seek_focus, lens.zoom_to, lens.autofocus]
        if light is not None:
            calls += [light.dim, light.set_percent]
        self.chance.choice(calls)(value)
