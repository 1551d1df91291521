"""Strict configuration: TOML read once at start into frozen models, every error named."""

import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Final, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from cosmic.frame.errors import ConfigError
from cosmic.frame.kept_file import open_file

M = TypeVar("M", bound="StrictModel")

_TOKEN: Final = re.compile(
    r"""(\btoken["']?\s*=\s*)(?:"{3}.*?"{3}|'{3}.*?'{3}|"(?:\\.|[^"\\\n])*"|'[^'\n]*')""",
    re.DOTALL,
)


class StrictModel(BaseModel):
    """Base of every configuration model: frozen; unknown and missing keys are errors."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, validate_default=True
    )


def shipped_config_dir() -> Path:
    """Return the folder with the configuration that ships with CoSMic."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "_config"
    return installed if installed.is_dir() else package.parents[1] / "config"


def user_file(name: str, folder: Path | None) -> Path | None:
    """Return where something of the user's is kept beside the platform file.

    None, for in memory only: without a name or a folder, or with the configuration that ships
    with CoSMic, which is nobody's to change.
    """
    if not name or folder is None or folder.resolve() == shipped_config_dir():
        return None
    return folder / name


def not_there(what: str, name: str, known: Iterable[str]) -> str:
    """Return what is said of a name that nothing has, with those that there are."""
    return f"there is no {what} {name!r}; there are {', '.join(known) or 'none'}"


def without_tokens(text: str) -> str:
    """Return TOML with empty tokens, to be kept where others read it; comments lose theirs too."""
    return _TOKEN.sub(r'\1""', text)


def read_toml(path: Path) -> dict[str, object]:
    """Read a TOML file.

    Raises
    ------
    ConfigError
        The file is missing, not readable, not UTF-8 or not TOML; the text says which and where.
    """
    try:
        with open_file(path) as file:
            return tomllib.load(file)
    except FileNotFoundError:
        raise ConfigError(f"{path}: there is no such file") from None
    except UnicodeDecodeError as exc:
        raise ConfigError(f"{path}: not UTF-8 text ({exc.reason} at byte {exc.start})") from exc
    except tomllib.TOMLDecodeError as exc:
        raise ConfigError(f"{path}: not valid TOML: {exc}") from exc
    except ValueError as exc:  # more digits than Python makes a number of
        raise ConfigError(f"{path}: not read: {str(exc).partition(';')[0]}") from None
    except RecursionError:
        raise ConfigError(f"{path}: not read: its arrays or tables lie too deep") from None
    except OSError as exc:
        raise ConfigError(f"{path}: cannot be read: {exc.strerror or exc}") from exc


def load_model(path: Path, model: type[M]) -> M:
    """Read `path` into `model`.

    Raises
    ------
    ConfigError
        One line per wrong, missing or unknown key, each with file, key and reason.
    """
    return check_model(path, read_toml(path), model)


def check_model(path: Path | str, data: object, model: type[M], *, under: str = "") -> M:
    """Return what was read from `path`, or the table `under` of it, as `model`.

    Raises
    ------
    ConfigError
        As `load_model` does.
    """
    try:
        return model.model_validate(data)
    except ValidationError as exc:
        raise ConfigError("\n".join(_lines(path, exc, under))) from None


def wrong_values(error: ValidationError) -> str:
    """Return what is wrong with values that a call was given: name, what fits, what was given."""
    return "; ".join(_wrong(item) for item in error.errors(include_url=False))


def _wrong(item: ErrorDetails) -> str:
    reason = _reason(item["type"], item["msg"])
    if item["type"] == "value_error" or not item["loc"]:
        return reason
    if item["type"] in {"missing", "extra_forbidden"}:
        return f"{_key(item['loc'])}: {reason}"
    return f"{_key(item['loc'])} {reason.removeprefix('Input ')}, not {item['input']!r}"


def _lines(path: Path | str, error: ValidationError, under: str) -> list[str]:
    table = (under,) if under else ()
    return [
        f"{path}: {_key(table + item['loc'])}: {_reason(item['type'], item['msg'])}{_given(item)}"
        for item in error.errors(include_url=False)
    ]


def _key(loc: tuple[int | str, ...]) -> str:
    key = ""
    for part in loc:
        key += f"[{part}]" if isinstance(part, int) else f".{part}" if key else part
    return key or "(file)"


def _reason(kind: str, message: str) -> str:
    if kind == "extra_forbidden":
        return "unknown key; is it misspelt?"
    if kind == "missing":
        return "key is missing"
    return message.removeprefix("Value error, ")


def _given(item: ErrorDetails) -> str:
    """Say what the file has there, where that is a plain value."""
    value = item["input"]
    explained = item["type"] in ("missing", "extra_forbidden", "value_error")
    if explained or not isinstance(value, (str, int, float, bool)):
        return ""
    return f"; the file has {value!r}"
