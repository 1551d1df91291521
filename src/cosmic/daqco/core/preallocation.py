"""Preallocation: space on the disk is taken before HDF5 needs it.

HDF5 does not survive a disk that fills while it writes its own tables: it was seen to end the
process with a segmentation fault. So the file is made longer ahead of it, by a call that fails in
good order, and cut to its length when it is closed.
"""

import errno
import logging
import os
import struct
from pathlib import Path
from typing import Final

import h5py

from cosmic.daqco.core.unclosed_file import END_AT, LENGTH

logger = logging.getLogger(__name__)

STEP_BYTES: Final = 16 * 1024 * 1024
TABLES_BYTES: Final = 4 * 1024 * 1024
# Said by file systems that cannot preallocate; there the check of the free space remains.
NOT_SUPPORTED: Final = (errno.EINVAL, errno.ENOSYS, errno.EOPNOTSUPP)


class Preallocation:
    """Keeps a file longer than what is in it; one thread.

    Parameters
    ----------
    margin_bytes : int
        What may still be written after no more space was to be had.
    """

    def __init__(self, file: h5py.File, path: Path, margin_bytes: int) -> None:
        self._file = file
        self._path = path
        self._margin_bytes = margin_bytes
        self._taken_bytes = 0

    @property
    def used_bytes(self) -> int:
        """How long the file is without the space ahead."""
        return int(self._file.id.get_filesize())

    def need(self) -> None:
        """See to it that there is a margin; raises `OSError` where the disk is full."""
        used = self.used_bytes
        if used + self._margin_bytes <= self._taken_bytes:
            return
        wanted = used + self._margin_bytes + STEP_BYTES
        try:
            self._take(wanted)
        except OSError as exc:
            if exc.errno not in NOT_SUPPORTED:
                raise
        self._taken_bytes = wanted

    def _take(self, length: int) -> None:
        if hasattr(os, "posix_fallocate"):
            at = self._taken_bytes
            os.posix_fallocate(self._file.id.get_vfd_handle(), at, length - at)
        else:  # Windows and macOS; NTFS takes the space as well
            os.truncate(self._path, length)


def trim(path: Path) -> None:
    """Cut a closed file to the length that it says it has."""
    try:
        with path.open("r+b") as file:
            head = file.read(LENGTH)
            (end,) = struct.unpack_from("<Q", head, END_AT)
            if end < file.seek(0, os.SEEK_END):
                file.truncate(end)
    except OSError as exc:  # zeros at the end of a file that is whole harm nobody
        logger.info("%s: keeps the preallocated space (%s)", path, exc)
