"""Whether the LZW codes of a TIFF are whole: OpenCV makes an image of damaged ones without a word.

Only the lengths of what the codes stand for are followed, not their bytes.
"""

import numpy as np
import numpy.typing as npt

CLEAR, END, FIRST_FREE = 256, 257, 258
MOST_CODES = 4096 - FIRST_FREE + 2
"""From one clearing of the table to the next; it is full then."""

# Entries in the table before each code since it was cleared; TIFF widens codes one entry early.
_FREE = FIRST_FREE + np.maximum(np.arange(MOST_CODES) - 1, 0)
_WIDTHS = 9 + (_FREE > 510).astype(np.int64) + (_FREE > 1022) + (_FREE > 2046)
_STARTS = np.concatenate([[0], np.cumsum(_WIDTHS)])


def lzw_is_whole(packed: bytes, size: int) -> bool:
    """Return whether LZW codes are valid and stand for `size` bytes or more."""
    if len(packed) > 1 and packed[0] == 0 and packed[1] & 1:
        return True  # as TIFF had it before 1992, bits the other way about: not looked at
    data = np.frombuffer(packed + bytes(3), np.uint8).astype(np.uint32)
    at = found = 0
    while found < size:
        codes, complete = _codes(data, at, 8 * len(packed))
        length = _length(codes)
        if length is None:
            return False
        found += length
        if not complete:
            return found >= size
        at += int(_STARTS[len(codes) + 1])
    return True


def _codes(data: npt.NDArray[np.uint32], at: int, bits: int) -> tuple[npt.NDArray[np.int64], bool]:
    """Return the codes up to where the table is cleared, and whether it is."""
    count = int(np.searchsorted(_STARTS, bits - at, side="right")) - 1
    starts, widths = at + _STARTS[:-1][:count], _WIDTHS[:count]
    first = starts >> 3
    three = (data[first] << 16) | (data[first + 1] << 8) | data[first + 2]
    codes = (three.astype(np.int64) >> (24 - widths - (starts & 7))) & ((1 << widths) - 1)
    ends = np.flatnonzero((codes == CLEAR) | (codes == END))
    if not len(ends):
        return codes, False
    return codes[: ends[0]], bool(codes[ends[0]] == CLEAR)


def _length(codes: npt.NDArray[np.int64]) -> int | None:
    """Return of how many bytes codes are; None where one is not in the table yet."""
    if not len(codes):
        return 0
    if len(codes) >= MOST_CODES or codes[0] >= CLEAR or (codes > _FREE[: len(codes)]).any():
        return None
    lengths = [1] * FIRST_FREE
    total = before = 1
    for code in codes[1:].tolist():
        lengths.append(before + 1)
        before = lengths[code]
        total += before
    return total
