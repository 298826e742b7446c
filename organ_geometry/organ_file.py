"""The organ file: an organ in few bytes, checked when it is read.

Layout, little-endian: magic (8 bytes), version (u16), CRC-32 (u32), length of the packed content
(u32), length of the content (u32), packed content. The CRC covers everything after it and the
version. The content is MessagePack, packed by Zstandard; its arrays are differences from row to
row, sorted into byte planes, which pack better. Axis and curves are float32; a frame is a unit
quaternion without its largest component, in steps of 2^-15.
"""

import math
import struct
import zlib
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import zstandard
from numpy.typing import NDArray

from organ_geometry.half_curves import ROW_SIZE
from organ_geometry.organ import Organ
from organ_geometry.whole_file import write_whole

MAGIC = b"\x89organ\r\n"
VERSION = 1
LARGEST_FILE_BYTES = 16 * 2**20
LARGEST_CONTENT_BYTES = 16 * 2**20
MOST_SECTIONS = 65_535

_MAGIC_AND_VERSION = struct.Struct("<8sH")
_CHECKED = struct.Struct("<III")
_HEADER_BYTES = _MAGIC_AND_VERSION.size + _CHECKED.size
_COMPRESSION_LEVEL = 19

_FLOAT = np.dtype("<f4")
_STEP = np.dtype("<i2")
_LARGEST = np.dtype("u1")
_KEY = np.dtype("<u2")
# Steps of 2^-15 leave 1/2 exact, so that frames along the axes of space stay exact.
_STEPS_PER_UNIT = 32768.0
# Components nearer than this count as equally large, and the first of them is left out; far above
# rounding and far below a step.
_TIE = 2.0**-20


class OrganFileError(ValueError):
    """An organ file that cannot be read or written, with one line saying what is wrong."""


class _Content(msgspec.Struct, array_like=True, forbid_unknown_fields=True):
    """The organ, with packed arrays."""

    name: str
    units: str
    tolerance_mm: float
    sections: int
    key_count: int
    frame_count: int
    left_handed: bool
    keys: bytes
    axis: bytes
    rotation_steps: bytes
    rotation_largest: bytes
    outer: bytes
    lumen: bytes | None


def write_organ(organ: Organ, path: Path) -> int:
    """Write an organ to a file, which appears complete or not at all.

    Parameters
    ----------
    organ
        The organ; what the file keeps of it is `stored_organ(organ)`.
    path
        The file; one that exists is replaced.

    Returns
    -------
    int
        Size of the file, bytes.

    Raises
    ------
    OrganFileError
        If the organ is too large to store.
    ValueError
        If the file cannot be written.
    """
    data = organ_bytes(organ)
    write_whole(Path(path), data)
    return len(data)


def read_organ(path: Path) -> Organ:
    """Return the organ of a file.

    Parameters
    ----------
    path
        An organ file.

    Returns
    -------
    Organ
        The organ, to the bit what `stored_organ` gave for the one written.

    Raises
    ------
    OrganFileError
        If there is no such file, or it is foreign, newer, truncated, damaged or not an organ.
    """
    source = Path(path)
    try:
        with source.open("rb") as file:
            data = file.read(LARGEST_FILE_BYTES + 1)
    except OSError as error:
        raise OrganFileError(f"cannot read {source}: {error.strerror or error}") from error
    try:
        return organ_from_bytes(data)
    except OrganFileError as error:
        raise OrganFileError(f"{source}: {error}") from error


def stored_organ(organ: Organ) -> Organ:
    """Return an organ as its file gives it back.

    Parameters
    ----------
    organ
        The organ.

    Returns
    -------
    Organ
        The organ, rounded to what is stored; rounding it again changes nothing.

    Raises
    ------
    OrganFileError
        If the organ is too large to store.
    """
    return organ_from_bytes(organ_bytes(organ))


def organ_bytes(organ: Organ) -> bytes:
    """Return the content of an organ's file.

    Parameters
    ----------
    organ
        The organ.

    Returns
    -------
    bytes
        The file.

    Raises
    ------
    OrganFileError
        If the organ has too many sections or numbers beyond float32.
    """
    if len(organ.axis) > MOST_SECTIONS:
        raise OrganFileError(
            f"an organ file holds up to {MOST_SECTIONS} sections, not {len(organ.axis)}"
        )
    same = bool((organ.frames == organ.frames[0]).all())
    frames = organ.frames[:1] if same else organ.frames
    left_handed = organ.handedness < 0
    steps, largest = _rotation_steps(frames, left_handed)
    content = msgspec.msgpack.encode(
        _Content(
            name=organ.name,
            units=organ.units,
            tolerance_mm=organ.tolerance_mm,
            sections=len(organ.axis),
            key_count=len(organ.keys),
            frame_count=len(frames),
            left_handed=left_handed,
            keys=_packed(organ.keys.astype(_KEY)),
            axis=_packed(_as_float32(organ.axis)),
            rotation_steps=_packed(steps),
            rotation_largest=_packed(largest),
            outer=_packed(_as_float32(organ.outer)),
            lumen=None if organ.lumen is None else _packed(_as_float32(organ.lumen)),
        )
    )
    packed = zstandard.ZstdCompressor(level=_COMPRESSION_LEVEL).compress(content)
    if max(len(content), len(packed) + _HEADER_BYTES) > LARGEST_CONTENT_BYTES:
        raise OrganFileError(f"an organ file holds up to {LARGEST_CONTENT_BYTES} bytes")
    start = _MAGIC_AND_VERSION.pack(MAGIC, VERSION)
    lengths = struct.pack("<II", len(packed), len(content))
    return start + struct.pack("<I", _checksum(start, lengths, packed)) + lengths + packed


def organ_from_bytes(data: bytes) -> Organ:
    """Return the organ of a file's content.

    Parameters
    ----------
    data
        The file.

    Returns
    -------
    Organ
        The organ.

    Raises
    ------
    OrganFileError
        If the data is foreign, newer, truncated, damaged or not an organ.
    """
    if len(data) > LARGEST_FILE_BYTES:
        raise OrganFileError(f"larger than an organ file may be, {LARGEST_FILE_BYTES} bytes")
    if data[: len(MAGIC)] != MAGIC[: len(data)] or not data:
        raise OrganFileError("not an organ file")
    if len(data) < _HEADER_BYTES:
        raise OrganFileError(f"truncated: {len(data)} bytes, the header alone has {_HEADER_BYTES}")
    _, version = _MAGIC_AND_VERSION.unpack_from(data)
    if version != VERSION:
        raise OrganFileError(
            f"organ file of version {version}; this program reads version {VERSION}"
        )
    checksum, packed_length, length = _CHECKED.unpack_from(data, _MAGIC_AND_VERSION.size)
    packed = data[_HEADER_BYTES:]
    if len(packed) < packed_length:
        raise OrganFileError(f"truncated: {len(data)} bytes of {_HEADER_BYTES + packed_length}")
    start, lengths = data[: _MAGIC_AND_VERSION.size], data[_HEADER_BYTES - 8 : _HEADER_BYTES]
    if len(packed) > packed_length or _checksum(start, lengths, packed) != checksum:
        raise OrganFileError("damaged: the checksum does not fit")
    return _organ(_unpacked_content(packed, length))


def _checksum(start: bytes, lengths: bytes, packed: bytes) -> int:
    return zlib.crc32(packed, zlib.crc32(lengths, zlib.crc32(start)))


def _unpacked_content(packed: bytes, length: int) -> _Content:
    """Return the content, with its size bounded before any of it is unpacked."""
    if length > LARGEST_CONTENT_BYTES:
        raise OrganFileError(
            f"claims {length} bytes of content, above the limit of {LARGEST_CONTENT_BYTES}"
        )
    try:
        if zstandard.get_frame_parameters(packed).content_size != length:
            raise OrganFileError("damaged: the content's size does not fit")
        content = zstandard.ZstdDecompressor().decompress(packed)
        return msgspec.msgpack.decode(content, type=_Content)
    except (zstandard.ZstdError, msgspec.DecodeError, UnicodeDecodeError) as error:
        raise OrganFileError(f"damaged: {error}") from error


def _organ(content: _Content) -> Organ:
    """Return the organ, with every count bounded before arrays are made from it."""
    sections, key_count, frame_count = content.sections, content.key_count, content.frame_count
    if not 2 <= sections <= MOST_SECTIONS:
        raise OrganFileError(f"has {sections} sections; 2 to {MOST_SECTIONS} are possible")
    if not 2 <= key_count <= sections:
        raise OrganFileError(f"has {key_count} key sections of {sections} sections")
    if frame_count not in {1, sections}:
        raise OrganFileError(f"has {frame_count} frames for {sections} sections")
    steps = _unpacked("frames", content.rotation_steps, _STEP, (frame_count, 3))
    largest = _unpacked("frames", content.rotation_largest, _LARGEST, (frame_count, 1))[:, 0]
    if (largest > 3).any():
        raise OrganFileError("damaged: a frame is no rotation")
    frames = _frames(steps, largest, content.left_handed)
    lumen = content.lumen
    try:
        return Organ(
            axis=_unpacked("axis", content.axis, _FLOAT, (sections, 3)),
            frames=np.broadcast_to(frames, (sections, 3, 3)),
            keys=_unpacked("keys", content.keys, _KEY, (key_count, 1))[:, 0],
            outer=_unpacked("outer curves", content.outer, _FLOAT, (key_count, ROW_SIZE)),
            lumen=None
            if lumen is None
            else _unpacked("lumen curves", lumen, _FLOAT, (key_count, ROW_SIZE)),
            units=content.units,
            tolerance_mm=content.tolerance_mm,
            name=content.name,
        )
    except OrganFileError:
        raise
    except ValueError as error:
        raise OrganFileError(f"does not hold an organ: {error}") from error


def _as_float32(values: NDArray[np.float64]) -> NDArray[np.float32]:
    with np.errstate(over="ignore"):
        rounded = values.astype(_FLOAT)
    if not np.isfinite(rounded).all():
        raise OrganFileError("an organ file holds lengths up to 3e38 mm")
    return rounded


def _packed(values: NDArray[Any]) -> bytes:
    """Return rows as differences, whole numbers that wrap around, sorted into byte planes."""
    rows = values.reshape(len(values), -1)
    whole = rows.view(f"<u{rows.dtype.itemsize}")
    differences = whole.copy()
    differences[1:] -= whole[:-1]
    planes = differences.view(np.uint8).reshape(*differences.shape, rows.dtype.itemsize)
    return planes.transpose(1, 2, 0).tobytes()


def _unpacked(
    what: str, packed: bytes, dtype: np.dtype[Any], shape: tuple[int, int]
) -> NDArray[Any]:
    """Return the rows that were packed."""
    rows, columns = shape
    if len(packed) != rows * columns * dtype.itemsize:
        raise OrganFileError(
            f"damaged: {what} take {len(packed)} bytes, {rows * columns * dtype.itemsize} expected"
        )
    planes = np.frombuffer(packed, dtype=np.uint8).reshape(columns, dtype.itemsize, rows)
    differences = np.ascontiguousarray(planes.transpose(2, 0, 1)).view(f"<u{dtype.itemsize}")
    whole = np.add.accumulate(differences[:, :, 0], axis=0, dtype=f"<u{dtype.itemsize}")
    return whole.view(dtype)


def _rotation_steps(
    frames: NDArray[np.float64], left_handed: bool
) -> tuple[NDArray[np.int16], NDArray[np.uint8]]:
    """Return (F, 3) stored quaternion components and (F,) which is left out, the largest."""
    quaternions = _quaternions(frames * _mirror(left_handed))
    sizes = np.abs(quaternions)
    largest = (sizes >= sizes.max(axis=1, keepdims=True) - _TIE).argmax(axis=1)
    left_out = quaternions[np.arange(len(frames)), largest]
    quaternions = quaternions * np.where(left_out < 0.0, -1.0, 1.0)[:, np.newaxis]
    rest = quaternions[_others(largest)].reshape(len(frames), 3)
    limit = math.floor(math.sqrt(0.5) * _STEPS_PER_UNIT)
    steps = np.clip(np.round(rest * _STEPS_PER_UNIT), -limit, limit)
    # Rounding must not make another component the one to leave out, or storing an organ twice would
    # not be the same as storing it once: a rival gives way by a step.
    earlier = np.arange(3) < largest[:, np.newaxis]
    margin = np.where(earlier, -2.0 * _TIE, 0.5 * _TIE)
    while True:
        remainder = np.sqrt(1.0 - np.einsum("fi,fi->f", steps, steps) / _STEPS_PER_UNIT**2)
        rivals = np.abs(steps) / _STEPS_PER_UNIT > remainder[:, np.newaxis] + margin
        if not rivals.any():
            return steps.astype(_STEP), largest.astype(_LARGEST)
        steps = np.where(rivals, steps - np.sign(steps), steps)


def _others(largest: NDArray[Any]) -> NDArray[np.bool_]:
    return np.arange(4) != largest[:, np.newaxis]


def _mirror(left_handed: bool) -> NDArray[np.float64]:
    """Return the (3,) signs of a frame's columns that make it right-handed."""
    return np.array([1.0, 1.0, -1.0 if left_handed else 1.0])


def _quaternions(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (F, 4) unit quaternions w, x, y, z of rotation matrices."""
    # Every product of two components is a sum of matrix entries; the row of the largest square
    # loses no digits (Shepperd's method).
    r = rotations
    products = np.empty((len(r), 4, 4))
    trace = r[:, 0, 0] + r[:, 1, 1] + r[:, 2, 2]
    products[:, 0, 0] = 1.0 + trace
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        products[:, i + 1, i + 1] = 1.0 + 2.0 * r[:, i, i] - trace
        mixed = r[:, i, j] + r[:, j, i]
        products[:, i + 1, j + 1] = products[:, j + 1, i + 1] = mixed
        turn = r[:, k, j] - r[:, j, k]
        products[:, 0, i + 1] = products[:, i + 1, 0] = turn
    largest = np.einsum("fii->fi", products).argmax(axis=1)
    rows = products[np.arange(len(r)), largest]
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def _frames(
    steps: NDArray[np.int16], largest: NDArray[np.uint8], left_handed: bool
) -> NDArray[np.float64]:
    """Return the (F, 3, 3) frames of stored quaternion components."""
    rest = steps / _STEPS_PER_UNIT
    squares = np.einsum("fi,fi->f", rest, rest)
    if (squares > 1.0).any():
        raise OrganFileError("damaged: a frame is no rotation")
    quaternions = np.empty((len(steps), 4))
    quaternions[_others(largest)] = rest.ravel()
    quaternions[~_others(largest)] = np.sqrt(1.0 - squares)
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    matrices = np.stack([np.stack(row, axis=1) for row in rows], axis=1)
    return matrices * _mirror(left_handed)
