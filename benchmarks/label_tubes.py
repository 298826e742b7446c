"""How near tubes found in labels come to the meshes that the labels were made from, and how small.

``python -m benchmarks.label_tubes`` prints the table of docs/anatomy.md. It needs the volumes of an
anatomy atlas in `BLUNTDISSECT_DATA`, and ``--draco`` what `pip install .[bench]` installs.
"""

import argparse
import json
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy import ndimage

from benchmarks.draco_peer import DracoSearch
from benchmarks.organ_sets import DATA
from benchmarks.peer_meshes import Mesh
from benchmarks.surface_distance import TriangleSurface, spread_points
from organ_geometry import LabelTube, LabelTubes, LabelVolume, read_labels, tubes_of_labels
from organ_geometry.mesh import organ_skin

__all__ = ["ATLAS", "MESHES", "TubeFigures", "atlas_names", "join_gaps", "tube_figures"]

Floats = NDArray[np.float64]

ATLAS = DATA / "calot_atlas"
MESHES = {
    1: ("FJ2817",), 2: ("FJ3080",), 3: ("FJ3079",), 4: ("FJ3123",), 5: ("FJ3096",),
    6: ("FJ3081",), 7: ("FJ3117", "FJ3076"), 8: ("FJ3095",), 9: ("FJ3078",), 10: ("FJ3432",),
    11: ("FJ3082", "FJ3122", "FJ3102"),
}  # fmt: skip
"""The atlas's meshes of each label that is a tube."""
POINTS = 6000
# Draco meshes of thin tubes have few triangles.
FEWEST_FACES = 20


@dataclass(frozen=True)
class TubeFigures:
    """A label's tube and its branches beside the meshes that it was made from; lengths in mm."""

    radius: float  # of the organ, mean
    wall: float  # RMS distance of the organ's wall to the meshes, outside other tubes' labels
    back: float  # of the meshes, where they border on no other tube, to the skin with its ends
    size: int  # bytes
    truth: "TrueMeshes" = field(repr=False)


class TrueMeshes:
    """A label's meshes: errors of other meshes are distances to them."""

    def __init__(self, folder: Path, label: int) -> None:
        files = [folder / "reference" / f"{name}.obj" for name in MESHES[label]]
        mesh: Any = trimesh.util.concatenate([trimesh.load_mesh(file) for file in files])
        self.mesh: Mesh = (np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64))
        self.surface = TriangleSurface(*self.mesh)

    def rms(self, mesh: Mesh, count: int) -> float:
        """Return the RMS distance of a mesh to these, mm."""
        return _rms(self.surface.distances(spread_points(*mesh, count)[0]))


def atlas_names(folder: Path = ATLAS) -> dict[int, str]:
    """Return the names of the atlas's labels that are tubes."""
    names = json.loads((folder / "labels.json").read_text())
    return {label: names[str(label)] for label in MESHES}


def tube_figures(
    found: LabelTubes, volume: LabelVolume, folder: Path = ATLAS
) -> dict[str, TubeFigures]:
    """Return the figures of each label's tubes, by the name of its first."""
    tubes = np.where(np.isin(volume.values, list(MESHES)), volume.values, 0)
    figures: dict[str, TubeFigures] = {}
    for label, name in atlas_names(folder).items():
        mine = [tube for tube in found.tubes if tube.label == label]
        truth = TrueMeshes(folder, label)
        others = np.where(tubes == label, 0, tubes)
        beside: Any = ndimage.binary_dilation(others > 0, np.ones((3, 3, 3)))
        walls = [
            _outside(points, [each for each in mine if each is not tube])
            for tube in mine
            for points in [_skin_points(tube, ends=False)]
        ]
        points = np.concatenate(walls)
        wall = truth.surface.distances(points[~_at(volume, others > 0, points, beyond=False)])
        skins = [TriangleSurface(*_skin(tube, ends=True)) for tube in mine]
        places, _ = spread_points(*truth.mesh, POINTS)
        places = places[~_at(volume, beside, places, beyond=True)]
        back = np.min([skin.distances(places) for skin in skins], axis=0)
        organs = [tube.built.organ for tube in mine]
        figures[name] = TubeFigures(
            radius=organs[0].mean_radius,
            wall=_rms(wall),
            back=_rms(back),
            size=sum(len(organ.encoded) for organ in organs),
            truth=truth,
        )
    return figures


def join_gaps(found: LabelTubes) -> dict[tuple[str, str], float]:
    """Return how far apart the surfaces of tubes that join are, mm; 0 where they overlap."""
    skins = {tube.name: _skin(tube, ends=True) for tube in found.tubes}
    gaps: dict[tuple[str, str], float] = {}
    union: Any = trimesh.boolean.union
    for join in found.joins:
        pair = [trimesh.Trimesh(*skins[name], process=False) for name in (join.tube, join.to)]
        gap = 0.0
        if union(pair, engine="manifold").body_count > 1:
            gap = float(TriangleSurface(*skins[join.to]).distances(skins[join.tube][0]).min())
        gaps[join.tube, join.to] = gap
    return gaps


def _rms(distances: Floats) -> float:
    return float(np.sqrt(np.mean(distances**2)))


def _skin(tube: LabelTube, *, ends: bool) -> Mesh:
    organ = tube.built.organ
    skin = organ_skin(organ, edge_length=max(0.15, 0.12 * organ.mean_radius))
    faces = skin.faces if ends else skin.faces[: 2 * (skin.rings - 1) * skin.sides]
    return skin.vertices.astype(np.float64), faces.astype(np.int64)


def _skin_points(tube: LabelTube, *, ends: bool) -> Floats:
    return spread_points(*_skin(tube, ends=ends), POINTS)[0]


def _outside(points: Floats, tubes: list[LabelTube]) -> Floats:
    """Return the points that lie in none of some tubes."""
    for tube in tubes:
        near = [tube.axis.nearest(point) for point in points]
        points = points[[away > tube.axis.radius_at(station) for station, away in near]]
    return points


def _at(
    volume: LabelVolume, mask: NDArray[np.bool_], places: Floats, *, beyond: bool
) -> NDArray[np.bool_]:
    """Return what a mask has at places, and something else beyond the volume."""
    indices = np.rint(volume.indices(places)).astype(int)
    shape = np.array(mask.shape[::-1])
    there = ((indices >= 0) & (indices < shape)).all(axis=1)
    i, j, k = np.clip(indices, 0, shape - 1).T
    return np.where(there, mask[k, j, i], beyond)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.label_tubes", description=__doc__)
    parser.add_argument("--draco", action="store_true", help="Search Draco's fewest bytes, too.")
    chosen = parser.parse_args()
    if not ATLAS.is_dir():
        parser.error(f"{ATLAS} is not here; set BLUNTDISSECT_DATA")
    columns: list[dict[str, TubeFigures]] = []
    notes: list[str] = []
    for name in ("labels", "labels_hard"):
        volume = read_labels(ATLAS / f"{name}.nii.gz")
        started = time.process_time()
        found = tubes_of_labels(volume, atlas_names())
        seconds = time.process_time() - started
        columns.append(tube_figures(found, volume))
        station = next(
            join.station
            for join in found.joins
            if (join.tube, join.to) == ("cystic_duct", "common_duct")
        )
        gaps = join_gaps(found)
        notes.append(
            f"{name}: {len(gaps)} joins, the widest gap {max(gaps.values()):.2f} mm; the cystic "
            f"duct at {station:.1f} mm; {seconds:.0f} s of one processor"
        )
    print("| tube | radius, mm | 0.45 mm cubes: wall | back | thick slices: wall | back | bytes |")
    print("|---|---|---|---|---|---|---|")
    clean, hard = columns
    draco = 0
    for name, figures in clean.items():
        cells = [
            f"{each.wall:.3f}, {100.0 * each.wall / each.radius:.1f} % | {each.back:.3f}"
            for each in (figures, hard[name])
        ]
        title = name.replace("_", " ")
        size = str(figures.size)
        if chosen.draco:
            search = DracoSearch(figures.truth, fewest=FEWEST_FACES)
            best = search.best(figures.wall)
            draco += 0 if best is None else best.size
            size += f" ({'none' if best is None else best.size})"
        print(f"| {title} | {figures.radius:.2f} | {' | '.join(cells)} | {size} |", flush=True)
    total = sum(figures.size for figures in clean.values())
    print(f"| all, of the cubes | | | | | | {total} |")
    if chosen.draco:
        notes.append(f"Draco's fewest bytes at the same RMS: {draco}, {draco / total:.1f} times")
    print("\n".join(["", *notes]))


if __name__ == "__main__":
    main()
