"""A glossy mesh whose vertices and colours move: a small GLB file sent anew for every picture.

viser's own streamed meshes have one colour and no gloss. A GLB has both, and the page takes a new
one in its stride as long as it need not decode an image or compile a shader for it. So
there are no textures here, and `keep_finish` holds the shader: a triangle of the same finish that
is never replaced. Without it the page compiles anew for each file, slower than it draws.
"""

import json
import struct
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.stage.gltf_asset import Finish

__all__ = ["StreamedMesh", "keep_finish"]

_FLOAT, _UINT32 = 5126, 5125
_VERTICES, _INDICES = 34962, 34963
_BOUND = 1.0e4  # mm; the page finds the true bounds itself


class StreamedMesh:
    """A mesh of one client whose places and colours are written in place and then sent.

    Parameters
    ----------
    scene
        Of one client.
    name
        The scene node.
    faces
        (F, 3) vertex numbers, anticlockwise seen from outside.
    count
        Number of vertices.
    finish
        Gloss of the surface; its colour and pictures are not used.
    unlit
        Whether the colours are the light itself, whatever lamps there are.

    Attributes
    ----------
    positions
        (count, 3) mm, to be written before `send`.
    colors
        (count, 3) linear light or reflectance, to be written before `send`.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        faces: NDArray[np.integer[Any]],
        count: int,
        finish: Finish,
        *,
        unlit: bool = False,
    ) -> None:
        self._scene, self._name = scene, name
        self._file, self.positions, self.colors = _file(faces, count, finish, unlit=unlit)
        self._handle: viser.GlbHandle | None = None
        self._visible = True

    @property
    def visible(self) -> bool:
        """Whether it is drawn."""
        return self._visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        self._visible = visible
        if self._handle is not None:
            self._handle.visible = visible

    def send(self) -> None:
        """Show the places and colours as they are now."""
        if self._handle is None:
            self._handle = self._scene.add_glb(
                self._name,
                bytes(self._file),
                cast_shadow=False,
                receive_shadow=False,
                visible=self._visible,
            )
        else:
            self._handle.glb_data = bytes(self._file)

    def remove(self) -> None:
        """Take it off the scene."""
        if self._handle is not None:
            self._handle.remove()
            self._handle = None


def keep_finish(scene: viser.SceneApi, name: str, finish: Finish, *, unlit: bool = False) -> None:
    """Add a triangle too small to be seen that keeps the page's shader for a finish."""
    file, positions, colors = _file(np.array([[0, 1, 2]]), 3, finish, unlit=unlit)
    positions[:] = 1.0e-3 * np.eye(3)
    colors[:] = 0.0
    scene.add_glb(name, bytes(file), cast_shadow=False, receive_shadow=False)


def _file(
    faces: NDArray[np.integer[Any]], count: int, finish: Finish, *, unlit: bool
) -> tuple[bytearray, NDArray[np.float32], NDArray[np.float32]]:
    """Return a GLB file and the views of its places and colours."""
    triangles = np.ascontiguousarray(faces, dtype="<u4")
    # Normals are found by the page, but without the attribute it would shade flat.
    sizes = [12 * count, 12 * count, 12 * count, triangles.nbytes]
    starts = np.concatenate([[0], np.cumsum(sizes)]).tolist()
    views: list[dict[str, Any]] = [
        {"buffer": 0, "byteOffset": start, "byteLength": size, "target": _VERTICES}
        for start, size in zip(starts, sizes, strict=False)
    ]
    views[3]["target"] = _INDICES
    vectors: list[dict[str, Any]] = [
        {"bufferView": view, "componentType": _FLOAT, "count": count, "type": "VEC3"}
        for view in range(3)
    ]
    vectors[0] |= {"min": [-_BOUND] * 3, "max": [_BOUND] * 3}
    indices = {
        "bufferView": 3,
        "componentType": _UINT32,
        "count": triangles.size,
        "type": "SCALAR",
    }
    attributes = {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2}
    material = _material(finish, unlit=unlit)
    tree: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 3, "material": 0}]}],
        "materials": [material],
        "accessors": [*vectors, indices],
        "bufferViews": views,
        "buffers": [{"byteLength": starts[-1]}],
    }
    if material.get("extensions"):
        tree["extensionsUsed"] = sorted(material["extensions"])
    text = json.dumps(tree, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIII4s", b"glTF", 2, 28 + len(text) + starts[-1], len(text), b"JSON")
    head += text + struct.pack("<I4s", starts[-1], b"BIN\0")
    file = bytearray(len(head) + starts[-1])
    file[: len(head)] = head
    body = np.frombuffer(file, np.uint8, offset=len(head))
    body[starts[3] :] = triangles.reshape(-1).view(np.uint8)
    positions, colors = (
        body[starts[view] : starts[view + 1]].view("<f4").reshape(count, 3) for view in (0, 2)
    )
    return file, positions, colors


def _material(finish: Finish, *, unlit: bool) -> dict[str, Any]:
    """Return glTF's description of a finish without its colour."""
    material: dict[str, Any] = {
        "pbrMetallicRoughness": {
            "roughnessFactor": finish.roughness,
            "metallicFactor": finish.metallic,
        }
    }
    extensions: dict[str, Any] = {}
    if unlit:
        extensions["KHR_materials_unlit"] = {}
    elif finish.clearcoat > 0.0:
        extensions["KHR_materials_clearcoat"] = {
            "clearcoatFactor": finish.clearcoat,
            "clearcoatRoughnessFactor": finish.clearcoat_roughness,
        }
    if extensions:
        material["extensions"] = extensions
    return material
