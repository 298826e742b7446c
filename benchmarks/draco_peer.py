"""The fewest bytes of a mesh made of an organ's images, decimated and packed by Draco.

``python -m benchmarks.draco_peer bile_duct_parallel`` prints the best settings found.
"""

import argparse
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.organ_sets import SETS, OrganSet, missing_sets
from benchmarks.peer_meshes import Mesh, contour_loft, cubes_mesh

__all__ = ["DracoMesh", "DracoSearch", "least_count"]

LOFT_CORNERS = (24, 32, 48, 64, 96)
LOFT_SMOOTHING = (0.0, 0.7, 1.0, 1.5)
LOFT_SIZES = (1.0, 0.995, 0.99)
CUBES_BLUR = (1.0, 2.0)
CUBES_FACES = 12_000
"""Marching cubes give far more triangles than is useful: they are first brought down to these."""

BITS = (8, 9, 10, 11, 12)
COMPRESSION_LEVEL = 10
FIRST_AGGRESSION = 5.0
AGGRESSIONS = (5.0, 6.0, 7.0)
FEWEST_FACES, MOST_FACES = 60, 4000
FACE_RATIO = 1.03
"""Bisections over the number of triangles end within this."""
FINE_FACES = np.linspace(0.85, 1.02, 18)

MESHES_KEPT, PAIRS_KEPT = 6, 4
SEARCH_POINTS, CHECK_POINTS = 1500, 10_000


@dataclass(frozen=True, slots=True)
class DracoMesh:
    """A mesh, decimated, packed and unpacked.

    Attributes
    ----------
    mesh
        How it was made.
    faces
        Its triangles.
    aggression
        How fast the decimation was.
    bits
        Of each coordinate.
    size
        Bytes.
    rms
        RMS distance of the unpacked mesh to the true surface, mm.
    packed
        The bytes themselves.
    """

    mesh: str
    faces: int
    aggression: float
    bits: int
    size: int
    rms: float
    packed: bytes = field(repr=False)

    def __str__(self) -> str:
        return (
            f"{self.size} B: {self.mesh}, {self.faces} triangles (agg {self.aggression:g}), "
            f"{self.bits} bits"
        )


class DracoSearch:
    """Searches meshes, numbers of triangles and bits for the fewest bytes at an error.

    Parameters
    ----------
    organ
        The organ.

    Attributes
    ----------
    tried
        Number of settings whose error was measured.
    """

    def __init__(self, organ: OrganSet) -> None:
        self.tried = 0
        self._organ = organ
        self._draco: Any = import_module("DracoPy")
        self._simplify = import_module("fast_simplification").simplify
        self._meshes = dict(self._made_meshes())
        self._decimated: dict[tuple[str, float, int], tuple[Mesh, float]] = {}

    def _made_meshes(self) -> Iterator[tuple[str, Mesh]]:
        contours = self._organ.contours
        for corners in LOFT_CORNERS:
            for smoothing in LOFT_SMOOTHING:
                for size in LOFT_SIZES:
                    name = f"loft of {corners} corners, smoothing {smoothing:g}, size {size:g}"
                    yield name, contour_loft(contours, corners, smoothing, size)
        for blur in CUBES_BLUR:
            mesh = cubes_mesh(self._organ.stack, blur, 1)
            yield f"marching cubes, blur {blur:g}", self._fewer(mesh, CUBES_FACES, 5.0)

    def _fewer(self, mesh: Mesh, faces: int, aggression: float) -> Mesh:
        """Return a mesh with about so many triangles."""
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
        """Return a mesh with about so many triangles, and its error, mm."""
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
        """Return the smallest mesh whose error is a target at most.

        First, each mesh's fewest triangles by decimation alone; with the best meshes, the fewest
        for each number of bits; around the best of those, numbers of triangles one by one.

        Parameters
        ----------
        target
            RMS distance to the true surface, mm.

        Returns
        -------
        DracoMesh or None
            The best one, its error measured anew with more points; None if none reaches the target.
        """
        fewest: dict[str, int] = {}
        for name in self._meshes:
            count = least_count(
                lambda faces, name=name: (
                    self._decimation(name, faces, FIRST_AGGRESSION)[1] <= target
                )
            )
            if count is not None:
                fewest[name] = count
        good: list[DracoMesh] = []
        pairs: list[DracoMesh] = []
        for name in sorted(fewest, key=fewest.__getitem__)[:MESHES_KEPT]:
            for bits in BITS:
                tries: list[DracoMesh] = []

                def reaches(faces: int, name=name, bits=bits, tries=tries) -> bool:
                    tries.append(self._packed(name, faces, FIRST_AGGRESSION, bits))
                    return tries[-1].rms <= target

                least_count(reaches, fewest[name], 3 * fewest[name])
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
    enough: Callable[[int], bool], fewest: int = FEWEST_FACES, most: int = MOST_FACES
) -> int | None:
    """Return about the least number that is enough, found by bisection of its logarithm.

    Parameters
    ----------
    enough
        Whether a number is enough.
    fewest, most
        Where to look, `most` included.

    Returns
    -------
    int or None
        A number that is enough, at most `FACE_RATIO` above one that is not; None if `most` is not
        enough.
    """
    if not enough(most):
        return None
    low, high = fewest, most
    while high / low > FACE_RATIO and high - low > 1:
        middle = round(math.sqrt(low * high))
        if enough(middle):
            high = middle
        else:
            low = middle
    return high


def main() -> None:
    """Search and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.draco_peer", description=__doc__)
    parser.add_argument("set", choices=SETS)
    parser.add_argument("--percent", type=float, nargs="+", default=[1.0, 2.0])
    chosen = parser.parse_args()
    if chosen.set in missing_sets():
        parser.error(f"{OrganSet(chosen.set).images} is not here; set BLUNTDISSECT_DATA")
    organ = OrganSet(chosen.set)
    started = time.perf_counter()
    search = DracoSearch(organ)
    print(f"{organ.name}: mean radius {organ.radius:.3f} mm")
    for percent in chosen.percent:
        best = search.best(0.01 * percent * organ.radius)
        found = "not reached" if best is None else f"{best}; {100 * best.rms / organ.radius:.3f} %"
        print(f"{percent:g} %: {found}", flush=True)
    print(f"{search.tried} settings in {time.perf_counter() - started:.0f} s")


if __name__ == "__main__":
    main()
