"""`PlanCamera`: a camera as plans of bluesky read it; a part of `CameraHandle`."""

import math
import re
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from uuid import uuid4

from cosmic.frame.arguments import checked_class
from cosmic.frame.clock import Clock
from cosmic.frame.errors import ConfigError, NotAvailable, RecordingExistsError
from cosmic.frame.file_names import check_directory
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.plan_shape import (
    DataKey,
    DataKeys,
    PlanStatus,
    Readings,
    number_key,
    text_key,
    unix_now_s,
    unix_of_platform_s,
    whole_key,
)
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.recording.snap import save_image
from cosmic.vico.hw.interface import CameraInfo, CameraSettings, Trigger

if TYPE_CHECKING:
    from cosmic.vico.api.coordinate_transform import CoordinateTransform
    from cosmic.vico.api.fibres import PlacedFibre

ARRAY_SUFFIXES: Final = (".tif", ".tiff")
"""Images of these are told of as an array; what reads documents takes no PNG, and raises."""
SUFFIXES: Final = (*ARRAY_SUFFIXES, ".png")
WAIT_S: Final = 5.0
StreamAsset = tuple[str, dict[str, Any]]
"""Name and content of a document of bluesky."""
# Of the longest fibre, as `PlacedFibre` names them, with their units.
MEASURES: Final[Mapping[str, str]] = {"length_um": "um", "width_um": "um", "curl": ""}


@checked_class
class PlanCamera:
    """Readable, Configurable, Triggerable, Stageable and WritesExternalAssets, without bluesky.

    Images that are kept as TIFF reach what reads documents, such as tiled, as a stream resource of
    files; of a PNG its path alone. Any thread.
    """

    parent: None = None
    name: str
    _folder: Path | None = None
    _suffix = ".tif"
    _fibres = False
    _number = 0
    _last: tuple[Readings, float] | None = None
    _assets: tuple[StreamAsset, ...] = ()
    _resource = ""

    # What it is the shape of

    @property
    @abstractmethod
    def info(self) -> CameraInfo | None:
        """Which camera it is; None while none is connected."""

    @property
    @abstractmethod
    def settings(self) -> CameraSettings | None:
        """What is in force, as read back; None while it is not connected."""

    @abstractmethod
    def next_image(self, timeout_s: float = 5.0, since_s: float | None = None) -> CameraImage:
        """Wait for a whole image exposed from `since_s` of platform time on."""

    @abstractmethod
    def triggered_image(self, timeout_s: float = 5.0) -> CameraImage:
        """Give the software trigger and wait for its image."""

    @abstractmethod
    def now_s(self) -> float:
        """Return the time by which images are dated."""

    @property
    @abstractmethod
    def _newest(self) -> CameraImage | None:
        """The newest image; None before the first."""

    @property
    @abstractmethod
    def _clock(self) -> Clock:
        """The platform's."""

    @property
    @abstractmethod
    def _jobs(self) -> JobQueue:
        """Takes the images."""

    @property
    @abstractmethod
    def _axes(self) -> Mapping[str, str]:
        """Unit of each axis whose position comes with the images."""

    @property
    @abstractmethod
    def _transform(self) -> "CoordinateTransform | None":
        """What joins pixels and platform."""

    # Plans

    def plan_images(
        self, folder: str | Path | None = None, *, suffix: str = ".tif", fibres: bool = False
    ) -> None:
        """Say what a trigger does with its image, and so what `read` returns.

        Parameters
        ----------
        folder : path or None
            Where each image goes, into a file of its own; None keeps none.
        suffix : str
            ".tif" or ".png"; images of a PNG are no array in tiled, their paths are there.
        fibres : bool
            Find the fibres on each and measure the longest.

        Raises
        ------
        ConfigError
            There is no such suffix.
        RecordingError
            There is no such folder, or nothing can be written to it.
        """
        if suffix not in SUFFIXES:
            raise ConfigError(f"{suffix!r}: an image is one of {', '.join(SUFFIXES)}")
        chosen = None if folder is None else check_directory(Path(folder).absolute())
        self._assets, self._resource = (), ""
        self._folder, self._suffix, self._fibres, self._last = chosen, suffix, fibres, None
        self._number = 0 if chosen is None else _last_number(chosen, self.name)

    def stage(self) -> "list[PlanCamera]":
        """Begin a run of plans: its images are a resource of their own."""
        self._assets, self._resource = (), ""
        return [self]

    def unstage(self) -> "list[PlanCamera]":
        """End it; the camera stays as it is."""
        self._assets, self._resource = (), ""
        return [self]

    def collect_asset_docs(self, index: int | None = None) -> Iterator[StreamAsset]:
        """Yield the documents of the image that was kept last, once, in bluesky's terms.

        Parameters
        ----------
        index : int or None
            Bluesky's; each image is told of with the event it belongs to, and no other.
        """
        del index
        found, self._assets = self._assets, ()
        yield from found

    def trigger(self) -> PlanStatus:
        """Begin to take an image exposed after this call; the status ends when all is done.

        With the software trigger chosen, it is given. The status fails with `NotAvailable` where no
        image comes in time, and with `RecordingError` where it cannot be kept.
        """
        status = PlanStatus(f"image of {self.name}")
        since_s = self.now_s()
        self._jobs.put(lambda: self._take(since_s), status)
        return status

    def _take(self, since_s: float) -> None:
        settings = self.settings
        timeout_s = WAIT_S + 2.0 * (settings.exposure_s if settings is not None else 0.0)
        if settings is not None and settings.trigger is Trigger.SOFTWARE:
            image = self.triggered_image(timeout_s)
        else:
            image = self.next_image(timeout_s, since_s)
        when_s = unix_of_platform_s(self._clock, image.frame.exposed_s)
        self._last = self._readings(image, when_s), when_s

    def _readings(self, image: CameraImage, when_s: float) -> Readings:
        scale = image.circumstances.scale_um_px
        values: dict[str, object] = {
            "frame": image.frame.frame_id,
            "mean": float(image.data.mean()),
            "scale_um_px": math.nan if scale is None else scale,
        }
        if self._folder is not None:
            path = self._save(image, self._folder)
            values["file"] = str(path)
            if self._suffix in ARRAY_SUFFIXES:
                # One that no event took, as before a pause, would stand for a second point.
                folder = [each for each in self._assets if each[0] == "stream_resource"]
                self._assets = (*folder, *self._documents(path))
        if self._fibres:
            values |= self._measured(image)
        return {
            f"{self.name}_{key}": {"value": value, "timestamp": when_s}
            for key, value in values.items()
        }

    def _save(self, image: CameraImage, folder: Path) -> Path:
        axes = self._axes
        while True:
            self._number += 1
            path = folder / f"{self.name}_{self._number:05d}{self._suffix}"
            try:
                return save_image(image, path, axes=axes)
            except RecordingExistsError:
                continue  # somebody else put it there meanwhile: never replaced

    def _documents(self, path: Path) -> Iterator[StreamAsset]:
        """Yield what tells of one more file; the first of a run tells of the folder before it."""
        if not self._resource:
            self._resource = str(uuid4())
            yield (
                "stream_resource",
                {
                    "uid": self._resource,
                    "data_key": f"{self.name}_image",
                    "mimetype": "multipart/related;type=image/tiff",
                    "uri": f"{path.parent.as_uri().replace('file:///', 'file://localhost/')}/",
                    "parameters": {
                        "chunk_shape": [1],
                        "template": f"{self.name}_{{:05d}}{self._suffix}",
                        "join_method": "stack",
                    },
                },
            )
        numbers = {"start": self._number, "stop": self._number + 1}
        yield (
            "stream_datum",
            {
                "uid": f"{self._resource}/{self._number}",
                "stream_resource": self._resource,
                "descriptor": "",  # these two are for whoever bundles the event to say
                "seq_nums": {"start": 0, "stop": 0},
                "indices": numbers,
            },
        )

    def _measured(self, image: CameraImage) -> dict[str, object]:
        # Imported here: it loads OpenCV and scipy.
        from cosmic.vico.api.fibres import locate_fibres

        found = locate_fibres(image, self._transform)
        longest = max(found, key=lambda each: each.length_px, default=None)
        return {
            "fibres": len(found),
            **{f"fibre_{key}": _number(longest, key) for key in MEASURES},
            "fibre_certain": int(longest is not None and longest.certain),
        }

    def read(self) -> Readings:
        """Return what the last trigger gave.

        Raises
        ------
        NotAvailable
            Nothing has triggered it since `plan_images`.
        """
        if self._last is None:
            raise NotAvailable(f"{self.name}: there is no image to read; trigger it first")
        return dict(self._last[0])

    def describe(self) -> DataKeys:
        """Return what `read` returns, in bluesky's terms; it follows `plan_images`.

        Images that are kept as TIFF are described as well; `collect_asset_docs` tells where.
        """
        source = self._source
        keys = {
            "frame": whole_key(source),
            "mean": number_key(source),
            "scale_um_px": number_key(source, "um/px"),
        }
        if self._folder is not None:
            keys["file"] = text_key(source)
            if self._suffix in ARRAY_SUFFIXES:
                keys["image"] = self._image_key()
        if self._fibres:
            keys["fibres"] = whole_key(source)
            for key, unit in MEASURES.items():
                keys[f"fibre_{key}"] = number_key(source, unit)
            keys["fibre_certain"] = whole_key(source)
        return {f"{self.name}_{key}": value for key, value in keys.items()}

    def _image_key(self) -> DataKey:
        shown = self._newest
        shape = (0, 0) if shown is None else shown.data.shape
        kind = "|u1" if shown is None else shown.data.dtype.str
        return {
            "source": self._source,
            "dtype": "array",
            "shape": [int(each) for each in shape],
            "dtype_numpy": kind,
            "external": "STREAM:",
        }

    def read_configuration(self) -> Readings:
        """Return exposure, gain, binning and trigger; NaN, 0 and empty without a camera."""
        settings, now_s = self.settings, unix_now_s()
        values: dict[str, object] = {
            "exposure_s": settings.exposure_s if settings is not None else math.nan,
            "gain_db": settings.gain_db if settings is not None else math.nan,
            "binning": settings.binning if settings is not None else 0,
            "trigger": str(settings.trigger) if settings is not None else "",
        }
        return {
            f"{self.name}_{key}": {"value": value, "timestamp": now_s}
            for key, value in values.items()
        }

    def describe_configuration(self) -> DataKeys:
        """Return what `read_configuration` returns, in bluesky's terms."""
        source = self._source
        return {
            f"{self.name}_exposure_s": number_key(source, "s"),
            f"{self.name}_gain_db": number_key(source, "dB"),
            f"{self.name}_binning": whole_key(source),
            f"{self.name}_trigger": text_key(source),
        }

    @property
    def hints(self) -> dict[str, list[str]]:
        """Which of its readings a plot shows: the length of the fibre, or the mean grey value."""
        return {"fields": [f"{self.name}_{'fibre_length_um' if self._fibres else 'mean'}"]}

    @property
    def _source(self) -> str:
        info = self.info
        return f"camera:{info.key if info is not None else self.name}"


def _number(fibre: "PlacedFibre | None", key: str) -> float:
    value = getattr(fibre, key, None)
    return math.nan if value is None else float(value)


def _last_number(folder: Path, camera: str) -> int:
    """Return the highest number of an image of `camera` in a folder; 0 without any."""
    pattern = re.compile(rf"{re.escape(camera)}_(\d+)\.\w+")
    found = (pattern.fullmatch(path.name) for path in folder.iterdir())
    return max((int(match[1]) for match in found if match is not None), default=0)
