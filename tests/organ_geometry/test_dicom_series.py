"""A DICOM series is taken in the order and at the distances at which its images stand."""

import locale
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from organ_geometry import ReadOptions
from organ_geometry.images.grey_image import ImageStackError
from organ_geometry.images.stack_reader import read_image_stack

itk = pytest.importorskip("SimpleITK")

WriteSeries = Callable[..., Path]

# Rows and columns of an oblique series, and its normal.
COLUMN = np.array([0.6, 0.8, 0.0])
ROW = np.array([0.0, 0.0, -1.0])
NORMAL = np.cross(COLUMN, ROW)
FIRST = np.array([10.0, -20.0, 30.0])
SHAPE = (6, 8)


def text(numbers: NDArray[np.float64]) -> str:
    return "\\".join(f"{number:.10g}" for number in numbers)


@pytest.fixture
def write_series(tmp_path: Path) -> WriteSeries:
    """Writes images, each full of its number, at heights along the normal, mm."""

    def write(
        heights: Sequence[float],
        names: Sequence[str] | None = None,
        tags: dict[str, str | None] | None = None,
        dtype: Any = np.int16,
        shape: tuple[int, ...] = SHAPE,
    ) -> Path:
        folder = tmp_path / "series"
        folder.mkdir(exist_ok=True)
        before = locale.setlocale(locale.LC_ALL)
        for index, height in enumerate(heights):
            image = itk.GetImageFromArray(np.full(shape, index, dtype), isVector=len(shape) > 2)
            image.SetSpacing((0.25, 0.5))
            stored = {
                "0008|0060": "CT",
                "0018|0050": "3",
                "0020|000d": "1.2.3",
                "0020|000e": "1.2.3.4",
                "0020|0032": text(FIRST + height * NORMAL),
                "0020|0037": text(np.concatenate([COLUMN, ROW])),
                "0020|0013": "1",
            }
            for tag, value in (stored | (tags or {})).items():
                if value is not None:
                    image.SetMetaData(tag, value)
            writer = itk.ImageFileWriter()
            writer.KeepOriginalImageUIDOn()
            name = f"image{index}.dcm" if names is None else names[index]
            writer.SetFileName(str(folder / f"{name}.dcm"))
            writer.Execute(image)
            (folder / f"{name}.dcm").rename(folder / name)
        # GDCM leaves the process in the C locale after it has written.
        locale.setlocale(locale.LC_ALL, before)
        return folder

    return write


def numbers(path: Path, **options: Any) -> list[int]:
    stack = read_image_stack(path, ReadOptions(**options))
    return [round(stack.level_offset + int(image[0, 0])) for image in stack.images()]


def test_images_come_in_the_order_of_their_places(write_series: WriteSeries) -> None:
    # Files named in another order, numbered all alike, 2 mm apart where SliceThickness says 3.
    folder = write_series([4.0, 0.0, 6.0, 2.0])
    stack = read_image_stack(folder)
    assert numbers(folder) == [1, 3, 0, 2]
    assert stack.names == ("image1.dcm", "image3.dcm", "image0.dcm", "image2.dcm")
    assert stack.slice_spacing == pytest.approx(2.0)
    assert stack.pixel_size.tolist() == [0.25, 0.5]
    assert stack.notes == ()
    assert stack.bytes_in == sum(file.stat().st_size for file in folder.iterdir())
    # ImagePositionPatient is the centre of the first pixel, an origin that of the image.
    middle = 3.5 * 0.25 * COLUMN + 2.5 * 0.5 * ROW
    for index, origin in enumerate(stack.origins):
        np.testing.assert_allclose(origin, FIRST + middle + 2.0 * index * NORMAL, atol=1e-6)
        np.testing.assert_allclose(
            stack.frames[index], np.stack([COLUMN, ROW, NORMAL], axis=1), atol=1e-9
        )


def test_files_are_known_by_their_mark_and_may_have_no_suffix(write_series: WriteSeries) -> None:
    folder = write_series([2.0, 0.0], names=["A1", "A2"])
    (folder / "notes.txt").write_text("not an image")
    (folder / "DICOMDIR").write_bytes((folder / "A1").read_bytes())
    assert numbers(folder) == [1, 0]


def test_empty_identifiers_make_one_series(write_series: WriteSeries) -> None:
    folder = write_series([0.0, 1.0, 2.0], tags={"0020|000d": "", "0020|000e": ""})
    assert numbers(folder) == [0, 1, 2]


def test_one_of_several_series_is_named_by_one_of_its_files(write_series: WriteSeries) -> None:
    write_series([0.0, 1.0], names=["a0.dcm", "a1.dcm"], tags={"0008|103e": "thorax"})
    folder = write_series(
        [5.0, 6.0, 7.0], names=["b0.dcm", "b1.dcm", "b2.dcm"], tags={"0020|000e": "1.2.3.5"}
    )
    refused(
        folder,
        r"holds 2 series: give one file of the one wanted, such as a0.dcm \(2 images 'thorax'\), "
        r"b0.dcm \(3 images\)",
    )
    assert numbers(folder / "b1.dcm") == [0, 1, 2]
    assert len(read_image_stack(folder / "a1.dcm")) == 2


def test_an_overview_of_another_direction_is_another_series(write_series: WriteSeries) -> None:
    write_series([0.0, 1.0])
    turned = {"0020|0037": text(np.concatenate([COLUMN, NORMAL]))}
    refused(write_series([9.0], names=["scout.dcm"], tags=turned), "holds 2 series")


def test_two_images_at_one_place_are_named(write_series: WriteSeries) -> None:
    refused(
        write_series([0.0, 2.0, 2.0, 4.0]),
        r"image1.dcm and image2.dcm stand at one position \(in .*\): a series has one image",
    )


def test_a_gap_is_said_and_kept(write_series: WriteSeries) -> None:
    stack = read_image_stack(write_series([0.0, 2.0, 4.0, 8.0, 10.0]))
    assert stack.notes == (
        "the images are 2 mm apart, but 4 mm between image2.dcm and image3.dcm: "
        "they are taken where they stand",
    )
    np.testing.assert_allclose(
        (stack.origins - stack.origins[0]) @ NORMAL, [0, 2, 4, 8, 10], atol=1e-6
    )
    refused(stack.source, "not evenly spaced, and so are no volume", axis="i")


@pytest.mark.parametrize(
    ("element", "name"),
    [(0x32, "ImagePositionPatient"), (0x37, "ImageOrientationPatient")],
)
def test_a_missing_place_is_named(write_series: WriteSeries, element: int, name: str) -> None:
    folder = write_series([0.0])
    file = folder / "image0.dcm"
    # An element that nobody knows takes the place of (0020,0032) or (0020,0037).
    known, unknown = bytes([0x20, 0, element, 0]), bytes([0x20, 0, element, 1])
    assert file.read_bytes().count(known) == 1
    file.write_bytes(file.read_bytes().replace(known, unknown))
    refused(folder, rf"image0.dcm does not say where it stands: its {name} .* not missing")


def test_values_are_in_the_series_unit(write_series: WriteSeries) -> None:
    folder = write_series([0.0, 1.0], tags={"0028|1052": "-1000", "0028|1053": "1"})
    stack = read_image_stack(folder)
    levels = [stack.level_offset + stack.level_step * int(im[0, 0]) for im in stack.images()]
    written = [
        itk.GetArrayFromImage(itk.ReadImage(str(f)))[0, 0, 0] for f in sorted(folder.iterdir())
    ]
    assert levels == written
    windowed = read_image_stack(folder, ReadOptions(window=(written[0] + 0.0, written[0] + 200.0)))
    assert windowed.image(1).dtype == np.uint8
    assert [int(image[0, 0]) for image in windowed.images()] == [0, written[1] - written[0]]


def test_a_series_turns_like_a_volume(write_series: WriteSeries) -> None:
    folder = write_series([0.0, 2.0, 4.0])
    turned = read_image_stack(folder, ReadOptions(axis="i"))
    assert turned.shape == (3, 6)
    assert len(turned) == 8
    assert turned.pixel_size == pytest.approx([0.5, 2.0])


def refused(path: Path, message: str, **options: Any) -> None:
    with pytest.raises(ImageStackError, match=message) as error:
        list(read_image_stack(path, ReadOptions(**options)).images())
    assert "\n" not in str(error.value)


def test_other_than_grey_series_are_refused(write_series: WriteSeries) -> None:
    refused(write_series([0.0], dtype=np.uint8, shape=(6, 8, 3)), "image0.dcm is in colour")
    folder = write_series([0.0, 1.0])
    refused(folder, "has grey values and no labels", label=1)
    assert cv2.imwrite(str(folder / "preview.png"), np.zeros((4, 4), np.uint8))
    refused(folder, "holds 2 DICOM files and 1 other images")


@pytest.mark.parametrize("fraction", [0.0, 0.2, 0.9])
def test_a_file_cut_short_is_named(write_series: WriteSeries, fraction: float) -> None:
    folder = write_series([0.0, 1.0, 2.0], dtype=np.uint16, shape=(64, 64))
    cut = folder / "image1.dcm"
    cut.write_bytes(cut.read_bytes()[: int(fraction * cut.stat().st_size)])
    refused(folder, r"image1.dcm (cannot be read|does not say where it stands|is not one grey)")


def test_the_abdomen_s_slices_are_two_mm_apart_head_last(data_dir: Path) -> None:
    stack = read_image_stack(data_dir / "dicom_abdomen_ct" / "series")
    assert stack.slice_spacing == 2.0
    np.testing.assert_array_equal(np.diff(stack.origins, axis=0), [[0.0, 0.0, 2.0]] * 19)
    np.testing.assert_array_equal(stack.frames, np.broadcast_to(np.eye(3), (20, 3, 3)))
    # The file of the lowest place is the last by name.
    assert stack.names[0] == "IM0020.dcm"
    np.testing.assert_allclose(
        stack.origins[0],
        [-249.51171875 + 255.5 * 0.9765625, -437.51171875 + 255.5 * 0.9765625, -804.5],
    )
    air = stack.image(0)[0, 0] + stack.level_offset
    assert air == -1024
