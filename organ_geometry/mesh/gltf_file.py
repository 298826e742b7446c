"""Binary glTF 2.0: arrays packed into one buffer, and the tree of JSON that names them."""

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from organ_geometry.mesh.color import Color, linear_light

GLTF_FROM_MM = 1e-3 * np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""glTF is metres with +y up; ours is mm with +z up."""

VectorKind: TypeAlias = Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT4"]
Target: TypeAlias = Literal["vertices", "indices"]

_COMPONENTS = {"u1": 5121, "u2": 5123, "u4": 5125, "f4": 5126}
_TARGETS = {"vertices": 34962, "indices": 34963}
_LINEAR, _LINEAR_MIPMAP_LINEAR, _REPEAT = 9729, 9987, 10497
_MAGIC, _VERSION, _JSON_CHUNK, _BINARY_CHUNK = b"glTF", 2, b"JSON", b"BIN\0"


def metres(points: NDArray[Any]) -> NDArray[np.float32]:
    """Return points (..., 3), mm and z up, in glTF's frame, m and y up."""
    moved: NDArray[np.float64] = points.astype(np.float64) @ GLTF_FROM_MM.T
    return moved.astype(np.float32)


def turned(directions: NDArray[Any]) -> NDArray[np.float32]:
    """Return directions in glTF's frame, of the same length."""
    moved: NDArray[np.float64] = directions.astype(np.float64) @ (1e3 * GLTF_FROM_MM.T)
    return moved.astype(np.float32)


@dataclass(frozen=True, slots=True)
class Finish:
    """A surface's look under light, by glTF's metallic-roughness model."""

    # sRGB; multiplied with `base_jpeg` where there is one, and with the colours of vertices.
    color: Color = (255, 255, 255)
    # roughness, metallic: 0 to 1. Above a metallic of about 0.8 steel turns black without an
    # environment map.
    roughness: float = 0.5
    metallic: float = 0.0
    # clearcoat, clearcoat_roughness: 0 to 1: a wet film over the surface.
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.2
    specular: float = 1.0  # 0 to 1: strength of the dielectric highlight
    # base_jpeg, normal_jpeg: JPEG files for colour and tangent-space normals, or empty.
    base_jpeg: bytes = b""
    normal_jpeg: bytes = b""


class GltfFile:
    """A glTF file in the making: collections of its tree, and the bytes they refer to.

    Equal arrays are stored once. The format is that of the Khronos Group's glTF 2.0
    specification, sections 3.6 (buffers, views, accessors) and 4 (GLB).
    """

    def __init__(self) -> None:
        self._tree: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "bluntdissect"},
            "scene": 0,
            "scenes": [{"nodes": []}],
        }
        self._chunks: list[bytes] = []
        self._length = 0
        self._known: dict[tuple[object, ...], int] = {}

    def add(self, collection: str, item: Mapping[str, Any]) -> int:
        """Add an item to a collection of the tree."""
        items: list[Mapping[str, Any]] = self._tree.setdefault(collection, [])
        items.append(item)
        return len(items) - 1

    def extend(self, collection: str, number: int, properties: Mapping[str, Any]) -> None:
        """Give an item of the tree further properties."""
        items: list[Mapping[str, Any]] = self._tree[collection]
        items[number] = {**items[number], **properties}

    def add_root(self, node: Mapping[str, Any]) -> int:
        """Add a node that stands in the scene itself."""
        number = self.add("nodes", node)
        self._tree["scenes"][0]["nodes"].append(number)
        return number

    def accessor(
        self,
        array: NDArray[Any],
        kind: VectorKind,  # What an element is
        *,
        target: Target | None = None,  # What the array is for, where a graphics card reads it
        bounded: bool = False,  # Whether the smallest and largest components are to be told
        normalized: bool = False,  # Whether whole numbers stand for 0 to 1
    ) -> int:
        """Store an array."""
        # (N,) or (N, C) numbers of one, two or four bytes; an element must take a multiple of four
        # bytes where it is a vertex's (glTF 2.0, 3.6.2.4). Returned is the accessor's number.
        return self.accessors(
            array[np.newaxis], kind, target=target, bounded=bounded, normalized=normalized
        )[0]

    def accessors(
        self,
        arrays: NDArray[Any],  # (M, N) or (M, N, C) numbers, as of `accessor`
        kind: VectorKind,
        *,
        target: Target | None = None,
        bounded: bool = False,
        normalized: bool = False,
    ) -> list[int]:
        """Store arrays of one shape one after the other."""
        arrays = np.ascontiguousarray(arrays)
        view = self._view(arrays.tobytes(), target)
        key = (view, arrays.shape, arrays.dtype.str, kind, bounded, normalized)
        if key in self._known:
            first = self._known[key]
            return list(range(first, first + len(arrays)))
        numbers: list[int] = []
        for place, array in enumerate(arrays):
            item: dict[str, Any] = {
                "bufferView": view,
                "componentType": _COMPONENTS[array.dtype.str[1:]],
                "count": len(array),
                "type": kind,
            }
            if place:
                item["byteOffset"] = place * array.nbytes
            if normalized:
                item["normalized"] = True
            if bounded:
                item |= _bounds(array)
            numbers.append(self.add("accessors", item))
        self._known[key] = numbers[0]
        return numbers

    def sparse_accessor(
        self, count: int, where: NDArray[np.uint32], values: NDArray[np.float32]
    ) -> int:
        """Store vectors most of which are zero."""
        # Of `count` vectors the (N, 3) values stand at (N,) growing numbers `where`, one or more;
        # the others are zero.
        places = where.astype(_index_type(count))
        nothing = np.zeros((1, 3), np.float32)
        # Without a view of its own all the rest is zero, but VTK's reader leaves there what was.
        size = 3 * values.itemsize
        zeros = self._view(bytes(size * count), "vertices")
        self._tree["bufferViews"][zeros]["byteStride"] = size  # for it is shared
        bounds = _bounds(values if len(where) == count else np.concatenate([values, nothing]))
        return self.add(
            "accessors",
            {
                "bufferView": zeros,
                "componentType": _COMPONENTS["f4"],
                "count": count,
                "type": "VEC3",
                **bounds,
                "sparse": {
                    "count": len(where),
                    # An offset of zero may be left out, but VTK's reader wants it.
                    "indices": {
                        "bufferView": self._view(places.tobytes(), None),
                        "byteOffset": 0,
                        "componentType": _COMPONENTS[places.dtype.str[1:]],
                    },
                    "values": {
                        "bufferView": self._view(values.tobytes(), None),
                        "byteOffset": 0,
                    },
                },
            },
        )

    def indices(self, faces: NDArray[np.integer[Any]], vertices: int) -> int:
        """Store triangles."""
        # How many vertices there are says whether two bytes a number are enough.
        flat = faces.ravel().astype(_index_type(vertices))
        return self.accessor(flat, "SCALAR", target="indices")

    def material(self, finish: Finish, name: str | None = None) -> int:
        """Add a finish as a material, equal ones once."""
        key = ("material", finish, name)
        if key not in self._known:
            self._known[key] = self.add("materials", self._described(finish, name))
        return self._known[key]

    def _described(self, finish: Finish, name: str | None) -> dict[str, Any]:
        surface: dict[str, Any] = {
            "baseColorFactor": [*linear_light(finish.color).round(5).tolist(), 1.0],
            "metallicFactor": finish.metallic,
            "roughnessFactor": finish.roughness,
        }
        item: dict[str, Any] = {} if name is None else {"name": name}
        item["pbrMetallicRoughness"] = surface
        if finish.base_jpeg:
            surface["baseColorTexture"] = {"index": self._texture(finish.base_jpeg)}
        if finish.normal_jpeg:
            item["normalTexture"] = {"index": self._texture(finish.normal_jpeg)}
        extensions: dict[str, Any] = {}
        if finish.clearcoat > 0.0:
            extensions["KHR_materials_clearcoat"] = {
                "clearcoatFactor": finish.clearcoat,
                "clearcoatRoughnessFactor": finish.clearcoat_roughness,
            }
        if finish.specular < 1.0:
            extensions["KHR_materials_specular"] = {"specularFactor": finish.specular}
        if extensions:
            item["extensions"] = extensions
            used: list[str] = self._tree.setdefault("extensionsUsed", [])
            used += [each for each in extensions if each not in used]
        return item

    def _texture(self, jpeg: bytes) -> int:
        """Add a picture that repeats both ways."""
        if "samplers" not in self._tree:
            sampler = {"magFilter": _LINEAR, "minFilter": _LINEAR_MIPMAP_LINEAR}
            self.add("samplers", sampler | {"wrapS": _REPEAT, "wrapT": _REPEAT})
        image = {"bufferView": self._view(jpeg, None), "mimeType": "image/jpeg"}
        return self.add("textures", {"source": self.add("images", image), "sampler": 0})

    def content(self) -> bytes:
        """Return the whole file."""
        tree = dict(self._tree)
        if self._length:
            tree["buffers"] = [{"byteLength": self._length}]
        text = json.dumps(tree, separators=(",", ":"), ensure_ascii=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = [struct.pack("<I", len(text)), _JSON_CHUNK, text]
        if self._length:
            chunks += [struct.pack("<I", self._length), _BINARY_CHUNK, *self._chunks]
        body = b"".join(chunks)
        return _MAGIC + struct.pack("<II", _VERSION, 12 + len(body)) + body

    def _view(self, content: bytes, target: Target | None) -> int:
        """Return the number of a view of these bytes, which start at a multiple of four."""
        if (content, target) in self._known:
            return self._known[content, target]
        item: dict[str, Any] = {
            "buffer": 0,
            "byteOffset": self._length,
            "byteLength": len(content),
        }
        if target is not None:
            item["target"] = _TARGETS[target]
        padding = b"\0" * (-len(content) % 4)
        self._chunks += [content, padding]
        self._length += len(content) + len(padding)
        view = self._known[content, target] = self.add("bufferViews", item)
        return view


def _index_type(count: int) -> type[np.uint16] | type[np.uint32]:
    """Return the smallest type of numbers of so many vertices; its largest is reserved."""
    return np.uint16 if count < np.iinfo(np.uint16).max else np.uint32


def _bounds(array: NDArray[Any]) -> dict[str, list[float]]:
    rows = array.reshape(len(array), -1)
    return {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
