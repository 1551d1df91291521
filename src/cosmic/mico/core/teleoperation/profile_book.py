"""Profiles of teleoperation: those of the platform file, and what the operator changed."""

import logging
from collections.abc import Mapping
from pathlib import Path
from threading import RLock
from typing import Annotated, Final

from pydantic import Field, ValidationError

from cosmic.frame.config import StrictModel, load_model
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.frame.kept_file import toml_lines, write_whole
from cosmic.mico.core.teleoperation.settings import (
    TeleoperationProfileSettings,
    TeleoperationSettings,
)

logger = logging.getLogger(__name__)

HEAD: Final = "# Profiles of teleoperation that differ from those of the platform file.\n"


class _Kept(StrictModel):
    profile: Annotated[tuple[TeleoperationProfileSettings, ...], Field(strict=False)] = ()


class ProfileBook:
    """The profiles of a platform; any thread.

    Parameters
    ----------
    settings : TeleoperationSettings
        With the profiles of the platform file.
    path : Path or None
        Where changed profiles are kept; None: until the program ends. Made with the first change.

    Raises
    ------
    ConfigError
        The file is there and wrong.
    """

    def __init__(self, settings: TeleoperationSettings, path: Path | None = None) -> None:
        self._path = path
        self._guard = RLock()
        self._given = {each.name: each for each in settings.profile}
        self._profiles = self._given | self._in_file()
        self._changed_here: set[str] = set()

    @property
    def path(self) -> Path | None:
        """The file with the changed ones; None while they are kept in memory only."""
        return self._path

    @property
    def profiles(self) -> tuple[TeleoperationProfileSettings, ...]:
        """All as they are now: those of the platform file first."""
        with self._guard:
            return tuple(self._profiles.values())

    def __getitem__(self, name: str) -> TeleoperationProfileSettings:
        with self._guard:
            found = self._profiles.get(name)
            known = ", ".join(self._profiles) or "none"
        if found is None:
            raise NotAvailable(f"there is no teleoperation profile {name!r}; there are: {known}")
        return found

    def misfits(self, kinds: Mapping[str, str]) -> list[str]:
        """Return what of the changed profiles does not fit the positioners there are.

        Parameters
        ----------
        kinds : mapping of str
            "linear", "rotary" or "open-loop" of every positioner, by name.
        """
        changed = [each for each in self.profiles if each != self._given.get(each.name)]
        return [text for each in changed for text in each.mistakes(kinds)]

    def given(self, name: str) -> TeleoperationProfileSettings:
        """Return a profile as the platform file has it.

        Raises
        ------
        NotAvailable
            The platform file has none of that name.
        """
        if name not in self._given:
            raise NotAvailable(f"the platform file has no teleoperation profile {name!r}")
        return self._given[name]

    def edited_axis(
        self, name: str, index: int, changes: Mapping[str, object]
    ) -> TeleoperationProfileSettings:
        """Return a profile with one row of its mapping changed; see `edited`."""
        rows = [each.model_dump() for each in self[name].axis]
        if not 0 <= index < len(rows):
            raise ConfigError(f"profile {name!r} has no row {index}")
        rows[index] |= changes
        return self.edited(name, {"axis": rows})

    def edited(self, name: str, changes: Mapping[str, object]) -> TeleoperationProfileSettings:
        """Return a profile with some keys changed; it is not kept yet.

        Raises
        ------
        NotAvailable
            There is none of that name.
        ConfigError
            A value is none that the key takes.
        """
        try:
            return TeleoperationProfileSettings.model_validate(
                {**self[name].model_dump(), **changes}
            )
        except ValidationError as exc:
            first = exc.errors(include_url=False)[0]
            where = ".".join(str(part) for part in first["loc"])
            raise ConfigError(f"profile {name!r}: {where}: {first['msg']}") from None

    def put(self, profile: TeleoperationProfileSettings) -> None:
        """Keep a profile, in the place of the one of its name.

        Where the file cannot be written it is kept in memory, and `path` is None from then on.
        """
        with self._guard:
            if self._profiles.get(profile.name) == profile:
                return
            self._profiles[profile.name] = profile
            self._changed_here.add(profile.name)
            self._write()

    def _in_file(self) -> dict[str, TeleoperationProfileSettings]:
        """Return what the file holds now; raises `ConfigError`."""
        path = self._path
        if path is None or not path.exists():
            return {}
        return {each.name: each for each in load_model(path, _Kept).profile}

    def _write(self) -> None:
        """Write what was changed here; the rest of the file stays as it is now."""
        path = self._path
        if path is None:
            return
        try:
            here = {name: self._profiles[name] for name in self._changed_here}
            profiles = (self._in_file() | here).items()
            changed = [each for name, each in profiles if each != self._given.get(name)]
            write_whole(path, HEAD + "".join(map(_section, changed)))
        except (OSError, ConfigError) as exc:
            self._path = None
            logger.warning("%s cannot be written (%s): profiles are kept in memory", path, exc)


def _section(profile: TeleoperationProfileSettings) -> str:
    whole = profile.model_dump(exclude_none=True)
    rows = whole.pop("axis")
    parts = ["\n[[profile]]\n", toml_lines(whole)]
    for row in rows:
        parts += ["\n[[profile.axis]]\n", toml_lines(row)]
    return "".join(parts)
