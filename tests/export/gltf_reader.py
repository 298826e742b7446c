"""A reader of GLB files that moves what is in them as the specification says, in numpy alone."""

import json
import struct
from typing import Any

import numpy as np

COMPONENTS: dict[int, Any] = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Gltf:
    """A GLB: its tree, its arrays, and where its vertices are at a time of an animation."""

    def __init__(self, content: bytes) -> None:
        magic, version, length = struct.unpack_from("<4sII", content)
        assert (magic, version, length) == (b"glTF", 2, len(content))
        size, kind = struct.unpack_from("<I4s", content, 12)
        assert kind == b"JSON"
        self.tree: dict[str, Any] = json.loads(content[20 : 20 + size])
        self.parents = {
            child: number
            for number, node in enumerate(self.tree["nodes"])
            for child in node.get("children", ())
        }
        rest = content[20 + size :]
        assert rest[4:8] == b"BIN\0"
        self._buffer = rest[8:]

    def array(self, number: int) -> np.ndarray:
        """(N, C) numbers of an accessor; (N,) if they are single."""
        item = self.tree["accessors"][number]
        width = WIDTHS[item["type"]]
        shape = (item["count"], width) if width > 1 else (item["count"],)
        if "bufferView" in item:
            found = self._view(
                item["bufferView"], item["componentType"], shape, item.get("byteOffset", 0)
            ).copy()
        else:
            found = np.zeros(shape, COMPONENTS[item["componentType"]])
        if "sparse" in item:
            sparse = item["sparse"]
            count = sparse["count"]
            places = self._view(
                sparse["indices"]["bufferView"], sparse["indices"]["componentType"], (count,), 0
            )
            found[places] = self._view(
                sparse["values"]["bufferView"], item["componentType"], (count, *shape[1:]), 0
            )
        if item.get("normalized"):
            return found / np.iinfo(COMPONENTS[item["componentType"]]).max
        return found

    def _view(self, view: int, component: int, shape: tuple[int, ...], offset: int) -> np.ndarray:
        start = self.tree["bufferViews"][view]["byteOffset"] + offset
        kind = COMPONENTS[component]
        return np.frombuffer(self._buffer, kind, int(np.prod(shape)), start).reshape(shape)

    def node(self, name: str) -> int:
        """Number of the node that shows the mesh of that name."""
        (mesh,) = [k for k, each in enumerate(self.tree["meshes"]) if each.get("name") == name]
        (found,) = [k for k, each in enumerate(self.tree["nodes"]) if each.get("mesh") == mesh]
        return found

    def primitives(self, node: str) -> list[dict[str, Any]]:
        """The primitives of a node's mesh."""
        return self.tree["meshes"][self.tree["nodes"][self.node(node)]["mesh"]]["primitives"]

    def duration(self, animation: str) -> float:
        """When the last key of an animation is, s."""
        return max(
            float(self.array(sampler["input"])[-1])
            for sampler in self._animation(animation)["samplers"]
        )

    def _animation(self, name: str) -> dict[str, Any]:
        (found,) = [each for each in self.tree["animations"] if each["name"] == name]
        return found

    def _state(self, animation: str | None, time: float) -> dict[tuple[int, str], np.ndarray]:
        """What an animation sets at a time, by node and path."""
        if animation is None:
            return {}
        item = self._animation(animation)
        state: dict[tuple[int, str], np.ndarray] = {}
        for channel in item["channels"]:
            sampler = item["samplers"][channel["sampler"]]
            times = self.array(sampler["input"])
            values = self.array(sampler["output"])
            values = values.reshape(len(times), -1)
            after = int(np.clip(np.searchsorted(times, time, side="right"), 1, len(times)))
            before = after - 1
            value = values[before]
            if sampler["interpolation"] == "LINEAR" and after < len(times) and time > times[before]:
                fraction = (time - times[before]) / (times[after] - times[before])
                value = (1.0 - fraction) * value + fraction * values[after]
                if channel["target"]["path"] == "rotation":
                    value = value / np.linalg.norm(value)
            state[channel["target"]["node"], channel["target"]["path"]] = value
        return state

    def vertices(
        self, name: str, animation: str | None = None, time: float = 0.0
    ) -> list[np.ndarray]:
        """(V, 3) places of each primitive of a skinned node, m, at rest without an animation."""
        state = self._state(animation, time)
        node = self.tree["nodes"][self.node(name)]
        mesh = self.tree["meshes"][node["mesh"]]
        skin = self.tree["skins"][node["skin"]]
        worlds: dict[int, np.ndarray] = {}
        joints = np.stack([self._world(joint, state, worlds) for joint in skin["joints"]])
        binds = self.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
        matrices = joints @ binds
        weights = state.get((self.node(name), "weights"), np.array(mesh.get("weights", [])))
        found: list[np.ndarray] = []
        for primitive in mesh["primitives"]:
            attributes = primitive["attributes"]
            places = self.array(attributes["POSITION"]).astype(np.float64)
            for weight, target in zip(weights, primitive.get("targets", []), strict=True):
                places += weight * self.array(target["POSITION"])
            follows = self.array(attributes["JOINTS_0"])
            raw_weights = self.array(attributes["WEIGHTS_0"])
            blended = np.einsum("vk,vkij->vij", raw_weights, matrices[follows])
            ones = np.concatenate([places, np.ones((len(places), 1))], axis=1)
            found.append(np.einsum("vij,vj->vi", blended, ones)[:, :3])
        return found

    def _world(
        self,
        number: int,
        state: dict[tuple[int, str], np.ndarray],
        worlds: dict[int, np.ndarray],
    ) -> np.ndarray:
        """A node's matrix to the scene; those found before are in `worlds`."""
        if number not in worlds:
            matrix, parent = self._matrix(number, state), self.parents.get(number)
            if parent is not None:
                matrix = self._world(parent, state, worlds) @ matrix
            worlds[number] = matrix
        return worlds[number]

    def _matrix(self, number: int, state: dict[tuple[int, str], np.ndarray]) -> np.ndarray:
        node = self.tree["nodes"][number]
        x, y, z, w = state.get((number, "rotation"), np.array((0.0, 0.0, 0.0, 1.0)))
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        matrix = np.eye(4)
        matrix[:3, :3] = turn * np.asarray(
            state.get((number, "scale"), node.get("scale", (1,) * 3))
        )
        matrix[:3, 3] = state.get((number, "translation"), node.get("translation", (0, 0, 0)))
        return matrix
