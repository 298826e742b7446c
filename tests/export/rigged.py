"""Rigged organs for tests, and where their vertices ought to be."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from simulated import phantom

from app.export.motion import Motion
from app.export.pull_export import PullExport
from app.export.rigged_organ import rigged_organ
from app.simulation import PIECES, Specimen, preset_named
from organ_geometry.mesh.gltf_file import metres
from organ_geometry.mesh.skin import Skin, organ_skin
from organ_geometry.mesh.tear import TornPiece
from physics import Cubic, Exact, Theory

EDGE_LENGTH = 1.2


@dataclass(frozen=True)
class Rigged:
    """A rigged organ and what it was made of."""

    content: bytes
    order: PullExport
    skin: Skin
    pieces: tuple[TornPiece, TornPiece]
    motions: list[Motion]

    @property
    def radius(self) -> float:
        """Mean radius, m."""
        return 1e-3 * self.order.dissection.organ.mean_radius

    def rest(self, name: str) -> list[np.ndarray]:
        """(V, 3) places of each wall of a mesh at rest, m."""
        skin = self.skin if name == "organ" else self.pieces[PIECES.index(name)].skin
        return walls(skin, skin.vertices)

    def shown(self, motion: Motion, key: int) -> dict[str, list[np.ndarray]]:
        """What is to be seen at a key: places of each wall by mesh, by our own skinning, m."""
        driving, transforms = self.order.dissection.driving, motion.transforms[key]
        if motion.whole[key]:
            out = np.empty_like(self.skin.vertices)
            return {"organ": walls(self.skin, self.skin.bound_to(driving).deform(transforms, out))}
        found: dict[str, list[np.ndarray]] = {}
        for name, piece in zip(PIECES, self.pieces, strict=True):
            out = np.empty_like(piece.skin.vertices)
            piece.skin.bound_to(driving).deform(transforms, out)
            found[name] = walls(piece.skin, piece.open(float(motion.fronts[key]), out))
        return found


def walls(skin: Skin, vertices: np.ndarray) -> list[np.ndarray]:
    """Places of a skin's walls in glTF's frame."""
    return [metres(vertices[skin.side(side)[0]]) for side in ("outer", "inside")]


def keys_to_see(motion: Motion) -> list[int]:
    """Keys that are not hidden by another at the same time."""
    return [key for key in range(len(motion.times)) if key not in hidden(motion)]


def hidden(motion: Motion) -> set[int]:
    """The last key of the whole organ where the pieces take its place."""
    return set(np.flatnonzero(np.diff(motion.times) == 0.0).tolist())


@cache
def rigged(preset: str = "thesis-bile-duct", exact: bool = False) -> Rigged:
    """The phantom, rigged."""
    theory: Theory = Exact() if exact else Cubic()
    specimen = Specimen(preset_named(preset), phantom(), theory=theory)
    dissection = specimen.dissection
    order = PullExport(specimen, 0.4 * dissection.beam.span, frames=7, edge_length=EDGE_LENGTH)
    event = order.break_event
    assert event is not None
    skin = organ_skin(dissection.organ, edge_length=EDGE_LENGTH)
    pieces = dissection.torn_at(event.check, edge_length=EDGE_LENGTH)
    motions = order.motions()
    content = rigged_organ(
        skin, dissection.driving, motions, pieces, radius=dissection.organ.mean_radius
    )
    return Rigged(content, order, skin, pieces, motions)
