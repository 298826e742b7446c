"""The number of pixels in an image file's header, read before anything is decoded."""

import struct
from collections.abc import Iterator

MOST_PAGES = 10_000
# Tags of a TIFF directory, and their types with `struct`'s letters: SHORT, LONG, LONG8.
_TIFF_WIDTH, _TIFF_HEIGHT = 256, 257
_TIFF_KINDS = {3: "H", 4: "I", 16: "Q"}
# Start-of-frame markers, which hold the size; markers without a length of their own.
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_BARE = frozenset({0x01, *range(0xD0, 0xD8)})


class UnknownImageError(ValueError):
    """A file is no PNG, JPEG, TIFF or BMP image, whatever it is called."""


def image_extents(content: bytes) -> list[tuple[int, int]]:
    """Return the size of each image in a file, as its header states it."""
    try:
        if content.startswith(b"\x89PNG\r\n\x1a\n") and content[12:16] == b"IHDR":
            return [struct.unpack_from(">II", content, 16)]
        if content.startswith(b"BM"):
            return [_bmp_extent(content)]
        if content.startswith(b"\xff\xd8"):
            return [_jpeg_extent(content)]
        if content[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
            pages = list(_tiff_extents(content))
            if pages:
                return pages
    except (struct.error, KeyError, IndexError) as error:
        raise UnknownImageError("the image's header is broken") from error
    raise UnknownImageError("it is no PNG, JPEG, TIFF or BMP image")


def _bmp_extent(content: bytes) -> tuple[int, int]:
    if struct.unpack_from("<I", content, 14)[0] == 12:
        return struct.unpack_from("<HH", content, 18)
    width, height = struct.unpack_from("<ii", content, 18)
    return abs(width), abs(height)


def _jpeg_extent(content: bytes) -> tuple[int, int]:
    place = 2
    while True:
        if content[place] != 0xFF:
            raise UnknownImageError("the image's header is broken")
        marker = content[place + 1]
        if marker == 0xFF:  # padding
            place += 1
        elif marker in _JPEG_BARE:
            place += 2
        elif marker in _JPEG_FRAMES:
            height, width = struct.unpack_from(">HH", content, place + 5)
            return width, height
        else:
            place += 2 + struct.unpack_from(">H", content, place + 2)[0]


def _tiff_extents(content: bytes) -> Iterator[tuple[int, int]]:
    order = "<" if content.startswith(b"I") else ">"
    big = struct.unpack_from(f"{order}H", content, 2)[0] == 43
    # BigTIFF has 8-byte offsets and counts where TIFF has 4 and 2 bytes.
    offset, count, entry = ("Q", "Q", 20) if big else ("I", "H", 12)
    place = struct.unpack_from(f"{order}{offset}", content, 8 if big else 4)[0]
    for _ in range(MOST_PAGES):
        if not place:
            return
        entries = struct.unpack_from(f"{order}{count}", content, place)[0]
        first = place + struct.calcsize(f"{order}{count}")
        after = first + entry * entries
        place = struct.unpack_from(f"{order}{offset}", content, after)[0]
        sides: dict[int, int] = {}
        for at in range(first, after, entry):
            tag, kind = struct.unpack_from(f"{order}HH", content, at)
            if tag in (_TIFF_WIDTH, _TIFF_HEIGHT):
                value = at + (12 if big else 8)
                sides[tag] = struct.unpack_from(f"{order}{_TIFF_KINDS[kind]}", content, value)[0]
        yield sides[_TIFF_WIDTH], sides[_TIFF_HEIGHT]
    raise UnknownImageError(f"it has more than {MOST_PAGES:,} pages")
