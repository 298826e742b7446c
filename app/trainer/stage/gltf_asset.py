"""Binary glTF of still parts: trimesh writes the geometry, the finish is added to its tree."""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.exchange.gltf import (
    export_glb,  # pyright: ignore[reportUnknownVariableType]
)
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from app.trainer.stage.solids import Solid

_LINEAR_FILTER, _MIPMAP_FILTER, _REPEAT = 9729, 9987, 10497
_SRGB_TOE = 0.04045


@dataclass(frozen=True, slots=True)
class Finish:
    """What a surface looks like under light.

    Attributes
    ----------
    color
        sRGB colour, 0 to 255; multiplied with `base_jpeg` where there is one.
    roughness, metallic
        0 to 1, as in glTF's metallic-roughness model. Above a metallic of about 0.8 steel turns
        black without an environment map.
    clearcoat, clearcoat_roughness
        0 to 1: a wet film over the surface.
    specular
        0 to 1: strength of the dielectric highlight.
    base_jpeg, normal_jpeg
        JPEG files for colour and tangent-space normals, or empty.
    """

    color: tuple[int, int, int] = (255, 255, 255)
    roughness: float = 0.5
    metallic: float = 0.0
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.2
    specular: float = 1.0
    base_jpeg: bytes = b""
    normal_jpeg: bytes = b""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A solid and its finish."""

    solid: Solid
    finish: Finish


def linear_rgb(color: tuple[int, int, int]) -> NDArray[np.float64]:
    """Return an sRGB colour as linear light.

    Parameters
    ----------
    color
        sRGB, 0 to 255.

    Returns
    -------
    NDArray[np.float64]
        (3,) linear, 0 to 1.

    Examples
    --------
    >>> linear_rgb((0, 255, 188)).round(2).tolist()
    [0.0, 1.0, 0.5]
    """
    srgb = np.asarray(color, np.float64) / 255.0
    return np.where(srgb <= _SRGB_TOE, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def binary_gltf(parts: Sequence[Part]) -> bytes:
    """Return one GLB file with every part, normals included."""
    scene = trimesh.Scene()
    for number, part in enumerate(parts):
        uv = part.solid.uv
        scene.add_geometry(  # pyright: ignore[reportUnknownMemberType]
            trimesh.Trimesh(
                vertices=part.solid.vertices,
                faces=part.solid.faces,
                vertex_normals=part.solid.normals,
                visual=TextureVisuals(uv=uv, material=PBRMaterial(name=str(number))),
                process=False,
            ),
            geom_name=str(number),
        )

    def add_finishes(buffers: "OrderedDict[Any, bytes]", tree: dict[str, Any]) -> None:
        for material in tree["materials"]:
            _write_finish(parts[int(material["name"])].finish, material, buffers, tree)

    file: bytes = export_glb(scene, include_normals=True, buffer_postprocessor=add_finishes)
    return file


def _write_finish(
    finish: Finish,
    material: dict[str, Any],
    buffers: "OrderedDict[Any, bytes]",
    tree: dict[str, Any],
) -> None:
    """Write a finish into a glTF material, adding its textures to the tree and the buffers."""
    surface: dict[str, Any] = {
        "baseColorFactor": [*linear_rgb(finish.color).round(5).tolist(), 1.0],
        "roughnessFactor": finish.roughness,
        "metallicFactor": finish.metallic,
    }
    if finish.base_jpeg:
        surface["baseColorTexture"] = {"index": _texture(finish.base_jpeg, buffers, tree)}
    if finish.normal_jpeg:
        material["normalTexture"] = {"index": _texture(finish.normal_jpeg, buffers, tree)}
    material["pbrMetallicRoughness"] = surface
    extensions: dict[str, Any] = {}
    if finish.clearcoat > 0.0:
        extensions["KHR_materials_clearcoat"] = {
            "clearcoatFactor": finish.clearcoat,
            "clearcoatRoughnessFactor": finish.clearcoat_roughness,
        }
    if finish.specular < 1.0:
        extensions["KHR_materials_specular"] = {"specularFactor": finish.specular}
    if extensions:
        material["extensions"] = extensions
        tree["extensionsUsed"] = sorted({*tree.get("extensionsUsed", ()), *extensions})


def _texture(jpeg: bytes, buffers: "OrderedDict[Any, bytes]", tree: dict[str, Any]) -> int:
    """Return the index of a new texture that holds the JPEG file."""
    tree.setdefault(
        "samplers",
        [
            {
                "magFilter": _LINEAR_FILTER,
                "minFilter": _MIPMAP_FILTER,
                "wrapS": _REPEAT,
                "wrapT": _REPEAT,
            }
        ],
    )
    # Buffers are cut into views one after the other, each starting at a multiple of four.
    buffers[f"jpeg {len(tree['images'])}"] = jpeg + b"\0" * (-len(jpeg) % 4)
    tree["images"].append({"bufferView": len(buffers) - 1, "mimeType": "image/jpeg"})
    tree["textures"].append({"source": len(tree["images"]) - 1, "sampler": 0})
    return len(tree["textures"]) - 1
