"""Nineteen archives and images that promise more than they should, as a trainer's build reads them.

Each is unpacked and traced in the process that builds organs, and must be taken or refused in
words, within `SECONDS`, while that process takes at most `MEGABYTES`.
"""

import gzip
import io
import resource
import struct
import tempfile
import time
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np

from app.compression.build_process import BuildProcess
from app.compression.image_upload import UploadBounds, unpack_upload
from app.compression.organ_workbench import OrganChoice, _opened

SECONDS, MEGABYTES = 20.0, 600.0
HUGE = 2**29  # bytes that a small file unpacks to


def png(width: int, height: int, data: bytes | None = None) -> bytes:
    """A grey PNG, by default of zeros; its `data` are compressed already."""
    if data is None:
        data = _zeros(height * (width + 1))

    def chunk(kind: bytes, content: bytes) -> bytes:
        check = zlib.crc32(kind + content).to_bytes(4, "big")
        return len(content).to_bytes(4, "big") + kind + content + check

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def _zeros(count: int) -> bytes:
    packer = zlib.compressobj(9)
    pieces = [packer.compress(bytes(2**20)) for _ in range(count // 2**20)]
    return b"".join([*pieces, packer.compress(bytes(count % 2**20)), packer.flush()])


def zipped(*entries: tuple[str, bytes]) -> bytes:
    """A zip of some files."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries:
            archive.writestr(name, content)
    return out.getvalue()


def _images(*names: str) -> bytes:
    return zipped(*((name, _disc()) for name in names))


def _disc() -> bytes:
    picture = cv2.circle(np.zeros((24, 24), np.uint8), (12, 12), 6, 255, -1)
    return cv2.imencode(".png", picture)[1].tobytes()


def _zip_of_zeros() -> bytes:
    out = io.BytesIO()
    with (
        zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("1.png", "w", force_zip64=True) as entry,
    ):
        for _ in range(HUGE // 2**20):
            entry.write(bytes(2**20))
    return out.getvalue()


def _nested() -> bytes:
    inner = _zip_of_zeros()
    for _ in range(3):
        inner = zipped(("1.zip", inner), ("2.zip", inner))
    return inner


def _lying() -> bytes:
    content = _disc() + bytes(HUGE // 8)
    return zipped(("1.png", content)).replace(
        len(content).to_bytes(4, "little"), len(_disc()).to_bytes(4, "little")
    )


def _overlapping() -> bytes:
    """Many names of one content."""
    content = _images("1.png")
    start, end = content.index(b"PK\1\2"), content.index(b"PK\5\6")
    entry, count = content[start:end], 1900
    tail = struct.pack("<4sHHHHIIH", b"PK\5\6", 0, 0, count, count, count * len(entry), start, 0)
    names = (entry.replace(b"1.png", b"%05d" % number) for number in range(count))
    return content[:start] + b"".join(names) + tail


def _encrypted() -> bytes:
    content = bytearray(_images("1.png"))
    content[6] |= 1
    content[content.index(b"PK\1\2") + 8] |= 1
    return bytes(content)


def _link() -> bytes:
    out, entry = io.BytesIO(), zipfile.ZipInfo("1.png")
    entry.external_attr = 0o120777 << 16
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr(entry, "/etc/passwd")
    return out.getvalue()


def _tiff(width: int, height: int, *, endless: bool = False) -> bytes:
    tags = [(256, width), (257, height), (258, 8), (259, 1), (262, 1), (273, 8), (278, height),
            (279, width * height % 2**32)]  # fmt: skip
    following = 8 if endless else 0
    body = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags)
    return b"II*\0" + struct.pack("<IH", 8, len(tags)) + body + struct.pack("<I", following)


def _jpeg() -> bytes:
    content = bytearray(cv2.imencode(".jpg", np.zeros((8, 8), np.uint8))[1].tobytes())
    at = content.index(b"\xff\xc0")
    content[at + 5 : at + 9] = struct.pack(">HH", 65500, 65500)
    return zipped(("1.jpg", bytes(content)), ("2.jpg", bytes(content)))


BOMBS: dict[str, tuple[str, Callable[[], bytes]]] = {
    "zip of zeros": ("a.zip", _zip_of_zeros),
    "200,000 entries": ("a.zip", lambda: zipped(*((f"{n}.png", b"") for n in range(200_000)))),
    "zips in zips": ("a.zip", _nested),
    "zip that lies about sizes": ("a.zip", _lying),
    "names that leave the folder": ("a.zip", lambda: _images("../../1.png", "/etc/2.png")),
    "name of 300 letters": ("a.zip", lambda: _images(f"{300 * 'a'}.png", "b.png")),
    "1,900 names of one file": ("a.zip", _overlapping),
    "encrypted zip": ("a.zip", _encrypted),
    "link in a zip": ("a.zip", _link),
    "half a zip": ("a.zip", lambda: (whole := _images("1.png", "2.png"))[: len(whole) // 2]),
    "gzip of zeros": ("a.nii.gz", lambda: gzip.compress(bytes(HUGE))),
    "MetaImage of 10^15 voxels": (
        "a.mha",
        lambda: (
            b"ObjectType = Image\nNDims = 3\nDimSize = 100000 100000 100000\n"
            b"ElementType = MET_UCHAR\nElementDataFile = LOCAL\n" + bytes(100)
        ),
    ),
    "NRRD of 10^15 voxels": (
        "a.nrrd",
        lambda: (
            b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 100000 100000 100000\n"
            b"encoding: gzip\n\n" + gzip.compress(bytes(2**20))
        ),
    ),
    "PNG of 30,000 x 30,000": ("a.zip", lambda: zipped(("1.png", png(30_000, 30_000)))),
    "24 PNG of 2236 x 2236": (  # the most that is taken
        "a.zip",
        lambda: zipped(*((f"{n}.png", one) for one in (png(2236, 2236),) for n in range(24))),
    ),
    "PNG whose data goes on": (
        "a.zip",
        lambda: zipped(*((f"{n}.png", png(24, 24, _zeros(388 * 10**6))) for n in range(2))),
    ),
    "TIFF of 65,535 x 65,535": ("a.tif", lambda: _tiff(65_535, 65_535)),
    "TIFF whose pages are a ring": ("a.tif", lambda: _tiff(24, 24, endless=True)),
    "JPEG of 65,500 x 65,500": ("a.zip", _jpeg),
}
"""What each is called as it is sent, and its content."""


def _nothing(*_: int) -> None: ...


def use(
    name: str, content: bytes, progress: Callable[[int, int], None]
) -> tuple[str, float, float]:
    """Open what was sent, as the trainer does; return why not, s of processor, and MB at most."""
    del progress
    bounds, words, start = UploadBounds(), "", time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        try:
            source = unpack_upload(name, content, Path(folder), bounds)
            _opened(source, (0.1, 0.5), OrganChoice(), bounds, _nothing)
        except ValueError as refusal:
            words = str(refusal) or "refused without a word"
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return words, time.process_time() - start, most


def used_bombs() -> Iterator[tuple[str, str, float, float]]:
    """Give of each bomb its name, what was said of it, its s of processor and MB at most so far."""
    process = BuildProcess()
    try:
        for kind, (name, make) in BOMBS.items():
            content = make()
            try:
                used = process.make(use, name, content, progress=_nothing, wanted=lambda: True)
            except (RuntimeError, MemoryError, ValueError) as fault:
                used = f"FAULT: {fault}", float("nan"), float("nan")
            yield kind, *used
    finally:
        process.stop()
