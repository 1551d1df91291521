"""What sweeps have taught of the blur, by camera and zoom: with it two images give the focus."""

from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Annotated, Final, Literal

from pydantic import Field

from cosmic.frame.config import StrictModel, load_model
from cosmic.frame.errors import ConfigError
from cosmic.frame.kept_file import toml_lines, write_whole
from cosmic.vico.core.defocus import DefocusModel

FILE: Final = "focus.toml"
SAME_ZOOM_COUNTS: Final = 20.0
HEAD: Final = """\
# How fast an image blurs with the focus, learned by the program's sweeps; in squared px for each
# squared count. Delete a [[blur]] section to have it learned anew.
"""


class _Blur(StrictModel):
    """Section ``[[blur]]``."""

    camera: str = Field(min_length=1)
    zoom_counts: float
    binning: int = Field(ge=1)
    growth_px2: float = Field(gt=0.0)
    growth_std_px2: float = Field(ge=0.0)


class _File(StrictModel):
    format: Literal[1]
    blur: Annotated[tuple[_Blur, ...], Field(strict=False)] = ()


@dataclass(frozen=True, slots=True)
class View:
    """Through what a camera looks while its blur is learned."""

    camera: str
    zoom_counts: float
    binning: int = 1

    def is_like(self, other: "View") -> bool:
        """Return whether the blur of one holds for the other."""
        same = (self.camera, self.binning) == (other.camera, other.binning)
        return same and abs(self.zoom_counts - other.zoom_counts) <= SAME_ZOOM_COUNTS


class FocusModels:
    """The models that are known; any thread.

    Nothing is kept beyond the end of the program until `keep_in` says where.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._known: dict[View, DefocusModel] = {}
        self._path: Path | None = None

    def keep_in(self, folder: Path) -> None:
        """Read what is kept in a folder, and keep there what is learned.

        Raises
        ------
        ConfigError
            The file is broken; the text names the key.
        """
        path = folder / FILE
        kept = load_model(path, _File).blur if path.exists() else ()
        with self._lock:
            self._path = path
            for each in kept:
                view = View(each.camera, each.zoom_counts, each.binning)
                self._known[view] = DefocusModel(each.growth_px2, each.growth_std_px2)

    def find(self, view: View) -> DefocusModel | None:
        """Return the model for a view; None where none was learned."""
        with self._lock:
            like = [each for each in self._known if each.is_like(view)]
            near = min(
                like, key=lambda each: abs(each.zoom_counts - view.zoom_counts), default=None
            )
            return None if near is None else self._known[near]

    def learn(self, view: View, model: DefocusModel) -> None:
        """Keep a model in place of what was known for this view; raises `ConfigError`."""
        with self._lock:
            self._known = {key: each for key, each in self._known.items() if not key.is_like(view)}
            self._known[view] = model
            if self._path is None:
                return
            parts = [HEAD, toml_lines({"format": 1})]
            for key, each in self._known.items():
                values = {
                    "camera": key.camera,
                    "zoom_counts": float(key.zoom_counts),
                    "binning": key.binning,
                    "growth_px2": each.growth,
                    "growth_std_px2": each.growth_std,
                }
                parts.append("\n[[blur]]\n" + toml_lines(values))
            try:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                write_whole(self._path, "".join(parts))
            except OSError as exc:
                raise ConfigError(
                    f"{self._path}: cannot be written: {exc.strerror or exc}"
                ) from exc
