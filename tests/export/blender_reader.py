"""Opens GLB files in Blender and measures what it shows; run by the Python that has bpy.

Named on the command line: a folder for what is found, and the files. For each file it leaves
`NAME.json`, its objects, bones and tracks, and `NAME.npz`, the evaluated vertices of each mesh in
the world, m, as it opened and at times of each animation played by its tracks alone.
"""

import json
import sys
from pathlib import Path
from typing import Any

import bpy  # pyright: ignore[reportMissingImports]
import numpy as np

TIMES = 13
"""At how many times an animation is looked at, its first and its last among them."""


def evaluated(mesh: Any) -> np.ndarray:
    """(V, 3) places of a mesh's vertices in the world, with all that moves them."""
    seen = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get())
    places = np.empty((len(seen.data.vertices), 3))
    seen.data.vertices.foreach_get("co", places.ravel())
    world = np.array(seen.matrix_world)
    return places @ world[:3, :3].T + world[:3, 3]


def play(track: str) -> tuple[float, float]:
    """Let the tracks of one name play and no other; returns its first and its last frame."""
    frames: list[float] = []
    for item in (*bpy.data.objects, *bpy.data.shape_keys):
        if item.animation_data is None:
            continue
        item.animation_data.action = None
        for each in item.animation_data.nla_tracks:
            each.mute = each.name != track
            each.is_solo = False
            if not each.mute:
                frames += [end for s in each.strips for end in (s.frame_start, s.frame_end)]
    return min(frames), max(frames)


def bones(armature: Any) -> list[dict[str, Any]]:
    """Name, parent, length and head of each bone at rest, m in the world."""
    return [
        {
            "name": bone.name,
            "parent": bone.parent and bone.parent.name,
            "length": bone.length,
            "head": list(armature.matrix_world @ bone.head_local),
        }
        for bone in armature.data.bones
    ]


def read(path: Path, folder: Path) -> None:
    """Open a file in an empty Blender and keep what is seen."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(path))
    scene = bpy.context.scene
    # The importer keeps the shape that it draws bones with where it is not seen.
    objects = list(bpy.context.view_layer.objects)
    meshes = [item for item in objects if item.type == "MESH" and item.visible_get()]
    tracks = sorted(
        {
            track.name
            for item in (*objects, *bpy.data.shape_keys)
            if item.animation_data
            for track in item.animation_data.nla_tracks
        }
    )
    found: dict[str, np.ndarray] = {}
    times: dict[str, list[float]] = {}
    rate = scene.render.fps / scene.render.fps_base
    for mesh in meshes:
        found[f"opened/{mesh.name}"] = evaluated(mesh)
    for track in tracks:
        frames = np.linspace(*play(track), TIMES)
        times[track] = ((frames - frames[0]) / rate).tolist()
        for number, frame in enumerate(frames.tolist()):
            scene.frame_set(int(frame), subframe=frame % 1.0)
            for mesh in meshes:
                found[f"{track}/{number}/{mesh.name}"] = evaluated(mesh)
    report = {
        "blender": bpy.app.version_string,
        "objects": {item.name: item.type for item in objects if item.visible_get()},
        "hidden": [item.name for item in objects if not item.visible_get()],
        "parents": {item.name: item.parent and item.parent.name for item in objects},
        "armatures": {item.name: bones(item) for item in objects if item.type == "ARMATURE"},
        "materials": {mesh.name: [slot.name for slot in mesh.material_slots] for mesh in meshes},
        "colors": {
            mesh.name: [each.name for each in mesh.data.color_attributes] for mesh in meshes
        },
        "times": times,
        "unit": [scene.unit_settings.system, scene.unit_settings.scale_length],
    }
    (folder / f"{path.stem}.json").write_text(json.dumps(report))
    np.savez(folder / f"{path.stem}.npz", **found)  # pyright: ignore[reportArgumentType]


if __name__ == "__main__":
    for name in sys.argv[2:]:
        read(Path(name), Path(sys.argv[1]))
