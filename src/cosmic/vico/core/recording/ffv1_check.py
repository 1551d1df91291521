"""Whether an image coded by FFV1 is as it was written.

FFmpeg finds damage by the checksum of each slice as well, but only writes it to its log and
patches the image.
"""

import zlib
from typing import Final

_FOOTER: Final = 8  # length of the slice in 3 bytes, a status byte, checksum in 4 bytes
_REVERSED: Final = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
_START: Final = 0xFFFFFFFF  # undoes what zlib does to the start and the end of a checksum


def is_intact(packet: bytes) -> bool:
    """Return whether the checksums of all slices of a packet are right."""
    # FFV1 counts bits from the other end than zlib does.
    turned = packet.translate(_REVERSED)
    end = len(packet)
    while end > 0:
        start = end - _FOOTER - int.from_bytes(packet[end - _FOOTER : end - _FOOTER + 3], "big")
        if not 0 <= start <= end - _FOOTER:
            return False
        if zlib.crc32(memoryview(turned)[start:end], _START) != _START:
            return False
        end = start
    return True
