"""VTK files for ParaView: surfaces and lines with their data (VTP), and series of them (PVD).

The XML of VTK's file formats: arrays are appended in base64, each a block that zlib has packed,
behind the number and the sizes of its blocks.
"""

import base64
import sys
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

_TYPES = {"f4": "Float32", "f8": "Float64", "i4": "Int32", "i8": "Int64", "u1": "UInt8"}
_EFFORT = 4  # of zlib's 9: twice as fast as its usual 6 and next to as small
_BYTE_ORDER = "LittleEndian" if sys.byteorder == "little" else "BigEndian"


class _Appended:
    """Arrays that are written behind the tree and named in it by their offset."""

    def __init__(self) -> None:
        self._encoded: list[bytes] = []
        self._length = 0

    def element(self, name: str, array: NDArray[Any]) -> str:
        content = np.ascontiguousarray(array)
        components = f' NumberOfComponents="{array.shape[1]}"' if array.ndim > 1 else ""
        kind = f'type="{_TYPES[content.dtype.str[1:]]}" Name={quoteattr(name)}{components}'
        return self._added(kind, content.tobytes())

    def words(self, name: str, words: Sequence[str]) -> str:
        kind = f'type="String" Name={quoteattr(name)} NumberOfTuples="{len(words)}"'
        return self._added(kind, "".join(f"{word}\0" for word in words).encode())

    def _added(self, kind: str, content: bytes) -> str:
        element = f'<DataArray {kind} format="appended" offset="{self._length}"/>'
        packed = zlib.compress(content, _EFFORT)
        header = np.array([1, len(content), 0, len(packed)], np.uint64).tobytes()
        self._encoded.append(base64.b64encode(header) + base64.b64encode(packed))
        self._length += len(self._encoded[-1])
        return element

    def content(self) -> bytes:
        return b"".join(self._encoded)


def vtp_content(
    vertices: NDArray[np.float32],
    *,
    faces: NDArray[np.int32] | None = None,
    lines: NDArray[np.int32] | None = None,
    point_data: Mapping[str, NDArray[Any]] | None = None,
    cell_data: Mapping[str, NDArray[Any]] | None = None,
    names: Mapping[str, Sequence[str]] | None = None,
) -> bytes:
    """Return triangles and lines as VTK's XML PolyData.

    Parameters
    ----------
    vertices
        (V, 3) places, mm.
    faces, lines
        (F, 3) and (L, 2) vertex numbers.
    point_data, cell_data
        (V,) or (V, C) figures of the vertices by name, and of the lines before the faces.
    names
        Lists of words that belong to the whole file, by name.

    Returns
    -------
    bytes
        The file.
    """
    data = _Appended()

    def figures(named: Mapping[str, NDArray[Any]] | None) -> str:
        return "".join(data.element(name, array) for name, array in (named or {}).items())

    def cells(corners: NDArray[np.int32] | None) -> str:
        if corners is None:
            return ""
        width = corners.shape[1]
        ends = np.arange(width, corners.size + 1, width, dtype=np.int32)
        return data.element("connectivity", corners.ravel()) + data.element("offsets", ends)

    listed = "".join(data.words(name, words) for name, words in (names or {}).items())
    head = (
        '<?xml version="1.0"?>\n'
        f'<VTKFile type="PolyData" version="1.0" byte_order="{_BYTE_ORDER}" header_type="UInt64" '
        'compressor="vtkZLibDataCompressor">'
        f"<PolyData><FieldData>{listed}</FieldData>"
        f'<Piece NumberOfPoints="{len(vertices)}" NumberOfVerts="0" '
        f'NumberOfLines="{0 if lines is None else len(lines)}" NumberOfStrips="0" '
        f'NumberOfPolys="{0 if faces is None else len(faces)}">'
        f"<PointData>{figures(point_data)}</PointData><CellData>{figures(cell_data)}</CellData>"
        f"<Points>{data.element('Points', vertices)}</Points>"
        f"<Lines>{cells(lines)}</Lines><Polys>{cells(faces)}</Polys></Piece></PolyData>"
        '<AppendedData encoding="base64">_'
    )
    return head.encode() + data.content() + b"</AppendedData></VTKFile>\n"


def pvd_content(files: Sequence[tuple[float, int, Path]]) -> bytes:
    """Return a series of files, each with its time and the number of its part, as a collection."""
    rows = "".join(
        f'<DataSet timestep="{value!r}" part="{number}" file={quoteattr(path.as_posix())}/>\n'
        for value, number, path in files
    )
    return (
        '<?xml version="1.0"?>\n'
        f'<VTKFile type="Collection" version="0.1" byte_order="{_BYTE_ORDER}">\n'
        f"<Collection>\n{rows}</Collection>\n</VTKFile>\n"
    ).encode()
