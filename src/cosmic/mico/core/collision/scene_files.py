"""Reading the files of a scene: size first, then content, then its hash."""

import hashlib
from collections.abc import Mapping
from pathlib import Path

from cosmic.mico.core.collision.scene_findings import Findings


class SceneFiles:
    """Reads files at most once each, and none that is too large.

    Parameters
    ----------
    folder : Path
        Where the names of `hashes` count from.
    hashes : mapping of str
        SHA-256 of a file, hexadecimal, by its name.
    """

    def __init__(
        self, folder: Path, limit_bytes: int, hashes: Mapping[str, str], findings: Findings
    ) -> None:
        self._limit_bytes = limit_bytes
        self._findings = findings
        self._names = {(folder / name).resolve(): name for name in hashes}
        self._hashes = hashes
        self._read: dict[Path, bytes | None] = {}

    def read(self, path: Path, asked_by: str) -> bytes | None:
        """Return the content, None where that failed; `asked_by` is who named the file."""
        whole = path.resolve()
        if whole not in self._read:
            self._read[whole] = self._read_once(path, asked_by)
        return self._read[whole]

    def check_hashes_used(self, where: Path) -> None:
        """Warn of hashes of files that nothing reads."""
        for path, name in self._names.items():
            if path not in self._read:
                self._findings.odd(where, f"sha256: {name!r} is not a file of this scene")

    def _read_once(self, path: Path, asked_by: str) -> bytes | None:
        try:
            if not path.is_file():
                kind = "is not a file" if path.exists() else "there is no such file"
                self._findings.wrong(asked_by, f"{path}: {kind}")
                return None
            size = path.stat().st_size
            if size > self._limit_bytes:
                self._findings.wrong(
                    asked_by,
                    f"{path}: {size} bytes are too many, at most {self._limit_bytes} are read; "
                    "reduce its triangles, or raise limits.file_bytes",
                )
                return None
            content = path.read_bytes()
        except (OSError, ValueError) as exc:
            self._findings.wrong(asked_by, f"{path}: cannot be read: {exc}")
            return None
        return content if self._hash_fits(path, content) else None

    def _hash_fits(self, path: Path, content: bytes) -> bool:
        name = self._names.get(path.resolve())
        if name is None:
            return True
        found = hashlib.sha256(content).hexdigest()
        if found == self._hashes[name].strip().lower():
            return True
        self._findings.wrong(
            path, f"its content has changed: sha256 is {found}; check it, then correct [sha256]"
        )
        return False
