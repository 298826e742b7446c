"""The geometry benchmarks' own mathematics: distances, spread points, lofts and drawn tubes."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from benchmarks import draco_peer, geometry, organ_sets
from benchmarks.draco_peer import DracoSearch, least_count
from benchmarks.organ_sets import OrganSet
from benchmarks.peer_meshes import contour_loft, rings_of
from benchmarks.surface_distance import TriangleSurface, spread_points, triangle_distances
from benchmarks.tube_images import PERIOD, RADIUS, SIDE, SMOOTH, SWAY, draw_tube_images, tube_image
from organ_geometry.images.stack_reader import read_image_stack

TRIANGLE = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 3.0, 0.0]])


@pytest.mark.parametrize(
    ("point", "distance"),
    [
        ((1.0, 1.0, 2.0), 2.0),  # above the inside
        ((2.0, -3.0, 4.0), 5.0),  # beyond an edge
        ((-3.0, -4.0, 12.0), 13.0),  # beyond a corner
        ((4.0, 3.0, 0.0), 12.0 / 5.0),  # across the hypotenuse, in the plane
        ((2.0, 1.5, 0.0), 0.0),  # on an edge
    ],
)
@pytest.mark.parametrize("turn", [(0, 1, 2), (1, 2, 0), (2, 1, 0)])
def test_distance_to_a_triangle(point, distance: float, turn) -> None:
    found = triangle_distances(np.array([point]), TRIANGLE[np.newaxis, list(turn)])
    assert found[0] == pytest.approx(distance, abs=1e-14)


def test_triangle_without_area_is_its_longest_edge() -> None:
    flat = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    points = np.array([[1.5, 3.0, 4.0], [6.0, 3.0, 0.0]])
    assert triangle_distances(points, flat[np.newaxis]) == pytest.approx([5.0, 5.0])


def test_distance_to_a_mesh_is_that_to_all_its_triangles() -> None:
    rng = np.random.default_rng(3)
    mesh = trimesh.creation.torus(5.0, 1.5, 24, 12)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    points = spread_points(vertices, faces, 500)[0] + rng.normal(0.0, 0.1, (500, 3))
    every = triangle_distances(points, vertices[faces])
    found = TriangleSurface(vertices, faces).distances(points)
    np.testing.assert_allclose(found, every, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("size", [0.97, 1.04])
def test_distance_of_a_sphere_and_a_cylinder(size: float) -> None:
    """Concentric ones are apart by the difference of their radii, to a facet's sagitta."""
    ball = trimesh.creation.icosphere(5)
    surface = TriangleSurface(np.asarray(ball.vertices), np.asarray(ball.faces))
    directions = np.random.default_rng(5).normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    longest = float(ball.edges_unique_length.max())
    sagitta = longest**2 / 6.0  # a facet's middle is edge / sqrt(3) from its corners
    assert surface.distances(size * directions) == pytest.approx(abs(size - 1.0), abs=sagitta)

    turns = np.linspace(0.0, 2.0 * np.pi, 256, endpoint=False)
    ring = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    contours = [np.column_stack([ring, np.full(256, height)]) for height in range(11)]
    tube = TriangleSurface(*contour_loft(contours, 256))
    points = np.column_stack([size * ring, np.linspace(0.1, 9.9, 256)])
    # Straight out from a corner outside, and to the facets beside it inside.
    slack = 1e-12 if size > 1.0 else 1.0 - np.cos(np.pi / 256.0)
    assert tube.distances(points) == pytest.approx(abs(size - 1.0), abs=slack)


def test_points_are_spread_by_area() -> None:
    vertices = np.array([[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 5], [1, 0, 5], [0, 2, 5]], float)
    points, owners = spread_points(vertices, np.array([[0, 1, 2], [3, 4, 5]]), 4000)
    assert np.bincount(owners).tolist() == [3000, 1000]
    assert points[owners == 0].mean(axis=0) == pytest.approx([1.0, 2.0 / 3.0, 0.0], abs=5e-3)
    # The second moment of a right triangle's points about its corner is a^2 / 6 in x.
    assert np.mean(points[owners == 0][:, 0] ** 2) == pytest.approx(9.0 / 6.0, rel=5e-3)


def circle(height: float, start: float, count: int = 90) -> NDArray[np.float64]:
    turns = start + np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return np.column_stack([np.cos(turns), np.sin(turns), np.full(count, height)])


def test_rings_do_not_twist_with_where_contours_start() -> None:
    contours = [circle(float(place), 0.8 * place) for place in range(9)]
    rings = rings_of(contours, 30)
    # Half a step of the contour is the most that a start can be off, section by section.
    step = np.linalg.norm(np.diff(rings[:, :, :2], axis=0), axis=2).max()
    assert step <= np.pi / 90.0 + 1e-9


def test_loft_keeps_a_parabola_under_smoothing_and_shares_no_edge_thrice() -> None:
    bend = [np.array([0.1 * place**2, 0.0, 0.0]) for place in range(-10, 11)]
    contours = [circle(place, 0.0) + away for place, away in enumerate(bend)]
    vertices, faces = contour_loft(contours, 24)
    smooth, same = contour_loft(contours, 24, smoothing=1.5)
    inner = slice(8 * 24, 13 * 24)  # the ends are only held in place
    np.testing.assert_allclose(smooth[inner], vertices[inner], atol=5e-3)
    np.testing.assert_array_equal(faces, same)
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert np.bincount(counts).tolist()[1:] == [2 * 24, len(counts) - 2 * 24]


def test_drawn_tube_goes_on_from_where_it_began(tmp_path: Path) -> None:
    draw_tube_images(tmp_path / "tube", 9, distinct=4)
    stack = read_image_stack(tmp_path / "tube")
    assert (len(stack), stack.shape) == (9, (SIDE, SIDE))
    images = list(stack.images())
    first = [next(k for k in range(9) if (images[k] == image).all()) for image in images]
    assert first == [0, 1, 2, 3, 0, 1, 2, 3, 0]
    areas = [np.count_nonzero(image > 120) for image in images[:4]]
    turns = 2.0 * np.pi * np.arange(4) / 400.0
    assert areas == pytest.approx(np.pi * (60.0 + 10.0 * np.sin(3.0 * turns)) ** 2, rel=3e-3)


def test_the_drawn_tube_comes_back_to_itself_and_bends_less_than_it_is_wide() -> None:
    def drawn(index: int) -> np.ndarray:
        return tube_image(index, np.random.default_rng(1))

    np.testing.assert_array_equal(drawn(SMOOTH), drawn(0))
    assert not np.array_equal(drawn(SMOOTH // 2), drawn(0))
    turns = 2.0 * np.pi * np.arange(SMOOTH) / PERIOD
    middle = SWAY * np.stack([np.sin(turns), np.cos(0.5 * turns), turns * PERIOD / SWAY / 6.2832])
    first = np.gradient(middle, axis=1)
    second = np.gradient(first, axis=1)
    speeds = np.linalg.norm(first, axis=0)
    bends = np.linalg.norm(np.cross(first.T, second.T), axis=1) / speeds**3
    assert 1.0 / bends[2:-2].max() > 1.3 * (RADIUS + 10.0)


def test_rounding_and_size_of_a_loft_have_closed_forms() -> None:
    """Smoothing by 2 G - G G takes 1 - (1 - exp(-s^2 / 2))^2 of a circle, its first harmonic."""
    contours = [circle(float(place), 0.0, 720) for place in range(5)]
    vertices, _ = contour_loft(contours, 180, rounding=0.4, size=0.9)
    kept = 1.0 - (1.0 - np.exp(-(0.4**2) / 2.0)) ** 2
    radii = np.linalg.norm(vertices[:, :2], axis=1)
    np.testing.assert_allclose(radii, 0.9 * kept, rtol=1e-4)  # the filter is cut off at 4 s


@pytest.mark.parametrize("least", [60, 61, 437, 3999, 4000])
def test_bisection_ends_near_the_least_count(least: int) -> None:
    asked: list[int] = []

    def enough(count: int) -> bool:
        asked.append(count)
        return count >= least

    found = least_count(enough, 60, 4000, 1.03)
    assert found is not None
    assert least <= found <= max(least + 1, 1.03 * least)
    assert len(asked) == len(set(asked)) <= 9
    assert least_count(lambda count: count > 4000, 60, 4000) is None


def test_errors_that_both_reach_are_never_the_same_one() -> None:
    def smallest(percent: float):
        return None if percent < 1.9 else percent

    levels = geometry.levels_of_both(smallest)  # pyright: ignore[reportArgumentType]
    assert levels == [(2.0, 2.0), (3.0, 3.0)]
    assert geometry.levels_of_both(lambda percent: None) == []


def test_draco_gives_a_tube_within_its_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A short drawn tube without a reference is held against its own loft."""
    for module in ("DracoPy", "fast_simplification", "skimage"):
        pytest.importorskip(module, reason="the benchmarks' peers are not installed")
    draw_tube_images(tmp_path / "tube" / "masks", 16)
    monkeypatch.setattr(organ_sets, "DATA", tmp_path)
    monkeypatch.setattr(draco_peer, "LOFTS", {"corners": (24, 48), "size": (1.0,)})
    monkeypatch.setattr(draco_peer, "CUBES_BLUR", ())
    organ = OrganSet("tube")
    # Cut by images a pixel apart, a tube that runs askew shows its area over the cosine.
    turns = 2.0 * np.pi * np.arange(16) / 400.0
    askew = SWAY * np.pi / 200.0 * np.stack([np.cos(turns), -0.5 * np.sin(0.5 * turns)])
    cosines = 1.0 / np.sqrt(1.0 + (askew**2).sum(axis=0))
    radii = 0.1 * (60.0 + 10.0 * np.sin(3.0 * turns)) * np.sqrt(cosines)
    # The axis, a mean of edge points, jitters by a tenth of a pixel.
    assert organ.radius == pytest.approx(radii.mean(), rel=5e-3)
    target = 0.02 * organ.radius
    best = DracoSearch(organ).best(target)
    assert best is not None
    assert best.rms <= target
    assert best.size == len(best.packed)
    assert DracoSearch(organ).best(1e-9) is None


def test_sets_that_are_absent_are_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(organ_sets, "DATA", tmp_path)
    assert organ_sets.missing_sets() == list(organ_sets.SETS)
