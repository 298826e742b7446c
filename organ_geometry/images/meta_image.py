"""Compressed voxels of MetaImage files, read whole even if their stated size is wrong.

The reader of SimpleITK takes as many compressed bytes as the header has in CompressedDataSize.
Where those are too few it says nothing, and leaves in the rest of the volume what was in memory.
"""

import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from organ_geometry.images.grey_image import ImageStackError

META_SUFFIXES = (".mha", ".mhd")

_FIELD = re.compile(rb"^[ \t]*(\w+)[ \t]*=[ \t]*([^\r\n]*?)[ \t]*\r?\n", re.M)
_LONGEST_HEADER = 1 << 20
_ZLIB_OR_GZIP = 47


def whole_meta_values(path: Path, values: NDArray[Any]) -> NDArray[Any]:
    """Return the voxels of a MetaImage: those that were read, or better ones."""
    header, data = _header_and_data(path)
    if data is None or header.get(b"CompressedData", b"").lower() != b"true":
        return values
    unpacking = zlib.decompressobj(_ZLIB_OR_GZIP)
    try:
        voxels = unpacking.decompress(data, values.nbytes + 1)
    except zlib.error as error:
        raise ImageStackError(f"{path} is damaged: its voxels cannot be unpacked") from error
    if len(voxels) < values.nbytes:
        raise ImageStackError(
            f"{path} is cut short: its voxels need {values.nbytes:,} bytes and {len(voxels):,} "
            f"are in it"
        )
    if header.get(b"CompressedDataSize", b"%d" % len(data)) == b"%d" % len(data):
        return values
    big = header.get(b"BinaryDataByteOrderMSB", b"false").lower() == b"true"
    stored = np.frombuffer(voxels[: values.nbytes], values.dtype.newbyteorder(">" if big else "<"))
    return stored.astype(values.dtype).reshape(values.shape)


def _header_and_data(path: Path) -> tuple[dict[bytes, bytes], bytes | None]:
    """Return a MetaImage's fields, and the bytes of its voxels or None if in many files."""
    content = path.read_bytes()
    header: dict[bytes, bytes] = {}
    for field in _FIELD.finditer(content, 0, _LONGEST_HEADER):
        header[field[1]] = field[2]
        if field[1] == b"ElementDataFile":
            if field[2] == b"LOCAL":
                return header, content[field.end() :]
            break
    beside = path.parent / header.get(b"ElementDataFile", b"").decode(errors="replace")
    return header, beside.read_bytes() if beside.is_file() and beside != path else None
