"""Curved organs are cut again so that sections are sections; others are left alone."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from drawn_stack import traced_edges
from numpy.typing import NDArray
from scipy.spatial import KDTree

from organ_geometry import TraceOptions, trace_organ
from organ_geometry.images.grey_image import GreyImage, ImageStackError
from organ_geometry.images.image_planes import ImagePlanes
from organ_geometry.images.image_stack import ImageStack
from organ_geometry.images.image_volume import VolumeSlices
from organ_geometry.images.stack_reader import read_image_stack
from organ_geometry.reslice.organ_voxels import organ_voxels
from organ_geometry.reslice.resliced_stack import When, reslice_stack, reslice_where_needed

# A stack that stands obliquely, with pixels that are not square and slices further apart.
PIXEL = np.array([0.5, 0.6])
SPACING = 0.9
X_DIR, Y_DIR, NORMAL = np.array([[2.0, 1, 2], [-2, 2, 1], [-1, -2, 2]]) / 3.0
ORIGIN = np.array([100.0, -50.0, 20.0])
SHAPE = (40, 110, 130)
EDGE = 0.6


def volume_stack(voxels: GreyImage, frames: NDArray[np.float64] | None = None) -> ImageStack:
    """A stack of (K, H, W) voxels, standing as above, or in other frames."""
    count = len(voxels)
    own = np.broadcast_to(np.stack([X_DIR, Y_DIR, NORMAL], axis=1), (count, 3, 3))
    return ImageStack(
        source=Path("drawn"),
        names=tuple(f"slice {index}" for index in range(count)),
        slices=VolumeSlices(voxels),
        shape=(voxels.shape[1], voxels.shape[2]),
        planes=ImagePlanes(
            pixel_size=PIXEL,
            slice_spacing=SPACING,
            origins=ORIGIN + SPACING * np.arange(count)[:, None] * NORMAL,
            frames=own if frames is None else frames,
        ),
    )


def places(shape: tuple[int, int, int]) -> NDArray[np.float64]:
    """(K, H, W, 3) places of voxels, mm, along the stack's axes from the first image's middle."""
    k, j, i = np.indices(shape)
    return np.stack(
        [
            (i - (shape[2] - 1) / 2) * PIXEL[0],
            (j - (shape[1] - 1) / 2) * PIXEL[1],
            k * SPACING,
        ],
        axis=-1,
    )


def drawn(distance: NDArray[np.float64], dtype: Any = np.uint8) -> GreyImage:
    """Voxels of what is inside where a distance is below 0, with a soft edge."""
    return np.clip((0.5 - distance / (2 * EDGE)) * 200 + 20, 20, 220).astype(dtype)


BEND, TUBE = 24.0, 5.0
MIDDLE = np.array([0.0, 0.0, 0.5 * (SHAPE[0] - 1) * SPACING])
# The arc's plane: nearly that of the slices, so that they cut it lengthwise.
ARC_X = np.array([np.cos(0.1), 0.0, np.sin(0.1)])
ARC_Y = np.array([0.0, 1.0, 0.0])
HALF_ARC = np.radians(115.0)


def arc_distance(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed distance to a piece of a torus, rounded at its ends."""
    off = points - MIDDLE
    x, y = off @ ARC_X, off @ ARC_Y
    angle = np.clip(np.arctan2(y, x), -HALF_ARC, HALF_ARC)
    nearest = BEND * (np.cos(angle)[..., None] * ARC_X + np.sin(angle)[..., None] * ARC_Y)
    return np.linalg.norm(off - nearest, axis=-1) - TUBE


@pytest.fixture(scope="module")
def arc() -> ImageStack:
    return volume_stack(drawn(arc_distance(places(SHAPE))))


def suited(
    stack: ImageStack, options: TraceOptions | None = None, when: When = "auto"
) -> ImageStack:
    """The images in which an organ is traced: those given, or resliced ones."""
    return reslice_where_needed(stack, trace_organ(stack, options), options, when)[0]


def own_axes(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """From space to the stack's own axes."""
    return (points - ORIGIN) @ np.stack([X_DIR, Y_DIR, NORMAL], axis=1)


def edge_points(stack: ImageStack) -> list[NDArray[np.float64]]:
    """Edge points of each image, in space."""
    found: list[NDArray[np.float64]] = []
    for index, image in enumerate(stack.images()):
        edge = traced_edges(image, polarity="bright").outer
        offset = (edge - 0.5 * (np.array(stack.shape[::-1]) - 1.0)) * stack.pixel_size
        found.append(stack.origins[index] + offset @ stack.frames[index][:, :2].T)
    return found


def test_a_bent_tube_cut_lengthwise_is_recovered(arc: ImageStack) -> None:
    sections = reslice_stack(arc)
    pixel = float(sections.pixel_size[0])
    assert pixel == sections.pixel_size[1] == 0.5
    middles = own_axes(sections.origins) - MIDDLE
    angles = np.arctan2(middles @ ARC_Y, middles @ ARC_X)
    # On the arc, and from end to end; straight on near the ends, where nothing is to be fitted to.
    inner = np.abs(angles) < HALF_ARC - 0.05
    steep = np.abs(angles) < HALF_ARC - 1.5 * TUBE / BEND
    on_arc = BEND * (np.cos(angles)[:, None] * ARC_X + np.sin(angles)[:, None] * ARC_Y)
    assert np.linalg.norm(middles - on_arc, axis=1)[steep].max() < 0.3 * pixel
    assert angles.min() < -HALF_ARC
    assert angles.max() > HALF_ARC
    # Perpendicular to it.
    normals = sections.frames[:, :, 2] @ np.stack([X_DIR, Y_DIR, NORMAL], axis=1)
    tangents = -np.sin(angles)[:, None] * ARC_X + np.cos(angles)[:, None] * ARC_Y
    assert np.abs((normals * tangents).sum(axis=1))[steep].min() > np.cos(np.radians(3.0))
    # Its surface is where it was drawn.
    wide = list(np.flatnonzero(inner))
    points = edge_points(sections)
    off = np.abs(np.concatenate([arc_distance(own_axes(points[index])) for index in wide]))
    assert off.max() < 0.5 * pixel
    assert off.mean() < 0.1 * pixel
    # Round, where the slices show anything but.
    for index in wide:
        radii = np.linalg.norm(points[index] - sections.origins[index], axis=1)
        assert radii.max() < TUBE + pixel
    assert (np.diff(np.abs(angles - angles[0])) > 0).all()


def test_frames_and_names_are_the_sections_own(arc: ImageStack) -> None:
    sections = reslice_stack(arc, spacing=3.0)
    assert sections.slice_spacing == pytest.approx(3.0, rel=0.05)
    gaps = np.linalg.norm(np.diff(sections.origins, axis=0), axis=1)
    np.testing.assert_allclose(gaps, sections.slice_spacing, rtol=0.05)
    np.testing.assert_allclose(
        np.swapaxes(sections.frames, 1, 2) @ sections.frames,
        np.broadcast_to(np.eye(3), sections.frames.shape),
        atol=1e-12,
    )
    assert len(sections.names) == len(set(sections.names)) == len(list(sections.images()))
    assert all(image.shape == sections.shape for image in sections.images())
    (note,) = sections.notes
    assert note == f"cut again into {len(sections)} sections perpendicular to its centreline"


@pytest.mark.slow
def test_a_dark_organ_is_found_and_deep_levels_stay(arc: ImageStack) -> None:
    dark = volume_stack(40_000 - 100 * drawn(arc_distance(places(SHAPE)), np.uint16))
    ours, theirs = reslice_stack(dark), reslice_stack(arc)
    assert ours.image(5).dtype == np.uint16
    np.testing.assert_allclose(ours.origins, theirs.origins, atol=0.05)
    np.testing.assert_allclose(ours.image(20), 40_000 - 100.0 * theirs.image(20), atol=150)


def straight(
    start: tuple[float, float, float], end: tuple[float, float, float], radius: float
) -> NDArray[np.float64]:
    points, first = places(SHAPE), np.array(start)
    direction = np.array(end) - first
    along = np.clip(((points - first) @ direction) / (direction @ direction), 0.0, 1.0)
    return np.linalg.norm(points - first - along[..., None] * direction, axis=-1) - radius


def test_the_seed_says_which_organ() -> None:
    # A thick tube and a thin one that begins in the first image.
    thick = straight((-15, -20, 17), (-15, 25, 17), 5.0)
    thin = straight((12, -10, 0), (15, 10, 33), 3.0)
    stack = volume_stack(drawn(np.minimum(thick, thin)))
    assert own_axes(reslice_stack(stack).origins)[:, 0].max() < 0.0
    rows, columns = stack.shape
    seed = (12 / PIXEL[0] + (columns - 1) / 2, -10 / PIXEL[1] + (rows - 1) / 2)
    assert own_axes(reslice_stack(stack, TraceOptions(seed=seed)).origins)[:, 0].min() > 0.0
    midpoint = (13.5 / PIXEL[0] + (columns - 1) / 2, (rows - 1) / 2, len(stack) // 2)
    assert own_axes(reslice_stack(stack, TraceOptions(seed=midpoint)).origins)[:, 0].min() > 0.0
    with pytest.raises(ImageStackError, match=r"the seed 2,3 is not on an organ in slice 1"):
        reslice_stack(stack, TraceOptions(seed=(2.0, 3.0, 1)))
    with pytest.raises(ImageStackError, match=r"the seed 2,3 is not on an organ in slice 0"):
        reslice_stack(stack, TraceOptions(seed=(2.0, 3.0)))
    with pytest.raises(
        ImageStackError,
        match=r"seed must be a point x, y of the first image, from 0, 0 to 129, 109",
    ):
        reslice_stack(stack, TraceOptions(seed=(2.0, 300.0)))


def mask(distance: NDArray[np.float64]) -> GreyImage:
    return (distance < 0).astype(np.uint8) * np.uint8(255)


@pytest.mark.slow
def test_lengthwise_slices_are_cut_again_and_it_is_said() -> None:
    bent = volume_stack(mask(arc_distance(places(SHAPE))))
    sections = suited(bent)
    assert sections is not bent
    (note,) = sections.notes
    assert "of the organ" in note or "flatter than 45 degrees" in note
    assert "cut again into" in note
    flat = volume_stack(mask(straight((-20, -20, 12), (18, 20, 22), 5.0)))
    (note,) = suited(flat).notes
    assert note.startswith("the organ lies flatter than 45 degrees to the images over ")


@pytest.mark.parametrize("degrees", [0.0, 15.0, 30.0])
def test_a_tube_tilted_to_thirty_degrees_is_left_alone(degrees: float) -> None:
    slope = np.tan(np.radians(degrees))
    stack = volume_stack(mask(straight((-10, 0, -9), (-10 + 44 * slope, 0, 35), 4.0)))
    assert suited(stack) is stack


def test_two_organs_side_by_side_are_left_alone() -> None:
    beside = np.minimum(
        straight((-12, 0, -9), (-12, 0, 50), 5), straight((12, 0, -9), (12, 0, 50), 4)
    )
    stack = volume_stack(mask(beside))
    assert suited(stack) is stack


@pytest.mark.slow
def test_grey_images_are_looked_at_with_a_threshold_only() -> None:
    noise = np.random.default_rng(0).normal(scale=30.0, size=SHAPE)
    grey = np.clip(drawn(arc_distance(places(SHAPE))) + noise, 0, 255).astype(np.uint8)
    stack = volume_stack(grey)
    assert suited(stack) is stack
    assert suited(stack, TraceOptions(threshold=120.0), "auto") is not stack
    assert suited(stack, TraceOptions(threshold=120.0), "never") is stack


def test_never_and_always_are_obeyed() -> None:
    bent = volume_stack(mask(arc_distance(places(SHAPE))))
    assert suited(bent, when="never") is bent
    upright = volume_stack(mask(straight((-10, 0, -9), (-5, 0, 50), 4.0)))
    assert len(suited(upright, when="always")) == pytest.approx(SHAPE[0], abs=3)


def test_an_organ_that_leaves_every_picture_is_cut_again() -> None:
    # No slice shows a closed outline of it, so that nothing is traced in them.
    across = straight((-60, 0, 17), (60, 0, 17), 5.0)
    stack = volume_stack(mask(across))
    assert trace_organ(stack).sections == ()
    seed = (30.0, (stack.shape[0] - 1) / 2, round(17 / SPACING))
    for options in (TraceOptions(), TraceOptions(seed=seed), TraceOptions(polarity="bright")):
        sections, traced = reslice_where_needed(stack, trace_organ(stack, options), options)
        assert len(sections) == pytest.approx(SHAPE[2] * PIXEL[0] / SPACING, abs=2)
        assert len(traced.sections) > 0.9 * len(sections)


def test_the_largest_organ_in_space_is_cut_again() -> None:
    # Slices show the thin upright one more clearly, and tracing alone follows it.
    flat = straight((-20, -20, 17), (-20, 20, 17), 5.0)
    upright = straight((12, 0, 5), (12, 0, 30), 3.0)
    stack = volume_stack(mask(np.minimum(flat, upright)))
    middle = 0.5 * (stack.shape[1] - 1)
    assert min(one.outer[:, 0].min() for one in trace_organ(stack).sections) > middle
    assert own_axes(suited(stack).origins)[:, 0].max() < 0.0


def test_what_the_sections_leave_out_is_said() -> None:
    # A trunk with a branch half as long: about a third of the voxels are the branch's.
    trunk = straight((-28, 0, 17), (28, 0, 17), 5.0)
    branch = straight((0, 0, 17), (0, 30, 17), 5.0)
    stack = volume_stack(mask(np.minimum(trunk, branch)))
    (note,) = reslice_stack(stack).notes
    found = re.search(
        r"; (\d+)% of the organ lies beside them, in a branch or where it touches itself, most of "
        r"it in slice (\d+) to slice (\d+)",
        note,
    )
    assert found is not None, note
    assert 20 <= int(found[1]) <= 35
    # A tenth of a disc lies beyond 0.687 of its radius, on either side.
    images = np.array([int(found[2]), int(found[3])])
    expected = 17.0 + 0.687 * 5.0 * np.array([-1.0, 1.0])
    np.testing.assert_allclose(images * stack.slice_spacing, expected, atol=stack.slice_spacing)


def test_what_cannot_be_cut_again_is_named() -> None:
    ball = np.linalg.norm(places(SHAPE) - MIDDLE, axis=-1) - 12.0
    with pytest.raises(ImageStackError, match=r"drawn has no centreline: it is .* long and thin"):
        reslice_stack(volume_stack(mask(ball)))
    with pytest.raises(ImageStackError, match="nothing stands out in the images of drawn"):
        reslice_stack(volume_stack(np.full(SHAPE, 9, dtype=np.uint8)))
    with pytest.raises(ImageStackError, match="nothing stands out in the images of drawn"):
        reslice_stack(volume_stack(mask(ball)), TraceOptions(threshold=255.0, polarity="bright"))
    turned = np.broadcast_to(np.eye(3), (SHAPE[0], 3, 3)).copy()
    turned[7] = turned[7][:, [1, 0, 2]]
    with pytest.raises(ImageStackError, match="not parallel, and so are no volume"):
        reslice_stack(volume_stack(mask(ball), frames=turned))


def test_a_lumen_does_not_lead_the_centreline_astray(arc: ImageStack) -> None:
    distance = arc_distance(places(SHAPE))
    hollow = volume_stack(drawn(np.maximum(distance, -distance - 2.4)))
    ours, theirs = reslice_stack(hollow), reslice_stack(arc)
    middles = own_axes(ours.origins) - MIDDLE
    angles = np.arctan2(middles @ ARC_Y, middles @ ARC_X)
    inner = np.abs(angles) < HALF_ARC - 0.3
    on_arc = BEND * (np.cos(angles)[:, None] * ARC_X + np.sin(angles)[:, None] * ARC_Y)
    assert np.linalg.norm(middles - on_arc, axis=1)[inner].max() < 1.0
    assert len(ours) == pytest.approx(len(theirs), abs=4)
    # The lumen is still in the images.
    middle = ours.image(len(ours) // 2)
    assert middle[middle.shape[0] // 2, middle.shape[1] // 2] < 60


def test_an_organ_hangs_together_over_its_images() -> None:
    # A horseshoe standing on its bend: two parts in each image, one organ; a loose voxel is not it.
    voxels = np.zeros((8, 9, 12), dtype=np.uint8)
    voxels[1, 3:6, 2:10] = 255
    voxels[2:7, 3:6, 2:4] = 255
    voxels[2:7, 3:6, 8:10] = 255
    voxels[5, 0, 0] = 255
    stack = volume_stack(voxels)
    organ = organ_voxels(stack, trace_organ(stack), TraceOptions())
    assert organ.inside.sum() == 3 * 8 + 2 * 5 * 3 * 2
    assert organ.components.tolist() == [0, 1, 2, 2, 2, 2, 2, 0]
    column, row, first = organ.corner
    depth, height, width = organ.levels.shape
    np.testing.assert_array_equal(
        organ.levels, voxels[first : first + depth, row : row + height, column : column + width]
    )
    assert organ.outside_level == 0.0


@pytest.mark.slow
def test_the_duodenum_s_sections_lie_on_its_reference(data_dir: Path) -> None:
    stack = read_image_stack(data_dir / "duodenum_parallel" / "masks")
    sections = suited(stack)
    assert sections.notes[0].startswith("34 of 96 images show several parts of the organ")
    mesh = trimesh.load_mesh(data_dir / "duodenum_parallel" / "reference" / "FJ2573.obj")
    surface = np.asarray(trimesh.sample.sample_surface(mesh, 200_000, seed=1)[0])
    points = edge_points(sections)
    assert len(points) == len(sections) > 200
    distances, _ = KDTree(surface).query(np.concatenate(points))
    assert distances.mean() < 0.35 * sections.pixel_size[0]
    # And all of the reference but its tips is near the sections.
    back, _ = KDTree(np.concatenate(points)).query(surface[::20])
    assert np.quantile(back, 0.95) < 1.0


@pytest.mark.parametrize(
    "name",
    ["bile_duct_parallel", "bile_duct_perpendicular", "ureter_left", "trachea_wall_parallel"],
)
def test_organs_that_needs_reslicing_are_left_alone(data_dir: Path, name: str) -> None:
    stack = read_image_stack(data_dir / name / "masks")
    assert suited(stack) is stack
