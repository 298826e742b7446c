"""The fewest bytes of a mesh of an organ's images, decimated and compressed by Draco."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Protocol

import numpy as np

from benchmarks.organ_sets import OrganSet
from benchmarks.peer_meshes import Mesh, contour_loft, cubes_mesh
from benchmarks.stopwatch import microseconds

LOFTS: dict[str, tuple[float, ...]] = {
    "corners": (24, 32, 48, 64, 96, 128),
    "smoothing": (0.0, 0.7, 1.0, 1.5, 2.0, 3.0),
    "rounding": (0.0, 0.1, 0.2, 0.3, 0.4),
    "size": (1.0, 0.9975, 0.995, 0.99),
    "aggression": (5.0, 6.0, 7.0, 9.0),
}
"""Settings of a loft and its decimation; the search changes one after the other."""

FIRST_LOFT = {"corners": 64, "smoothing": 1.0, "rounding": 0.1, "size": 0.9975, "aggression": 6.0}
ROUNDS = 2
CUBES_BLUR = (1.0, 2.0)
# Marching cubes give far more triangles than is useful: they are first brought down to these.
CUBES_FACES = 12_000

BITS = (8, 9, 10, 11, 12)
COMPRESSION_LEVEL = 10
# Steps of coordinates outside of these, in target errors, are wasteful or too coarse: a step's own
# error is its 12th part's root.
FINEST_STEP, COARSEST_STEP = 0.3, 3.5
AGGRESSIONS = (5.0, 6.0, 7.0)
CUBES_AGGRESSION = 6.0
FEWEST_FACES, MOST_FACES, NEVER = 60, 4000, 10**9
# Bisections over the number of triangles end within these: of meshes, and of their bits.
MESH_RATIO, FACE_RATIO = 1.06, 1.03
FINE_FACES = np.linspace(0.85, 1.02, 18)

MESHES_KEPT, PAIRS_KEPT = 6, 4
SEARCH_POINTS, CHECK_POINTS = 1500, 10_000


@dataclass(frozen=True, slots=True)
class DracoMesh:
    """A mesh, decimated, packed and unpacked."""

    mesh: str  # How it was made
    faces: int  # Its triangles
    aggression: float  # How fast the decimation was
    bits: int  # Of each coordinate
    size: int  # Bytes
    rms: float  # RMS distance of the unpacked mesh to the true surface, mm
    packed: bytes = field(repr=False)  # The bytes themselves

    def times(self, draco: Any, runs: int) -> tuple[float, float]:
        """Return the times to compress the mesh again and to decompress it."""
        mesh = draco.decode(self.packed)
        bits = {"quantization_bits": self.bits, "compression_level": COMPRESSION_LEVEL}
        pack = microseconds(lambda: draco.encode(mesh.points, mesh.faces, **bits), 1, runs)
        return 1e-6 * pack, 1e-6 * microseconds(lambda: draco.decode(self.packed), 1, runs)

    def __str__(self) -> str:
        return (
            f"{self.size} B: {self.mesh}, {self.faces} triangles (agg {self.aggression:g}), "
            f"{self.bits} bits"
        )


class TrueMesh(Protocol):
    """A mesh that is decimated itself, and that errors are distances to."""

    mesh: Mesh

    def rms(self, mesh: Mesh, count: int) -> float:
        """Return the RMS distance of a mesh, at so many of its points, mm."""
        ...


class DracoSearch:
    """Searches meshes, numbers of triangles and bits for the fewest bytes at an error."""

    def __init__(self, organ: OrganSet | TrueMesh, *, fewest: int = FEWEST_FACES) -> None:
        self.tried = 0  # Number of settings whose error was measured
        self._organ = organ
        self._fewest = fewest  # Triangles
        self._draco: Any = import_module("DracoPy")
        if isinstance(organ, OrganSet):
            import_module("skimage.measure")  # missing, it is to be said here and not in a search
        self._simplify = import_module("fast_simplification").simplify
        self._meshes: dict[str, Mesh] = {}
        self._decimated: dict[tuple[str, float, int], tuple[Mesh, float]] = {}

    def _fewest_faces(self, target: float) -> list[tuple[int, str, float, int]]:
        """Return (triangles, mesh, aggression, triangles asked for) within a target, best first."""
        found: dict[tuple[str, float], tuple[int, str, float, int]] = {}

        def count(name: str, aggression: float, made: Callable[[], Mesh]) -> int:
            if name not in self._meshes:
                self._meshes[name] = made()
            if (name, aggression) not in found:
                asked = least_count(
                    lambda faces: self._decimation(name, faces, aggression)[1] <= target,
                    self._fewest,
                    ratio=MESH_RATIO,
                )
                # The decimation may stop at more triangles than it is asked for.
                left = NEVER
                if asked is not None:
                    left = len(self._decimation(name, asked, aggression)[0][1])
                found[name, aggression] = left, name, aggression, asked or NEVER
            return found[name, aggression][0]

        if not isinstance(self._organ, OrganSet):
            whole = self._organ.mesh
            for aggression in AGGRESSIONS:
                count("mesh", aggression, lambda: whole)
            return sorted(one for one in found.values() if one[0] < NEVER)
        organ = self._organ

        def loft(settings: dict[str, Any]) -> int:
            shape = {key: value for key, value in settings.items() if key != "aggression"}
            name = "loft, " + ", ".join(f"{key} {value:g}" for key, value in shape.items())
            return count(
                name, settings["aggression"], lambda: contour_loft(organ.contours, **shape)
            )

        best: dict[str, Any] = FIRST_LOFT
        for _ in range(ROUNDS):
            before = best
            for key, values in LOFTS.items():
                best = min(({**best, key: value} for value in values), key=loft)
            if best == before:
                break
        for blur in CUBES_BLUR:
            name = f"marching cubes, blur {blur:g}"
            cubes = cubes_mesh(organ.stack, blur, 1)
            count(
                name,
                CUBES_AGGRESSION,
                lambda mesh=cubes: self._fewer(mesh, CUBES_FACES, CUBES_AGGRESSION),
            )
        return sorted(one for one in found.values() if one[0] < NEVER)

    def _fewer(self, mesh: Mesh, faces: int, aggression: float) -> Mesh:
        vertices, triangles = mesh
        if faces >= len(triangles):
            return mesh
        middle = vertices.mean(axis=0)
        few, left = self._simplify(
            (vertices - middle).astype(np.float32),
            triangles.astype(np.int32),
            target_count=faces,
            agg=aggression,
        )
        return few.astype(np.float64) + middle, np.asarray(left, dtype=np.int64)

    def _decimation(self, name: str, faces: int, aggression: float) -> tuple[Mesh, float]:
        """Return a mesh decimated to about so many triangles, and its error, mm."""
        key = (name, aggression, faces)
        if key not in self._decimated:
            mesh = self._fewer(self._meshes[name], faces, aggression)
            self.tried += 1
            self._decimated[key] = mesh, self._organ.rms(mesh, SEARCH_POINTS)
        return self._decimated[key]

    def _packed(self, name: str, faces: int, aggression: float, bits: int) -> DracoMesh:
        """Return a mesh packed, with its error after it."""
        (vertices, triangles), _ = self._decimation(name, faces, aggression)
        packed = self._draco.encode(
            vertices.astype(np.float32),
            triangles.astype(np.uint32),
            quantization_bits=bits,
            compression_level=COMPRESSION_LEVEL,
        )
        self.tried += 1
        rms = self._organ.rms(self._unpacked(packed), SEARCH_POINTS)
        return DracoMesh(name, len(triangles), aggression, bits, len(packed), rms, packed)

    def _unpacked(self, packed: bytes) -> Mesh:
        mesh = self._draco.decode(packed)
        return np.asarray(mesh.points, np.float64), np.asarray(mesh.faces, np.int64)

    def best(self, target: float) -> DracoMesh | None:
        """Return the smallest mesh whose error is a target at most."""
        good: list[DracoMesh] = []
        pairs: list[DracoMesh] = []
        for _, name, aggression, asked in self._fewest_faces(target)[:MESHES_KEPT]:
            extent = float(np.ptp(self._meshes[name][0], axis=0).max())
            for bits in BITS:
                if not FINEST_STEP < extent / 2**bits / target < COARSEST_STEP:
                    continue
                tries: list[DracoMesh] = []

                def reaches(
                    faces: int, name=name, aggression=aggression, bits=bits, tries=tries
                ) -> bool:
                    tries.append(self._packed(name, faces, aggression, bits))
                    return tries[-1].rms <= target

                least_count(reaches, asked, 3 * asked)
                enough = [mesh for mesh in tries if mesh.rms <= target]
                if enough:
                    pairs.append(min(enough, key=lambda mesh: mesh.size))
                    good += enough
        for pair in sorted(pairs, key=lambda mesh: mesh.size)[:PAIRS_KEPT]:
            for aggression in AGGRESSIONS:
                for faces in np.unique(np.rint(pair.faces * FINE_FACES).astype(int)).tolist():
                    if self._decimation(pair.mesh, faces, aggression)[1] <= target:
                        good.append(self._packed(pair.mesh, faces, aggression, pair.bits))
        for mesh in sorted(good, key=lambda mesh: mesh.size):
            if mesh.rms > target:
                continue
            rms = self._organ.rms(self._unpacked(mesh.packed), CHECK_POINTS)
            if rms <= target:
                return DracoMesh(
                    mesh.mesh, mesh.faces, mesh.aggression, mesh.bits, mesh.size, rms, mesh.packed
                )
        return None


def least_count(
    enough: Callable[[int], bool],
    fewest: int = FEWEST_FACES,
    most: int = MOST_FACES,
    ratio: float = FACE_RATIO,
) -> int | None:
    """Return about the least number that is enough, found by bisection of its logarithm."""
    if not enough(most):
        return None
    low, high = fewest, most
    while high / low > ratio and high - low > 1:
        middle = round(math.sqrt(low * high))
        if enough(middle):
            high = middle
        else:
            low = middle
    return high
