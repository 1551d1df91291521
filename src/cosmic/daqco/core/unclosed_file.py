"""Reading an HDF5 file that its writer has not closed: it still writes, or was killed.

HDF5 itself opens such a file in SWMR mode alone, and that mode waits without end for metadata
that a lost tail or a power failure took. Here the file is shown to HDF5 as if it had been closed
in its present state. What is damaged then fails at once, what is being written this moment can be
tried again.
"""

import io
import os
import struct
from pathlib import Path
from typing import TYPE_CHECKING, Final

from typing_extensions import override

if TYPE_CHECKING:
    from typing_extensions import Buffer

SIGNATURE: Final = b"\x89HDF\r\n\x1a\n"
VERSION: Final = 3
LENGTH: Final = 48
FLAGS_AT: Final = 11
END_AT: Final = 28
CHECKSUM_AT: Final = 44
_MASK: Final = 0xFFFFFFFF


def is_unclosed(path: Path) -> bool:
    """Return whether `path` is an HDF5 file that was not closed, or is cut off.

    Raises
    ------
    OSError
        It cannot be read.
    """
    head, size = _looked_at(path)
    return is_recent(head) and (head[FLAGS_AT] != 0 or _end(head) > size)


def missing_bytes(path: Path) -> int:
    """Return how many bytes at least an HDF5 file has lost with its end; raises `OSError`."""
    head, size = _looked_at(path)
    return max(_end(head) - size, 0) if is_recent(head) else 0


def _looked_at(path: Path) -> tuple[bytes, int]:
    with path.open("rb") as file:
        return file.read(LENGTH), file.seek(0, os.SEEK_END)


def _end(head: bytes) -> int:
    (end,) = struct.unpack_from("<Q", head, END_AT)
    return int(end)


class UnclosedFile(io.RawIOBase):
    """The bytes of a file, with the head that it would have had it been closed now.

    Parameters
    ----------
    end : int or None
        Where it would end; where it does, if None.
    """

    def __init__(self, path: Path, end: int | None = None) -> None:
        self._file = path.open("rb", buffering=0)
        size = self._file.seek(0, os.SEEK_END)
        self._size = size if end is None else min(end, size)
        self._file.seek(0)
        self._head = closed_head(self._file.read(LENGTH), self._size)
        self._at = 0

    @override
    def readable(self) -> bool:
        return True

    @override
    def seekable(self) -> bool:
        return True

    @override
    def tell(self) -> int:
        return self._at

    @override
    def seek(self, offset: int, whence: int = os.SEEK_SET, /) -> int:
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._size}[whence]
        self._at = base + offset
        return self._at

    @override
    def readinto(self, buffer: "Buffer", /) -> int:
        view = memoryview(buffer).cast("B")
        if self._at + len(view) > self._size:
            raise OSError(f"the file is cut off at {self._size} bytes")
        self._file.seek(self._at)
        got = 0
        while got < len(view):
            count = self._file.readinto(view[got:])
            if not count:
                raise OSError(f"the file is cut off at {self._at + got} bytes")
            got += count
        if self._at < LENGTH:
            part = self._head[self._at : self._at + len(view)]
            view[: len(part)] = part
        self._at += got
        return got

    @override
    def close(self) -> None:
        self._file.close()
        super().close()


def is_recent(head: bytes) -> bool:
    """Return whether a file that begins so is HDF5 as recordings are."""
    return len(head) == LENGTH and head.startswith(SIGNATURE) and head[len(SIGNATURE)] == VERSION


def closed_head(head: bytes, size: int) -> bytes:
    """Return the superblock without its marks of a writer, and with the end that is there."""
    if not is_recent(head):
        return head
    changed = bytearray(head)
    changed[FLAGS_AT] = 0
    # The end that is written there may lag behind what the tables speak of by now.
    struct.pack_into("<Q", changed, END_AT, size)
    struct.pack_into("<I", changed, CHECKSUM_AT, checksum(bytes(changed[:CHECKSUM_AT])))
    return bytes(changed)


def checksum(data: bytes) -> int:
    """Return Jenkins' lookup3 of `data`, the checksum of HDF5's metadata."""
    a = b = c = (0xDEADBEEF + len(data)) & _MASK
    padded = data + bytes(-len(data) % 12)
    words = struct.unpack(f"<{len(padded) // 4}I", padded)
    for at in range(0, len(words), 3):
        a, b, c = (a + words[at]) & _MASK, (b + words[at + 1]) & _MASK, (c + words[at + 2]) & _MASK
        a, b, c = _mixed(a, b, c) if at + 3 < len(words) else _final(a, b, c)
    return c


def _rotated(value: int, bits: int) -> int:
    return (value << bits | value >> (32 - bits)) & _MASK


def _mixed(a: int, b: int, c: int) -> tuple[int, int, int]:
    for bits in (4, 6, 8, 16, 19, 4):
        a = (a - c & _MASK) ^ _rotated(c, bits)
        c = (c + b) & _MASK
        a, b, c = b, c, a
    return a, b, c


def _final(a: int, b: int, c: int) -> tuple[int, int, int]:
    for bits in (14, 11, 25, 16, 4, 14, 24):
        c = (c ^ b) - _rotated(b, bits) & _MASK
        a, b, c = b, c, a
    return a, c, b
