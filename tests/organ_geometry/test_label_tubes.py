"""Tubes and their joins are found in labels, to a part of a voxel, however they are stored."""

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from drawn_labels import Drawn, drawn_volume, turn_about_z, write
from numpy.typing import NDArray

from benchmarks.label_tubes import atlas_names, join_gaps, tube_figures
from organ_geometry import ImageStackError, LabelTubes, LabelVolume, found_tubes, read_labels
from organ_geometry.reslice.curve_frames import rotation_minimising_frames
from organ_geometry.tubes.tube_wall import fitted_wall

pytest.importorskip("SimpleITK")

Floats = NDArray[np.float64]

RADIUS, SIDE_RADIUS, STATION, LENGTH = 3.0, 2.0, 28.0, 60.0
NAMES = {1: "trunk", 2: "side", 3: "top"}
TILT = np.array([[1, 0, 0], [0, math.cos(0.5), -math.sin(0.5)], [0, math.sin(0.5), math.cos(0.5)]])
# Largest errors at a voxel of a part of the trunk's radius: of the join's place and of the radius,
# mm, and of the angle, degrees.
ERRORS = {2: (1.1, 0.3, 1.5), 4: (0.3, 0.1, 0.5), 8: (0.25, 0.05, 0.2)}


def forked(angle: float) -> dict[int, Drawn]:
    """A trunk, one tube that joins its side at an angle, and one that joins its end."""
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    side = (26 * s, 0.0, STATION + 26 * c)
    top = (-0.6 * 26 * s, 0.8 * 26 * s, LENGTH + 26 * c)
    return {
        1: Drawn((0.0, 0.0, 0.0), (0.0, 0.0, LENGTH), RADIUS),
        2: Drawn((0.0, 0.0, STATION), side, SIDE_RADIUS),
        3: Drawn((0.0, 0.0, LENGTH), top, SIDE_RADIUS),
    }


def tubes_of_labels(volume: LabelVolume, names: dict[int, str]) -> LabelTubes:
    return found_tubes(volume, names).tubes()


def direction(found: LabelTubes, name: str) -> Floats:
    places = found.tube(name).axis.places
    offset = places[int(0.8 * len(places))] - places[int(0.35 * len(places))]
    return offset / np.linalg.norm(offset)


@cache
def found_fork(angle: float, portion: int, turned: bool) -> tuple[LabelTubes, Floats]:
    turn = turn_about_z(30.0) @ TILT if turned else np.eye(3)
    volume = drawn_volume(forked(angle), RADIUS / portion, turn=turn)
    return tubes_of_labels(volume, NAMES), turn


@pytest.mark.slow
@pytest.mark.parametrize("turned", [True, pytest.param(False, marks=pytest.mark.long)])
@pytest.mark.parametrize("portion", [2, 4, pytest.param(8, marks=pytest.mark.long)])
@pytest.mark.parametrize("angle", [40.0, pytest.param(70.0, marks=pytest.mark.long)])
def test_a_fork_s_joins_angles_and_radii_converge(angle: float, portion: int, turned: bool) -> None:
    found, turn = found_fork(angle, portion, turned)
    place_error, radius_error, angle_error = ERRORS[portion]
    joins = {join.tube: join for join in found.joins}
    assert joins.keys() == {"side", "top"}
    assert all(join.to == "trunk" and join.end == 0 for join in joins.values())
    assert joins["side"].place == "middle"
    assert joins["top"].place == "end"
    trunk = found.tube("trunk").axis
    # In the body's own frame, which the volume's is turned against.
    place = turn.T @ trunk.place(joins["side"].station)
    assert abs(place[2] - STATION) < place_error
    assert np.hypot(*place[:2]) < radius_error
    for name in ("side", "top"):
        bend = math.degrees(math.acos(direction(found, name) @ direction(found, "trunk")))
        assert bend == pytest.approx(angle, abs=angle_error)
        axis = found.tube(name).axis
        assert axis.radius_at(0.6 * axis.length) == pytest.approx(SIDE_RADIUS, abs=radius_error)
    assert trunk.radius_at(15.0) == pytest.approx(RADIUS, abs=radius_error)


@pytest.mark.slow
def test_a_joined_tube_s_surface_reaches_into_the_one_that_it_joins() -> None:
    found, _ = found_fork(40.0, 4, False)
    for join in found.joins:
        organ = found.tube(join.tube).built.organ
        end = organ.axis[-1 if join.end else 0]
        to = found.tube(join.to).axis
        station, apart = to.nearest(end)
        assert apart < 0.5 * to.radius_at(station)


@pytest.mark.long  # an organ is built twice
def test_the_same_labels_stored_the_other_way_round_give_the_same_bytes(tmp_path: Path) -> None:
    volume = drawn_volume(forked(40.0), RADIUS / 3)
    found = [
        tubes_of_labels(read_labels(write(volume, tmp_path / name, flips)), NAMES)
        for name, flips in (
            ("as.nii.gz", ()),
            ("again.nii.gz", ()),
            ("x.nrrd", (0,)),
            ("yz.nrrd", (1, 2)),
        )
    ]
    codes = [[tube.built.organ.encoded for tube in each.tubes] for each in found]
    assert codes[0] == codes[1] == codes[2] == codes[3]
    # The origin's last digits are another's where an axis was stored from its other end.
    for each in found[1:]:
        for one, other in zip(found[0].joins, each.joins, strict=True):
            assert (one.tube, one.end, one.to, one.place) == (
                other.tube, other.end, other.to, other.place,
            )  # fmt: skip
            assert one.station == pytest.approx(other.station, abs=1e-9)


def test_axes_in_another_order_give_the_same_voxels(tmp_path: Path) -> None:
    import SimpleITK as sitk  # noqa: N813

    volume = drawn_volume({1: Drawn((0, 0, 0), (4, 9, 30), 3.0)}, (0.8, 0.9, 1.5))
    image = sitk.ReadImage(str(write(volume, tmp_path / "as.nrrd")))
    sitk.WriteImage(sitk.PermuteAxes(image, [2, 0, 1]), str(tmp_path / "turned.nrrd"))
    one, two = read_labels(tmp_path / "as.nrrd"), read_labels(tmp_path / "turned.nrrd")
    np.testing.assert_array_equal(one.values, two.values)
    np.testing.assert_allclose(one.origin, two.origin, atol=1e-9)
    np.testing.assert_allclose(one.sizes, two.sizes)


@pytest.mark.parametrize("sizes", [(1.0, 1.0, 1.0), (0.6, 0.6, 1.8)])
def test_a_wall_of_wrong_and_missing_labels_is_found(sizes: tuple[float, float, float]) -> None:
    """A tube of two voxels' radius: 3 % of its labels wrong, a third of its rim another tube's."""
    rng = np.random.default_rng(5)
    tube = Drawn((0.0, 0.0, 0.0), (12.0, 9.0, 36.0), 2.0)
    volume = drawn_volume({1: tube}, sizes)
    indices = np.argwhere(np.ones(volume.values.shape, dtype=bool))[:, ::-1]
    places = volume.places(indices)
    inside = volume.values.ravel() == 1
    wrong = rng.random(len(inside)) < 0.03
    axis = np.linspace(tube.start, tube.end, 81)
    offset = (axis[-1] - axis[0]) / np.linalg.norm(axis[-1] - axis[0])
    frames = rotation_minimising_frames(axis, np.tile(offset, (81, 1)), np.array([1.0, 0.0, 0.0]))
    off = places - axis[0]
    away = np.linalg.norm(off - np.outer(off @ offset, offset), axis=1)
    known = (away < 4.5) & (off @ frames[0, :, 0] < 1.2)
    voxel = float(np.prod(sizes) ** (1.0 / 3.0))
    labels, trust = (inside ^ wrong)[known], np.ones(int(known.sum()))
    wall = fitted_wall(axis, frames, places[known], labels, trust, 2.0, voxel, harmonics=2)
    angles = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
    radii = wall.radii(np.linspace(3.0, 36.0, 30), angles)
    assert np.sqrt(((radii - 2.0) ** 2).mean()) < 0.15 * voxel
    assert radii.mean() == pytest.approx(2.0, abs=0.06 * voxel)


@pytest.mark.slow
def test_tubes_that_only_touch_are_not_joined() -> None:
    volume = drawn_volume(
        {
            1: Drawn((0.0, 0.0, 0.0), (0.0, 0.0, 50.0), 3.0),
            2: Drawn((5.1, 0.0, 5.0), (5.1, 0.0, 45.0), 2.0),
        },
        0.6,
    )
    found = tubes_of_labels(volume, {1: "one", 2: "two"})
    assert found.joins == ()
    assert {frozenset(touch[:2]) for touch in found.touches} == {frozenset(("one", "two"))}
    assert max(touch[2] for touch in found.touches) > 25.0


def without(volume: LabelVolume, gone: NDArray[np.bool_]) -> LabelVolume:
    values = volume.values.copy()
    values[gone] = 0
    return LabelVolume(volume.source, values, volume.sizes, volume.origin, volume.axes)


def test_a_tube_in_two_pieces_is_refused_and_a_crumb_is_doubted() -> None:
    volume = drawn_volume({1: Drawn((0, 0, 0), (0, 0, 40), 3.0)}, 0.75)
    gap = np.zeros(volume.values.shape, dtype=bool)
    gap[30:34] = True
    with pytest.raises(ImageStackError, match=r"duct\) is in 2 parts, the second 3.* from the"):
        tubes_of_labels(without(volume, gap), {1: "duct"})
    gap[:] = False
    gap[12:15] = True
    found = tubes_of_labels(without(volume, gap), {1: "duct"})
    assert any("left out" in doubt for doubt in found.doubts)


@pytest.mark.slow
def test_a_branch_is_a_tube_of_its_own() -> None:
    trunk = Drawn((0.0, 0.0, 0.0), (0.0, 0.0, 50.0), RADIUS)
    side = Drawn((0.0, 0.0, STATION), (18.0, 0.0, STATION + 9.0), SIDE_RADIUS)
    volume = drawn_volume({1: trunk, 2: side}, 1.0)
    values = np.minimum(volume.values, 1)
    merged = LabelVolume(volume.source, values, volume.sizes, volume.origin, volume.axes)
    found = tubes_of_labels(merged, {1: "trunk"})
    assert any("trunk branches near" in doubt for doubt in found.doubts)
    (join,) = found.joins
    assert (join.tube, join.to, join.end, join.place) == ("trunk_2", "trunk", 0, "middle")
    # Where it was drawn, to a voxel and a half.
    branch = found.tube("trunk_2")
    assert branch.label == 1
    assert join.station == pytest.approx(STATION, abs=1.5)
    assert np.linalg.norm(branch.axis.places[-1] - side.end) < 1.5
    assert branch.axis.radius_at(12.0) == pytest.approx(SIDE_RADIUS, abs=0.2)
    assert found.tube("trunk").axis.radius_at(STATION) == pytest.approx(RADIUS, abs=0.3)


@pytest.mark.parametrize(
    ("tube", "says"),
    [
        (Drawn((0, 0, 0), (0, 0, 3), 3.0), "no tube"),
        (Drawn((0, 0, 0), (0, 0, 1), 0.6), "voxels"),
        (Drawn((0, 0, 0), (0, 0, 40), 0.55), "voxels thick|parts"),
    ],
)
def test_what_is_no_tube_is_refused(tube: Drawn, says: str) -> None:
    volume = drawn_volume({1: tube}, 0.75)
    with pytest.raises(ImageStackError, match=says):
        tubes_of_labels(volume, {1: "duct"})


def test_a_label_that_is_not_there_is_refused() -> None:
    volume = drawn_volume({1: Drawn((0, 0, 0), (0, 0, 40), 3.0)}, 1.5)
    with pytest.raises(ImageStackError, match="label 2"):
        tubes_of_labels(volume, {1: "duct", 2: "artery"})
    with pytest.raises(ImageStackError, match="none of the labels"):
        tubes_of_labels(volume, {})


# How far walls may be off the atlas's meshes, % of the radius: of cubes, and of thick slices with
# wrong labels.
MOST_OFF = {
    "gallbladder": (2.8, 3.0),
    "cystic_duct": (6.0, 15.0),
    "common_duct": (2.7, 3.5),
    "right_hepatic_duct": (4.0, 6.0),
    "left_hepatic_duct": (4.0, 6.0),
    "proper_hepatic_artery": (4.0, 12.0),
    "right_hepatic_artery": (4.0, 12.0),
    "left_hepatic_artery": (4.0, 12.0),
    "common_hepatic_artery": (4.0, 12.0),
    "gastroduodenal_artery": (6.0, 12.0),
    "portal_vein": (9.0, 9.0),
}
JOINS = {
    ("cystic_duct", "common_duct"),
    ("cystic_duct", "gallbladder"),
    ("right_hepatic_duct", "common_duct"),
    ("left_hepatic_duct", "common_duct"),
    ("common_hepatic_artery", "proper_hepatic_artery"),
    ("right_hepatic_artery", "proper_hepatic_artery"),
    ("left_hepatic_artery", "proper_hepatic_artery"),
    ("gastroduodenal_artery", "common_hepatic_artery"),
    # Of the label of the portal vein, which has a left and a right branch.
    ("portal_vein_2", "portal_vein"),
}
CYSTIC_STATION = 73.1
"""Where the cystic duct of the atlas joins the common duct, mm from its lower end."""


@pytest.mark.long  # a real volume
@pytest.mark.parametrize("name", ["labels", "labels_hard"])
def test_the_atlas_is_found_again(name: str, data_dir: Path) -> None:
    """Against the atlas's own meshes: the decoded organ's wall where no other tube's label is."""
    folder = data_dir / "calot_atlas"
    if not folder.is_dir():
        pytest.skip(f"the atlas is not here: no folder {folder}")
    volume = read_labels(folder / f"{name}.nii.gz")
    found = tubes_of_labels(volume, atlas_names(folder))
    assert {(join.tube, join.to) for join in found.joins} == JOINS
    assert len(found.joins) == len(JOINS)
    cystic = next(join for join in found.joins if join.to == "common_duct" and join.end == 0
                  and join.tube == "cystic_duct")  # fmt: skip
    assert cystic.station == pytest.approx(CYSTIC_STATION, abs=1.0)
    assert sum(len(tube.built.organ.encoded) for tube in found.tubes) <= 700
    # No surface stands off the one that it joins.
    assert not any(join_gaps(found).values())
    for tube, figures in tube_figures(found, volume, folder).items():
        off = 100.0 * figures.wall / figures.radius
        assert off <= MOST_OFF[tube][name == "labels_hard"], tube
        # Ends and branches are there, too.
        assert figures.back < 0.1 * figures.radius + 0.05, tube


@pytest.mark.slow
def test_an_oblique_volume_s_tubes_stand_where_its_axes_say(tmp_path: Path) -> None:
    volume = drawn_volume(forked(40.0), RADIUS / 3)
    turn = turn_about_z(25.0) @ TILT
    oblique = LabelVolume(
        volume.source, volume.values, volume.sizes, turn @ volume.origin, turn @ volume.axes
    )
    straight = tubes_of_labels(volume, NAMES)
    found = tubes_of_labels(read_labels(write(oblique, tmp_path / "oblique.nii.gz")), NAMES)
    for one, other in zip(straight.joins, found.joins, strict=True):
        assert (one.tube, one.end, one.to, one.place) == (
            other.tube, other.end, other.to, other.place,
        )  # fmt: skip
        assert one.station == pytest.approx(other.station, abs=0.1)
    for name in NAMES.values():
        line, turned = straight.tube(name).axis, found.tube(name).axis
        fractions = np.linspace(0.0, 1.0, 20)
        for fraction in fractions:
            place = turn @ line.place(fraction * line.length)
            assert turned.nearest(place)[1] < 0.1
