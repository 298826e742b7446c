"""How near tubes found in labels come to the meshes that the labels were made from, and how small.

``python -m benchmarks.label_tubes`` prints a table of docs/anatomy-method.md. It needs volumes of
an anatomy atlas in `BLUNTDISSECT_DATA`, and ``--draco`` what `pip install .[bench]` installs.
``--held-out 20`` prints another: cases of so many seeds as labels, turned, flipped, in cubes and in
thick slices, with wrong labels, and how many of their tubes and joins are found.
"""

import argparse
import json
import time
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy import ndimage

from app.anatomy import Anatomy, anatomy_labels, drawn_anatomy, tube_lines
from app.anatomy.tables import HEAD_RIGHT_FRONT, JoinTable, Place
from benchmarks.draco_peer import DracoSearch
from benchmarks.organ_sets import DATA
from benchmarks.peer_meshes import Mesh
from benchmarks.surface_distance import TriangleSurface, spread_points
from organ_geometry import (
    ImageStackError,
    LabelTube,
    LabelTubes,
    LabelVolume,
    found_tubes,
    read_labels,
)
from organ_geometry.images.medical_file import MedicalHeader, write_values
from organ_geometry.mesh import organ_skin

Floats = NDArray[np.float64]

ATLAS = DATA / "calot_atlas"
MESHES = {
    1: ("FJ2817",), 2: ("FJ3080",), 3: ("FJ3079",), 4: ("FJ3123",), 5: ("FJ3096",),
    6: ("FJ3081",), 7: ("FJ3117", "FJ3076"), 8: ("FJ3095",), 9: ("FJ3078",), 10: ("FJ3432",),
    11: ("FJ3082", "FJ3122", "FJ3102"),
}  # fmt: skip
"""The atlas's meshes of each label that is a tube."""
POINTS = 6000
# Held-out cases: seeds that nothing was tuned on, sizes of their voxels, and the share of border
# voxels that have a neighbour's label.
FIRST_SEED = 9001
HELD_OUT_SIZES = ((0.8, 0.8, 1.5), (0.5, 0.5, 0.5))
WRONG_FRACTION = 0.02
THINNEST = 1.0  # radius in voxels: nobody draws a thinner tube
# A tube is found if its axis is so near, in its radii, and its radius within this part.
NEAR_RADII, NEAR_RADIUS = 0.35, 0.15
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


@dataclass
class HeldOut:
    """What was found in volumes of one kind."""

    volumes: int = 0
    tubes: int = 0
    tubes_found: int = 0  # with axis and radius near
    joins: int = 0
    joins_found: int = 0  # of the tubes that join
    joins_near: int = 0  # of these, where they are
    joins_false: int = 0
    refused: list[str] = field(default_factory=list[str])
    wrong: list[str] = field(default_factory=list[str])


def held_out_volume(
    seed: int, sizes: tuple[float, float, float]
) -> tuple[LabelVolume, Anatomy, dict[str, Floats]]:
    """Return a drawn case as labels, the case, and its tubes' axes and radii in LPS, (N, 4) mm."""
    # It is turned at random, voxels at borders have a neighbour's label, and all are stored along
    # axes that run either way.
    random = np.random.default_rng(seed)
    drawn = drawn_anatomy(seed)
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    rows = np.array(HEAD_RIGHT_FRONT) @ turn
    place = Place(
        origin_LPS_mm=(0.0, 0.0, 0.0),
        rows_LPS=tuple(tuple(row) for row in rows.tolist()),  # pyright: ignore[reportArgumentType]
    )
    anatomy = msgspec.structs.replace(drawn, place=place)
    lines = tube_lines(drawn)
    volume = anatomy_labels(anatomy, lines, sizes)
    values = volume.values.copy()
    border = ndimage.grey_dilation(values, 3) != ndimage.grey_erosion(values, 3)
    places = np.argwhere(border)
    wrong = places[random.random(len(places)) < WRONG_FRACTION]
    beside = wrong + random.integers(-1, 2, wrong.shape)
    beside = np.clip(beside, 0, np.array(values.shape) - 1)
    values[tuple(wrong.T)] = volume.values[tuple(beside.T)]
    flips = random.random(3) < 0.5  # of I, J, K
    stored = np.flip(values, axis=tuple((2 - np.flatnonzero(flips)).tolist()))
    last = np.where(flips, np.array(values.shape[::-1]) - 1, 0)
    header = MedicalHeader(
        size=stored.shape[::-1],
        spacing=tuple(volume.sizes.tolist()),
        origin=tuple(volume.places(last[np.newaxis])[0].tolist()),
        direction=tuple((volume.axes * np.where(flips, -1.0, 1.0)).ravel().tolist()),
        components=1,
        value_bytes=2,
        tags={},
    )
    with TemporaryDirectory() as folder:
        file = Path(folder) / "labels.nrrd"
        write_values(file, np.ascontiguousarray(stored.astype(np.uint16)), header)
        read = read_labels(file)
    truth = {
        name: np.column_stack([line.places @ rows, line.radius]) for name, line in lines.items()
    }
    return read, anatomy, truth


def held_out(seeds: range, sizes: tuple[float, float, float]) -> HeldOut:
    """Return what is found in the volumes of some seeds."""
    out = HeldOut()
    for seed in seeds:
        volume, anatomy, truth = held_out_volume(seed, sizes)
        names = {
            label: name
            for label, (name, rows) in enumerate(truth.items(), start=1)
            if rows[:, 3].mean() > THINNEST * np.prod(sizes) ** (1.0 / 3.0)
        }
        truth = {name: truth[name] for name in names.values()}
        joins = [join for join in anatomy.join if {join.tube, join.to} <= truth.keys()]
        out.volumes += 1
        out.tubes += len(truth)
        out.joins += len(joins)
        try:
            found = found_tubes(volume, names).tubes()
        except ImageStackError as error:
            out.refused.append(f"{seed}: {error}")
            continue
        for name, rows in truth.items():
            fault = _tube_fault(found, name, rows)
            out.tubes_found += not fault
            out.wrong += [f"{seed}: {name} {fault}"] if fault else []
        away, wrong = _joins(found, joins, truth)
        out.joins_found += len(away)
        out.joins_near += sum(each < 1.0 for each in away)
        out.joins_false += len(found.joins) - len(away)
        out.wrong += [f"{seed}: {each}" for each in wrong]
    return out


def _tube_fault(found: LabelTubes, name: str, truth: Floats) -> str:
    """Return what is wrong with a tube beside its true axis and radii, or nothing."""
    organ = found.tube(name).built.organ
    at = np.linspace(0.0, organ.length, 60)
    # Ends are led into other tubes: the middle counts.
    at = at[(at > 0.15 * organ.length) & (at < 0.85 * organ.length)]
    away = np.linalg.norm(organ.axis_at(at)[:, np.newaxis] - truth[:, :3], axis=2)
    nearest = away.argmin(axis=1)
    off = float(np.sqrt(np.mean(away.min(axis=1) ** 2)))
    radius = float(np.sqrt(organ.section_properties(at).area / np.pi).mean())
    true = float(truth[nearest, 3].mean())
    if off > NEAR_RADII * true:
        return f"has its axis {off:.2f} mm off, of a radius of {true:.2f} mm"
    if abs(radius / true - 1.0) > NEAR_RADIUS:
        return f"has a radius of {radius:.2f} mm, not {true:.2f} mm"
    return ""


def _joins(
    found: LabelTubes, joins: list[JoinTable], truth: dict[str, Floats]
) -> tuple[list[float], list[str]]:
    """Return of each join found how far off it is, of the thicker radius, and what is wrong."""
    wanted = [
        (frozenset((join.tube, join.to)), truth[join.tube][-join.end, :3], truth[join.to])
        for join in joins
    ]
    away: list[float] = []
    wrong: list[str] = []
    for join in found.joins:
        place = found.tube(join.tube).axis.places[-join.end]
        pair = frozenset((join.tube, join.to))
        mine = [each for each in wanted if each[0] == pair]
        if not mine:
            wrong.append(f"{join.tube} does not join {join.to}")
            continue
        nearest = min(mine, key=lambda each: float(np.linalg.norm(each[1] - place)))
        wanted = [each for each in wanted if each is not nearest]
        off = float(np.linalg.norm(nearest[1] - place))
        away.append(off / max(2.0, float(np.median(nearest[2][:, 3]))))
        if away[-1] >= 1.0:
            wrong.append(f"{join.tube} joins {join.to} {off:.1f} mm off")
    wrong += [f"{' and '.join(sorted(tubes))} are not joined" for tubes, _, _ in wanted]
    return away, wrong


def print_held_out(count: int) -> None:
    """Measure and print the table of held-out cases."""
    print("| voxels, mm | volumes | refused | tubes found | joins found | near | false |")
    print("|---|---|---|---|---|---|---|", flush=True)
    notes: list[str] = []
    for sizes in HELD_OUT_SIZES:
        found = held_out(range(FIRST_SEED, FIRST_SEED + count), sizes)
        size = " x ".join(f"{each:g}" for each in sizes)
        print(
            f"| {size} | {found.volumes} | {len(found.refused)} | {found.tubes_found} of "
            f"{found.tubes} | {found.joins_found} of {found.joins} | {found.joins_near} | "
            f"{found.joins_false} |",
            flush=True,
        )
        notes += [f"{size}, seed {each}" for each in (*found.refused, *found.wrong)]
    print("\n".join(["", *notes]))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.label_tubes", description=__doc__)
    parser.add_argument("--draco", action="store_true", help="Search Draco's fewest bytes, too.")
    parser.add_argument(
        "--held-out", type=int, default=0, metavar="N", help="Cases of N seeds in place of these."
    )
    chosen = parser.parse_args()
    if chosen.held_out:
        print_held_out(chosen.held_out)
        return
    if not ATLAS.is_dir():
        parser.error(f"{ATLAS} is not here; set BLUNTDISSECT_DATA")
    columns: list[dict[str, TubeFigures]] = []
    notes: list[str] = []
    for name in ("labels", "labels_hard"):
        volume = read_labels(ATLAS / f"{name}.nii.gz")
        started = time.process_time()
        found = found_tubes(volume, atlas_names()).tubes()
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
