"""A case from labels: files, names, kinds, and inputs that cannot be one."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn_labels import Drawn, drawn_volume, write
from numpy.typing import NDArray
from program import refused, run
from scipy.spatial import KDTree

from app.anatomy import (
    Anatomy,
    anatomy_labels,
    anatomy_network,
    drawn_anatomy,
    named_labels,
    patient_case,
    read_anatomy,
    shipped_anatomies,
    tube_lines,
)
from app.anatomy.patient_case import NamedLabel
from app.anatomy.tables import HEAD_RIGHT_FRONT
from organ_geometry import LabelVolume, read_labels, read_organ

pytest.importorskip("SimpleITK")
import SimpleITK as sitk  # noqa: N813

NAMES = {1: "common duct", 2: "cystic duct", 3: "hepatic artery"}
TUBES = {
    1: Drawn((0.0, 0.0, 0.0), (0.0, 0.0, 50.0), 3.0),
    2: Drawn((0.0, 0.0, 24.0), (-16.0, 0.0, 43.0), 2.0),
    3: Drawn((14.0, 0.0, 0.0), (14.0, 0.0, 50.0), 2.2),
}


@pytest.fixture(scope="module")
def volume() -> LabelVolume:
    drawn = drawn_volume(TUBES, 1.0)
    return LabelVolume(drawn.source, drawn.values, drawn.sizes, drawn.origin, drawn.axes, NAMES)


@pytest.fixture
def names(tmp_path: Path) -> Path:
    path = tmp_path / "names.json"
    path.write_text(json.dumps(NAMES))
    return path


def as_masks(volume: LabelVolume, folder: Path) -> Path:
    folder.mkdir()
    for label, name in NAMES.items():
        mask = LabelVolume(
            volume.source, (volume.values == label).astype(np.int32) * 7,
            volume.sizes, volume.origin, volume.axes,
        )  # fmt: skip
        write(mask, folder / f"{name}.nrrd")
    return folder


def as_layers(volume: LabelVolume, path: Path) -> Path:
    """As 3D Slicer writes segments that overlap: layers, each with labels of its own."""
    layers = [(volume.values == label).astype(np.uint8) for label in (1, 2, 3)]
    layers[1] |= layers[2]
    image = sitk.GetImageFromArray(np.stack([layers[0] + 2 * layers[2], layers[1]], -1), True)
    image.SetSpacing(volume.sizes.tolist())
    image.SetOrigin(volume.origin.tolist())
    for number, (name, value, layer) in enumerate(
        [("common duct", 1, 0), ("hepatic artery", 2, 0), ("cystic duct", 1, 1)]
    ):
        image.SetMetaData(f"Segment{number}_Name", name)
        image.SetMetaData(f"Segment{number}_LabelValue", str(value))
        image.SetMetaData(f"Segment{number}_Layer", str(layer))
    sitk.WriteImage(image, str(path))
    return path


def as_dicom(volume: LabelVolume, folder: Path, names: dict[int, str]) -> Path:
    """As highdicom writes segments of a CT, whose slices lie in the folder too."""
    highdicom = pytest.importorskip("highdicom")
    from pydicom import Dataset, FileMetaDataset
    from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian, generate_uid

    folder.mkdir()
    study, series, frame = generate_uid(), generate_uid(), generate_uid()
    slices: list[Dataset] = []
    for number in range(volume.values.shape[0]):
        data = Dataset()
        data.file_meta = FileMetaDataset()
        data.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
        data.SOPClassUID, data.SOPInstanceUID = CTImageStorage, generate_uid()
        data.StudyInstanceUID, data.SeriesInstanceUID = study, series
        data.FrameOfReferenceUID, data.PositionReferenceIndicator = frame, ""
        data.PatientID, data.PatientName = "none", "No^One"
        for name in ("PatientBirthDate", "PatientSex", "StudyID", "AccessionNumber", "StudyDate",
                     "StudyTime", "ReferringPhysicianName"):  # fmt: skip
            setattr(data, name, "")
        data.Modality, data.InstanceNumber = "CT", number + 1
        _, data.Rows, data.Columns = volume.values.shape
        data.PixelSpacing = volume.sizes[1::-1].tolist()
        data.SliceThickness = float(volume.sizes[2])
        data.ImageOrientationPatient = volume.axes[:, :2].T.ravel().tolist()
        data.ImagePositionPatient = volume.places(np.array([[0, 0, number]]))[0].tolist()
        slices.append(data)
    slices[0].save_as(folder / "slice.dcm", enforce_file_format=True)
    kinds = {"duct": ("28273000", "Bile duct"), "artery": ("51114001", "Artery")}
    described: list[Any] = []
    for number, name in enumerate(names.values(), start=1):
        code, meaning = kinds[name.split()[-1]]
        described.append(
            highdicom.seg.SegmentDescription(
                segment_number=number,
                segment_label=name,
                segmented_property_category=highdicom.sr.CodedConcept(
                    "123037004", "SCT", "Anatomical Structure"
                ),
                segmented_property_type=highdicom.sr.CodedConcept(code, "SCT", meaning),
                algorithm_type=highdicom.seg.SegmentAlgorithmTypeValues.MANUAL,
            )
        )
    masks = np.stack([volume.values == label for label in names], axis=-1).astype(np.uint8)
    made = highdicom.seg.Segmentation(
        slices, masks, highdicom.seg.SegmentationTypeValues.BINARY, described, generate_uid(), 1,
        generate_uid(), 1, "none", "none", "1", "1",
    )  # fmt: skip
    made.save_as(folder / f"{'-'.join(map(str, names))}.dcm")
    return folder


def test_a_case_is_written_and_read_again(volume: LabelVolume, names: Path, tmp_path: Path) -> None:
    labels = write(volume, tmp_path / "labels.nii.gz")
    folder = tmp_path / "case"
    done = run("anatomy", "--labels", labels, "--names", names, "-o", folder, "--json")
    assert done.returncode == 0, done.stderr
    output = json.loads(done.stdout)
    assert {file.name for file in folder.iterdir()} == {
        "anatomy.toml", "common_duct.organ", "cystic_duct.organ", "hepatic_artery.organ",
    }  # fmt: skip
    anatomy = read_anatomy(folder / "anatomy.toml")
    assert [tube.kind for tube in anatomy.tube] == ["duct", "duct", "artery"]
    (join,) = anatomy.join
    assert (join.tube, join.end, join.to) == ("cystic_duct", 0, "common_duct")
    assert isinstance(join.at_mm, float)
    assert join.at_mm == pytest.approx(24.0, abs=1.0)
    assert anatomy.tube_named("cystic_duct").ends == ("joined", "clamped")
    # It rests in balance.
    bed = anatomy_network(anatomy).on_bed()
    for _ in range(5):
        bed.tick(1e-3)
    assert np.abs(bed.places - bed.rest_places).max() < 1e-12
    assert output["organ_bytes"] == sum(f.stat().st_size for f in folder.glob("*.organ"))
    # The file's frame: x to the head, y to the right, z to the front, from the first tube's begin.
    assert anatomy.place is not None
    rows, origin = np.array(anatomy.place.rows_LPS), np.array(anatomy.place.origin_LPS_mm)
    for tube in anatomy.tube:
        assert tube.organ is not None
        organ = read_organ(folder / f"{tube.name}.organ")
        points = np.array(tube.points_mm) @ rows + origin
        free = [end for end, how in ((0, tube.ends[0]), (-1, tube.ends[1])) if how != "joined"]
        for end in free:
            np.testing.assert_allclose(points[end], organ.axis[end], atol=2e-3)
        drawn = TUBES[{name.replace(" ", "_"): k for k, name in NAMES.items()}[tube.name]]
        assert organ.mean_radius == pytest.approx(drawn.radius, rel=0.1)
        assert tube_lines(anatomy)[tube.name].radius.mean() == pytest.approx(
            organ.mean_radius, rel=0.03
        )


@pytest.mark.long  # each kind of file once
def test_names_in_headers_masks_and_layers_give_the_same_case(
    volume: LabelVolume, names: Path, tmp_path: Path
) -> None:
    sources = {
        "json": write(volume, tmp_path / "labels.nii.gz"),
        "header": write(volume, tmp_path / "labels.seg.nrrd", names=True),
        "masks": as_masks(volume, tmp_path / "masks"),
        "layers": as_layers(volume, tmp_path / "layers.seg.nrrd"),
    }
    organs: dict[str, dict[str, bytes]] = {}
    for kind, source in sources.items():
        folder = tmp_path / kind
        more = ["--names", names] if kind == "json" else []
        done = run("anatomy", "--labels", source, *more, "-o", folder)
        assert done.returncode == 0, done.stderr
        organs[kind] = {file.name: file.read_bytes() for file in folder.glob("*.organ")}
    assert len(organs["json"]) == 3
    assert organs["json"] == organs["header"] == organs["masks"] == organs["layers"]


def test_segments_of_dicom_are_those_of_the_volume(volume: LabelVolume, tmp_path: Path) -> None:
    """One file of all segments or one of each: the voxels, their places, names and terms."""
    together = read_labels(as_dicom(volume, tmp_path / "one", NAMES))
    for label, name in NAMES.items():
        as_dicom(volume, tmp_path / name, {label: name})
    apart = tmp_path / "apart"
    apart.mkdir()
    for label, name in NAMES.items():
        (tmp_path / name / f"{label}.dcm").rename(apart / f"{label}.dcm")
    for read in (together, read_labels(apart)):
        assert read.names == NAMES
        assert read.terms[3] == "SCT^51114001^Artery"
        for label in NAMES:
            k, j, i = np.nonzero(read.values == label)
            found = read.places(np.stack([i, j, k], axis=1))
            k, j, i = np.nonzero(volume.values == label)
            wanted = volume.places(np.stack([i, j, k], axis=1))
            np.testing.assert_allclose(found, wanted, atol=1e-9)
        # As much is empty around them as in the volume, or more: no end is cut off.
        assert min(read.values.shape[0] - 51, 20) == 20
    # The same tubes; the anatomy's organs are the same where the same voxels are looked at.
    (tmp_path / "names.json").write_text(json.dumps(NAMES))
    wide = np.pad(volume.values, ((10, 10), (10, 10), (10, 10)))
    origin = volume.places(np.array([[-10, -10, -10]]))[0]
    nifti = write(
        LabelVolume(volume.source, wide, volume.sizes, origin, volume.axes),
        tmp_path / "labels.nii.gz",
    )
    sources = {"nifti": (nifti, ["--names", tmp_path / "names.json"]), "dicom": (apart, [])}
    cases: dict[str, Anatomy] = {}
    for kind, (source, more) in sources.items():
        done = run("anatomy", "--labels", source, *more, "-o", tmp_path / kind)
        assert done.returncode == 0, done.stderr
        cases[kind] = read_anatomy(tmp_path / kind / "anatomy.toml")
    nifti_case, dicom_case = cases["nifti"], cases["dicom"]
    assert nifti_case.join == dicom_case.join
    for one, other in zip(nifti_case.tube, dicom_case.tube, strict=True):
        np.testing.assert_allclose(one.points_mm, other.points_mm, atol=2e-3)
        np.testing.assert_allclose(one.radius_mm, other.radius_mm, atol=2e-3)


def test_dicom_that_is_no_segmentation_is_refused(volume: LabelVolume, tmp_path: Path) -> None:
    as_dicom(volume, tmp_path / "ct", NAMES)
    (tmp_path / "ct" / "1-2-3.dcm").unlink()
    says = refused(["anatomy", "--labels", tmp_path / "ct", "-o", tmp_path / "case"])
    assert "ct holds no DICOM segmentation (SEG) but CT" in says


def test_what_is_not_named_or_not_solved_is_left_out_with_a_word(
    volume: LabelVolume, tmp_path: Path
) -> None:
    labels = write(volume, tmp_path / "labels.nii.gz")
    names = tmp_path / "names.json"
    names.write_text(json.dumps({"1": "common duct", "3": {"name": "tumour", "kind": "shown"}}))
    done = run("anatomy", "--labels", labels, "--names", names, "-o", tmp_path / "case")
    assert done.returncode == 0, done.stderr
    assert re.search(r"left out +label 2", done.stdout)
    assert re.search(r"left out +tumour", done.stdout)
    assert [path.name for path in (tmp_path / "case").glob("*.organ")] == ["common_duct.organ"]


def test_a_mirrored_volume_is_doubted(tmp_path: Path) -> None:
    body = {1: TUBES[1], 2: Drawn((15.0, 0.0, 10.0), (30.0, 0.0, 40.0), 6.0)}
    labels = write(drawn_volume(body, 1.0), tmp_path / "labels.nrrd")
    names = tmp_path / "names.json"
    names.write_text(json.dumps({"1": "common duct", "2": "gallbladder"}))
    done = run("anatomy", "--labels", labels, "--names", names, "-o", tmp_path / "case")
    assert "may be mirrored" in done.stdout


def test_tubes_alone_and_of_unusual_sizes_are_doubted(tmp_path: Path) -> None:
    body = {
        1: Drawn((0.0, 0.0, 0.0), (0.0, 0.0, 50.0), 3.0),
        2: Drawn((0.0, 0.0, 24.0), (-60.0, 0.0, 60.0), 4.0),
        3: Drawn((-25.0, 0.0, 0.0), (-25.0, 0.0, 25.0), 6.0),
    }
    labels = write(drawn_volume(body, 1.0), tmp_path / "labels.nrrd")
    names = tmp_path / "names.json"
    names.write_text('{"1": "common duct", "2": "cystic duct", "3": "gallbladder"}')
    done = run("anatomy", "--labels", labels, "--names", names, "-o", tmp_path / "case")
    doubts = re.findall(r"^doubt +(.*)$", done.stdout, flags=re.MULTILINE)
    assert "gallbladder joins no other tube: its label may end too early" in doubts
    assert any(
        re.match(r"cystic_duct is [67]\d\.\d mm long, and 6 to 50 mm", one) for one in doubts
    )
    assert any(re.match(r"cystic_duct is 7\.\d mm wide, and 1\.6 to 5 mm", one) for one in doubts)


def test_a_volume_that_cuts_through_a_tube_s_side_is_doubted(
    volume: LabelVolume, names: Path, tmp_path: Path
) -> None:
    _, _, i = np.nonzero(volume.values == 1)
    middle = int(np.median(i))
    half = LabelVolume(
        volume.source, np.ascontiguousarray(volume.values[:, :, middle - 1 :]), volume.sizes,
        volume.origin, volume.axes,
    )  # fmt: skip
    names.write_text('{"1": "common duct"}')
    labels = write(half, tmp_path / "half.nrrd")
    done = run("anatomy", "--labels", labels, "--names", names, "-o", tmp_path / "case")
    assert re.search(r"common_duct: \d+% of its side lie outside the volume", done.stdout)


def test_an_empty_segment_and_the_background_s_name_do_no_harm(
    volume: LabelVolume, tmp_path: Path
) -> None:
    names = {1: "common duct", 9: "cystic duct"}
    labels = write(
        LabelVolume(volume.source, volume.values, volume.sizes, volume.origin, volume.axes, names),
        tmp_path / "labels.seg.nrrd",
        names=True,
    )
    done = run("anatomy", "--labels", labels, "-o", tmp_path / "case")
    assert done.returncode == 0, done.stderr
    assert re.search(r"left out +cystic duct, empty", done.stdout)
    (tmp_path / "names.json").write_text('{"0": "background", "1": "common duct"}')
    more = ["--names", tmp_path / "names.json"]
    again = run("anatomy", "--labels", labels, *more, "-o", tmp_path / "again")
    assert again.returncode == 0, again.stderr


Inputs = tuple[Path, str | None]


def grey(folder: Path, volume: LabelVolume) -> Inputs:
    image = sitk.GetImageFromArray(np.linspace(0, 1, 4000, dtype=np.float32).reshape(10, 20, 20))
    sitk.WriteImage(image, str(folder / "grey.nrrd"))
    return folder / "grey.nrrd", None


def empty(folder: Path, volume: LabelVolume) -> Inputs:
    sitk.WriteImage(sitk.Image(20, 20, 20, sitk.sitkUInt8), str(folder / "empty.nrrd"))
    return folder / "empty.nrrd", None


def flat(folder: Path, volume: LabelVolume) -> Inputs:
    sitk.WriteImage(sitk.Image(20, 20, 1, sitk.sitkUInt8), str(folder / "flat.nrrd"))
    return folder / "flat.nrrd", None


def plane(folder: Path, volume: LabelVolume) -> Inputs:
    sitk.WriteImage(sitk.Image(20, 20, sitk.sitkUInt8), str(folder / "plane.nrrd"))
    return folder / "plane.nrrd", None


def cut_short(folder: Path, volume: LabelVolume) -> Inputs:
    path = write(volume, folder / "labels.nii.gz")
    path.write_bytes(path.read_bytes()[:-400])
    return path, '{"1": "common duct"}'


def other_grids(folder: Path, volume: LabelVolume) -> Inputs:
    masks = as_masks(volume, folder / "masks")
    shifted = LabelVolume(
        volume.source, (volume.values == 1).astype(np.int32), volume.sizes, volume.origin + 3.0,
        volume.axes,
    )  # fmt: skip
    write(shifted, masks / "zz duct.nrrd")
    return masks, None


def empty_folder(folder: Path, volume: LabelVolume) -> Inputs:
    (folder / "none").mkdir()
    return folder / "none", None


def named(names: object) -> Callable[[Path, LabelVolume], Inputs]:
    def make(folder: Path, volume: LabelVolume) -> Inputs:
        text = names if isinstance(names, str) else json.dumps(names)
        return write(volume, folder / "labels.nii.gz"), text

    return make


def drawn(tubes: dict[int, Drawn], names: Any, size: float = 1.0) -> Callable[..., Inputs]:
    def make(folder: Path, volume: LabelVolume) -> Inputs:
        return write(drawn_volume(tubes, size), folder / "labels.nii.gz"), json.dumps(names)

    return make


def in_two(folder: Path, volume: LabelVolume) -> Inputs:
    values = volume.values.copy()
    values[28:33] = 0
    broken = LabelVolume(volume.source, values, volume.sizes, volume.origin, volume.axes)
    return write(broken, folder / "labels.nii.gz"), '{"1": "common duct"}'


def stored(
    change: Callable[[NDArray[np.int32]], Any],
    text: str | None = '{"1": "duct"}',
    *,
    size: float = 1.0,
    header: dict[str, str] | None = None,
) -> Callable[..., Inputs]:
    """A file of the volume's values changed."""

    def make(folder: Path, volume: LabelVolume) -> Inputs:
        values = np.ascontiguousarray(change(volume.values))
        image = sitk.GetImageFromArray(values, isVector=False)
        image.SetSpacing([size] * values.ndim)
        for key, value in (header or {}).items():
            image.SetMetaData(key, value)
        sitk.WriteImage(image, str(folder / "labels.nrrd"))
        return folder / "labels.nrrd", text

    return make


def segments(*named: tuple[str, str]) -> Callable[..., Inputs]:
    header = {
        f"Segment{number}_{key}": value
        for number, pair in enumerate(named)
        for key, value in zip(("Name", "LabelValue"), pair, strict=True)
    }
    return stored(lambda values: values.astype(np.uint8), None, header=header)


def tilted(folder: Path, volume: LabelVolume) -> Inputs:
    """Slices at a tilt, which no turn makes upright."""
    path, names = stored(lambda values: values.astype(np.uint8))(folder, volume)
    upright, leaning = b"space directions: (1,0,0)", b"space directions: (1,1,0)"
    content = path.read_bytes()
    assert upright in content
    path.write_bytes(content.replace(upright, leaning))
    return path, names


def four_times(folder: Path, volume: LabelVolume) -> Inputs:
    images = [sitk.GetImageFromArray(volume.values.astype(np.uint8))] * 4
    sitk.WriteImage(sitk.JoinSeries(images), str(folder / "labels.nii.gz"))
    return folder / "labels.nii.gz", '{"1": "duct"}'


def no_bytes(folder: Path, volume: LabelVolume) -> Inputs:
    (folder / "labels.nrrd").write_bytes(b"")
    return folder / "labels.nrrd", None


def test_a_ring_is_doubted(tmp_path: Path, names: Path) -> None:
    k, j, i = np.indices((14, 40, 40))
    away = np.hypot(np.hypot(i - 19.5, j - 19.5) - 9.0, k - 6.5)
    torus = LabelVolume(
        Path("ring"), (away < 3.5).astype(np.int32), np.ones(3), np.zeros(3), np.eye(3)
    )
    names.write_text('{"1": "duct"}')
    labels = write(torus, tmp_path / "ring.nii.gz")
    done = run("anatomy", "--labels", labels, "--names", names, "-o", tmp_path / "case")
    assert "be a ring" in done.stdout


BROKEN: dict[str, tuple[Callable[..., Inputs], str]] = {
    "grey levels": (grey, "grey values"),
    "no label": (empty, "names none of its labels"),
    "one slice": (flat, "20 x 20 x 1 voxels"),
    "two dimensions": (plane, "2 dimensions"),
    "a file cut short": (cut_short, "cut short"),
    "masks of two grids": (other_grids, "different grids"),
    "a folder without masks": (empty_folder, "no NIfTI"),
    "no file": (lambda folder, volume: (folder / "no.nii.gz", None), "no volume of labels at"),
    "a picture": (lambda folder, volume: (Path(__file__), None), "is no volume of labels"),
    "no names": (lambda folder, volume: (write(volume, folder / "a.nii.gz"), None),
                 "give their names"),
    "names that are no JSON": (named("{"), "names.json"),
    "names that are a list": (named([1, 2]), "names.json"),
    "names of no label": (named({}), "names no label"),
    "a label that is not there": (named({"9": "common duct"}), "label 9 .*it has 1, 2, 3"),
    "a name twice": (named({"1": "common duct", "2": "Common  duct"}), "name of its own"),
    "a name of nothing": (named({"1": " "}), "needs a name"),
    "a name that is a path": (named({"1": "../duct"}), "needs a name that can be a file's"),
    "a kind that nobody knows": (named({"1": "thing"}), "'thing'.*kind"),
    "a kind that is none": (named({"1": {"name": "a", "kind": "nerve"}}), "nerve"),
    "an unknown field": (named({"1": {"name": "a duct", "colour": 3}}), "colour"),
    "nothing but what is shown": (named({"1": "liver"}), "named as a tube"),
    "a tube in two pieces": (in_two, r"2 parts, the second \d"),
    "three voxels": (drawn({1: Drawn((0, 0, 0), (0, 0, 3), 0.6)}, {"1": "duct"}), "voxels"),
    "a ball": (drawn({1: Drawn((0, 0, 0), (0, 0, 7), 4.0)}, {"1": "duct"}), "no tube"),
    "a volume in time": (four_times, "4 dimensions"),
    "no bytes": (no_bytes, "damaged, cut short"),
    "halves": (stored(lambda values: 0.5 * values), "labels are whole numbers"),
    "a value that is none": (stored(lambda values: np.where(values == 1, np.nan, values)),
                             "labels are whole numbers"),
    "numbers below 0": (stored(lambda values: values - 1), "0 and a few numbers above it"),
    "levels of a CT": (stored(lambda values: np.arange(values.size).reshape(values.shape)),
                       "0 and a few numbers above it"),
    "slices at a tilt": (tilted, "not perpendicular.*resample"),
    "metres for mm": (stored(lambda values: values, size=1e-3), "slip of the unit"),
    "a label that fills the volume": (stored(np.ones_like), "the volume ends where"),
    "a segment of no number": (segments(("duct", "one")), "'duct' .*LabelValue 'one'"),
    "two segments of one label": (segments(("duct a", "1"), ("duct b", "1")), "same label 1"),
    "empty segments": (segments(("duct", "9")), "names none of its labels"),
    "a word for a label": (named({"duct": "1"}), "'duct', which is no label"),
    "a label named twice": (named('{"1": "common duct", "1": "cystic duct"}'), "label 1 twice"),
    "a name that nobody can read": (named({"1": "duct " + 200 * "x"}), "up to 100 bytes"),
    "a name that hides its file": (named({"1": ".duct"}), "that can be a file's"),
    "a thread": (drawn({1: Drawn((0, 0, 0), (0, 0, 40), 0.6)}, {"1": "duct"}), "voxels thick"),
}  # fmt: skip


@pytest.mark.parametrize("what", BROKEN)
def test_broken_input_is_refused_in_one_sentence(
    what: str, volume: LabelVolume, tmp_path: Path
) -> None:
    make, says = BROKEN[what]
    labels, text = make(tmp_path, volume)
    arguments: list[object] = ["anatomy", "--labels", labels, "-o", tmp_path / "case"]
    if text is not None:
        (tmp_path / "names.json").write_text(text)
        arguments += ["--names", tmp_path / "names.json"]
    message = refused(arguments)
    assert re.search(says, message), message
    assert not (tmp_path / "case").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--labels", "a.nrrd"], "needs -o"),
        (["normal", "--names", "n.json"], "--names goes with --labels"),
        (["--labels", "a.nrrd", "--seed", 3, "-o", "case"], "--labels or --list"),
        (["--labels", "a.nrrd", "-o", __file__], "it is a file"),
        (["--labels", "a.nrrd", "-o", "case", "--figure", "a.bmp"], ".png, .svg or .pdf"),
    ],
)
def test_wrong_words_are_refused(arguments: list[object], says: str) -> None:
    assert says in refused(["anatomy", *arguments])


@pytest.mark.parametrize("seed", [3, pytest.param(8, marks=pytest.mark.long)])
def test_a_drawn_case_is_found_again_in_its_labels(seed: int) -> None:
    """All joins and no other, each tube's axis and radius; arteries are 3 to 4 voxels thick."""
    anatomy = drawn_anatomy(seed)
    volume = anatomy_labels(anatomy, tube_lines(anatomy), 0.5)
    kinds = {number + 1: tube for number, tube in enumerate(anatomy.tube)}
    names = {label: NamedLabel(tube.name, tube.kind) for label, tube in kinds.items()}
    found = patient_case(volume, names).tubes
    assert {frozenset((join.tube, join.to)) for join in found.joins} == {
        frozenset((join.tube, join.to)) for join in anatomy.join
    }
    lines, rows = tube_lines(anatomy), np.array(HEAD_RIGHT_FRONT)
    for tube in found.tubes:
        line = lines[tube.name]
        organ = tube.built.organ
        at = np.linspace(0.25, 0.75, 30) * organ.length
        away, nearest = KDTree(line.places @ rows).query(organ.axis_at(at))
        # Half the line's own step of 0.5 mm, and a part of a voxel.
        assert np.sqrt((away**2).mean()) < 0.35, tube.name
        radii = np.sqrt(organ.section_properties(at).area / np.pi)
        assert (radii / line.radius[nearest]).mean() == pytest.approx(1.0, abs=0.1), tube.name


def test_labels_of_an_anatomy_have_its_names_kinds_and_volumes(tmp_path: Path) -> None:
    path = tmp_path / "normal.seg.nrrd"
    done = run("anatomy", "normal", "--voxels", path, "--voxel-mm", 0.6)
    assert done.returncode == 0, done.stderr
    anatomy = read_anatomy(shipped_anatomies()["normal"])
    lines = tube_lines(anatomy)
    volume = read_labels(path)
    assert [volume.names[label] for label in volume.labels] == list(lines)
    named = named_labels(volume, None)
    assert [named[label].role for label in volume.labels] == [tube.kind for tube in anatomy.tube]
    size = 0.6**3
    for label, count in volume.label_sizes().items():
        line = lines[volume.names[label]]
        # Of a tube around a smooth axis (Pappus), less what is the thicker tube's where they join.
        whole = float(np.trapezoid(np.pi * line.radius**2, line.stations))
        lost = 0.0
        for join in anatomy.join:
            if join.tube == volume.names[label]:
                to, end = lines[join.to], line.places[-join.end]
                thick = float(np.interp(to.nearest(end), to.stations, to.radius))
                # From the axis to the wall at 30 degrees or more.
                lost += 2.0 * thick * np.pi * float(line.radius.max()) ** 2
        assert 0.97 * whole - lost < count * size < 1.03 * whole, volume.names[label]
        middle = line.at(0.5 * line.length) @ np.array(HEAD_RIGHT_FRONT)
        i, j, k = np.rint(volume.indices(middle[np.newaxis])[0]).astype(int)
        assert volume.values[k, j, i] == label


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["normal", "--voxels", "a.nii.gz"], ".seg.nrrd"),
        (["normal", "--voxels", "a.nrrd", "--voxel-mm", 0.0], "0.05 to 5 mm"),
        (["normal", "--voxels", "a.nrrd", "--voxel-mm", 0.06], "give larger ones"),
        (["--list", "--voxels", "a.nrrd"], "--voxels is of one anatomy"),
    ],
)
def test_voxels_that_cannot_be_are_refused(
    arguments: list[object], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert says in refused(["anatomy", *arguments])
    assert not list(tmp_path.iterdir())


def test_a_cystic_artery_is_offered_and_drawn_in(tmp_path: Path) -> None:
    body = {
        1: Drawn((0.0, 0.0, 0.0), (0.0, 0.0, 50.0), 3.0),
        2: Drawn((-8.0, 0.0, 20.0), (-45.0, 0.0, 20.0), 6.0),
        3: Drawn((12.0, 8.0, 34.0), (-20.0, 8.0, 40.0), 2.0),
    }
    labels = write(drawn_volume(body, 1.0), tmp_path / "labels.nrrd")
    names = tmp_path / "names.json"
    names.write_text('{"1": "common duct", "2": "gallbladder", "3": "right hepatic artery"}')
    arguments = ["anatomy", "--labels", labels, "--names", names, "-o", tmp_path / "case"]
    assert "--draw-artery draws one in" in run(*arguments).stdout
    done = run(*arguments, "--draw-artery")
    assert done.returncode == 0, done.stderr
    anatomy = read_anatomy(tmp_path / "case" / "anatomy.toml")
    artery = anatomy.tube_named("cystic_artery")
    assert artery.confidence == "assumed"
    assert artery.organ is None
    assert {join.to for join in anatomy.join if join.tube == "cystic_artery"} == {
        "right_hepatic_artery", "gallbladder",
    }  # fmt: skip
    assert any(layer.tube == "cystic_artery" for layer in anatomy.layer)
    names.write_text('{"1": "common duct", "2": "gallbladder", "3": "cystic artery"}')
    assert "already" in refused([*arguments, "--draw-artery"])
    names.write_text('{"1": "common duct"}')
    assert "right_hepatic_artery" in refused([*arguments, "--draw-artery"])
    assert "--draw-artery goes with --labels" in refused(["anatomy", "normal", "--draw-artery"])
