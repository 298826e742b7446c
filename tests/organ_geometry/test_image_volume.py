"""Volumes stand where their files say, along any axis, and are refused with one clear line."""

import gzip
import json
import re
import struct
import sys
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from organ_geometry import ReadOptions
from organ_geometry.images.grey_image import ImageStackError
from organ_geometry.images.image_stack import ImageStack
from organ_geometry.images.medical_file import read_values
from organ_geometry.images.stack_reader import read_image_stack

itk = pytest.importorskip("SimpleITK")

SUFFIXES = [".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd"]
SPACING = (0.5, 0.75, 2.0)
ORIGIN = (-12.0, 30.5, 700.25)


def rotation(seed: int) -> NDArray[np.float64]:
    """A rotation drawn at random."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def noise(dtype: Any = np.uint8, shape: tuple[int, ...] = (5, 6, 7)) -> NDArray[Any]:
    return np.random.default_rng(1).integers(0, 200, shape).astype(dtype)


@pytest.fixture
def write_volume(tmp_path: Path) -> Callable[..., Path]:
    """Writes (K, J, I) voxels to a file, oblique in space."""

    def write(voxels: NDArray[Any], suffix: str = ".nrrd", vector: bool = False) -> Path:
        image = itk.GetImageFromArray(voxels, isVector=vector)
        if voxels.ndim == 3:
            image.SetSpacing(SPACING)
            image.SetOrigin(ORIGIN)
            image.SetDirection(rotation(3).ravel().tolist())
        path = tmp_path / f"volume{suffix}"
        itk.WriteImage(image, str(path), suffix != ".nii")
        return path

    return write


def places(stack: ImageStack, section: int, row: int, column: int) -> NDArray[np.float64]:
    """Where a pixel stands, as the stack's own description has it."""
    rows, columns = stack.shape
    offset = np.array([column - (columns - 1) / 2, row - (rows - 1) / 2]) * stack.pixel_size
    return stack.origins[section] + stack.frames[section][:, :2] @ offset


@pytest.mark.parametrize("axis", [None, "i", "j", "k", 0, 1, 2])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_voxel_stands_where_the_file_says(
    write_volume: Callable[..., Path], suffix: str, axis: str | int | None
) -> None:
    voxels = noise()
    path = write_volume(voxels, suffix)
    stack = read_image_stack(path, ReadOptions(axis=axis))
    across = 2 if axis is None else axis if isinstance(axis, int) else "ijk".index(axis)
    assert len(stack) == voxels.shape[2 - across]
    image = itk.ReadImage(str(path))
    for section, picture in enumerate(stack.images()):
        assert picture.dtype == np.uint8
        assert picture.shape == stack.shape
        for row in (0, stack.shape[0] - 1):
            for column in (0, 3, stack.shape[1] - 1):
                i, j, k = {
                    0: (section, column, row),
                    1: (column, section, row),
                    2: (column, row, section),
                }[across]
                assert picture[row, column] == voxels[k, j, i]
                np.testing.assert_allclose(
                    places(stack, section, row, column),
                    image.TransformIndexToPhysicalPoint((i, j, k)),
                    atol=1e-4,  # NIfTI keeps single floats
                )
    along = np.diff(stack.origins, axis=0)
    np.testing.assert_allclose(
        along, stack.slice_spacing * stack.frames[1:, :, 2], atol=1e-4, rtol=0
    )
    np.testing.assert_allclose(
        np.swapaxes(stack.frames, 1, 2) @ stack.frames,
        np.eye(3)[None].repeat(len(stack), 0),
        atol=1e-12,
    )


def nifti(voxels: NDArray[np.int16], rows: list[list[float]]) -> bytes:
    """A NIfTI-1 file as its standard lays it out, with a qform-less sform in RAS mm."""
    header = bytearray(348)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 3, *voxels.shape[::-1], 1, 1, 1, 1)
    struct.pack_into("<2h", header, 70, 4, 16)
    size = np.linalg.norm(np.array(rows)[:, :3], axis=0)
    struct.pack_into("<8f", header, 76, 1.0, *size, 0, 0, 0, 0)
    struct.pack_into("<f", header, 108, 352.0)
    header[123] = 2
    struct.pack_into("<2h", header, 252, 0, 2)
    for index, row in enumerate(rows):
        struct.pack_into("<4f", header, 280 + 16 * index, *row)
    header[344:348] = b"n+1\0"
    return bytes(header) + b"\0" * 4 + voxels.astype("<i2").tobytes()


def test_a_nifti_s_ras_is_turned_into_lps(tmp_path: Path) -> None:
    # Voxel (i, j, k) at RAS (10 - 2 i, 20 + 3 j, 30 + 4 k).
    rows = [[-2.0, 0.0, 0.0, 10.0], [0.0, 3.0, 0.0, 20.0], [0.0, 0.0, 4.0, 30.0]]
    path = tmp_path / "a.nii"
    path.write_bytes(nifti(noise(np.int16), rows))
    stack = read_image_stack(path)
    np.testing.assert_allclose(places(stack, 2, 1, 3), [-(10 - 6), -(20 + 3), 30 + 8], atol=1e-5)
    packed = tmp_path / "b.nii.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    np.testing.assert_array_equal(read_image_stack(packed).origins, stack.origins)
    assert read_image_stack(packed).bytes_in == packed.stat().st_size


@pytest.mark.parametrize(("axis", "expected"), [("x", 0), ("y", 1), ("z", 2), ("Z", 2)])
def test_directions_in_space_name_the_nearest_axis(
    tmp_path: Path, axis: str, expected: int
) -> None:
    voxels = noise()
    # Index axes i, j, k lie near y, z, x.
    near = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    image = itk.GetImageFromArray(voxels)
    image.SetDirection(near.ravel().tolist())
    itk.WriteImage(image, str(tmp_path / "a.nrrd"))
    assert len(read_image_stack(tmp_path / "a.nrrd", ReadOptions(axis=axis))) == (5, 7, 6)[expected]


def test_a_label_in_two_parts_is_doubted(tmp_path: Path) -> None:
    voxels = np.zeros((20, 9, 9), dtype=np.uint8)
    voxels[2:18, 3:6, 3:6] = 4
    path = tmp_path / "labels.nrrd"
    itk.WriteImage(itk.GetImageFromArray(voxels), str(path))
    assert read_image_stack(path, ReadOptions(label=4)).doubts == ()
    voxels[10:13] = 0
    itk.WriteImage(itk.GetImageFromArray(voxels), str(path))
    assert read_image_stack(path, ReadOptions(label=4)).doubts == (
        "label 4 is in 2 parts, the second 4.0 mm from the first and 38% of it, and an organ is "
        "one: join them",
    )


def test_a_label_becomes_a_mask_and_a_missing_one_is_answered_with_all(
    write_volume: Callable[..., Path],
) -> None:
    voxels = np.zeros((4, 5, 6), dtype=np.int16)
    voxels[1, 2:4, 1:3], voxels[2, 0, 0] = 3, 700
    path = write_volume(voxels)
    stack = read_image_stack(path, ReadOptions(label=3))
    np.testing.assert_array_equal(np.stack(list(stack.images())), (voxels == 3) * 255)
    with pytest.raises(ImageStackError, match=r"label 5 is not in .*, which has 3, 700$"):
        read_image_stack(path, ReadOptions(label=5))
    with pytest.raises(ImageStackError, match="label and a window cannot be given together"):
        read_image_stack(path, ReadOptions(label=3, window=(0, 1)))


def values_of(stack: ImageStack) -> NDArray[np.float64]:
    levels = np.stack(list(stack.images())).astype(np.float64)
    return stack.level_offset + stack.level_step * levels


@pytest.mark.parametrize("dtype", [np.int8, np.int16, np.int32, np.uint16])
def test_whole_numbers_keep_every_value(write_volume: Callable[..., Path], dtype: Any) -> None:
    voxels = noise(np.int64) - (0 if np.iinfo(dtype).min == 0 else 100)
    stack = read_image_stack(write_volume(voxels.astype(dtype)))
    np.testing.assert_array_equal(values_of(stack), voxels)


def test_floats_keep_their_range_in_65536_levels(write_volume: Callable[..., Path]) -> None:
    voxels = np.random.default_rng(2).normal(size=(4, 5, 6)).astype(np.float32)
    stack = read_image_stack(write_volume(voxels))
    assert stack.image(0).dtype == np.uint16
    step = (voxels.max() - voxels.min()) / 65535
    np.testing.assert_allclose(values_of(stack), voxels, atol=0.5001 * step)
    voxels[1, 1, 1] = np.nan
    assert read_image_stack(write_volume(voxels)).image(1)[1, 1] == 0


@pytest.mark.parametrize(
    ("dtype", "window", "kind"),
    [
        (np.int16, (-20.0, 80.0), np.uint8),
        (np.int16, (-1000.0, 80.0), np.uint16),
        (np.uint8, (-20.0, 80.0), np.uint8),
        (np.uint8, (20.0, 1000.0), np.uint16),
        (np.float32, (-20.0, 80.0), np.uint16),
    ],
)
def test_a_window_clips_and_keeps_what_is_inside(
    write_volume: Callable[..., Path], dtype: Any, window: tuple[float, float], kind: Any
) -> None:
    voxels = noise(np.int64) - (0 if dtype == np.uint8 else 100)
    stack = read_image_stack(write_volume(voxels.astype(dtype)), ReadOptions(window=window))
    assert stack.image(0).dtype == kind
    atol = 0.0 if dtype != np.float32 else 0.5001 * stack.level_step
    np.testing.assert_allclose(values_of(stack), np.clip(voxels, *window), atol=atol)


@pytest.mark.parametrize("window", [(5.0, 5.0), (6.0, 5.0), (float("nan"), 1.0), (0.0, np.inf)])
def test_a_window_has_its_lower_end_first(
    write_volume: Callable[..., Path], window: tuple[float, float]
) -> None:
    with pytest.raises(ImageStackError, match="lowest and the highest value kept, as -150,500"):
        read_image_stack(write_volume(noise()), ReadOptions(window=window))


def test_given_sizes_win_and_the_directions_stay(write_volume: Callable[..., Path]) -> None:
    path = write_volume(noise())
    stack = read_image_stack(path, ReadOptions(pixel_size=(1.0, 3.0), slice_spacing=5.0))
    assert stack.pixel_size.tolist() == [1.0, 3.0]
    as_stored = read_image_stack(path)
    np.testing.assert_array_equal(stack.frames, as_stored.frames)
    np.testing.assert_allclose(
        stack.origins[3], as_stored.origins[0] + 15.0 * as_stored.frames[0, :, 2]
    )
    with pytest.raises(ImageStackError, match="slip of the unit"):
        read_image_stack(path, ReadOptions(slice_spacing=1e9))


@pytest.mark.parametrize("roi", [(1, 2, 4, 5), (0, 0, 0, 0, 3, 3), (2, 1, 6, 5, 1, 4)])
def test_a_region_keeps_pixels_and_places(
    write_volume: Callable[..., Path], roi: tuple[int, ...]
) -> None:
    path = write_volume(noise())
    whole = read_image_stack(path)
    region = read_image_stack(path, ReadOptions(roi=roi))  # pyright: ignore[reportArgumentType]
    x0, y0, x1, y1, first, last = roi if len(roi) == 6 else (*roi, 0, 4)
    assert region.shape == (y1 - y0 + 1, x1 - x0 + 1)
    assert region.names == whole.names[first : last + 1]
    for section, picture in enumerate(region.images()):
        np.testing.assert_array_equal(
            picture, whole.image(first + section)[y0 : y1 + 1, x0 : x1 + 1]
        )
        np.testing.assert_allclose(
            places(region, section, 0, 0), places(whole, first + section, y0, x0), atol=1e-12
        )


@pytest.mark.parametrize(
    ("roi", "message"),
    [
        ((0, 0, 7, 5), "columns must be from 0 to 6, the smaller first, not 0 to 7"),
        ((0, -1, 6, 5), "rows must be from 0 to 5, the smaller first, not -1 to 5"),
        ((4, 0, 3, 5), "columns must be from 0 to 6, the smaller first, not 4 to 3"),
        ((0, 0, 6, 5, 0, 5), "images must be from 0 to 4, the smaller first, not 0 to 5"),
        ((0, 0, 6), "x0,y0,x1,y1 or x0,y0,x1,y1,first,last, not 3 numbers"),
    ],
)
def test_a_region_must_be_inside(
    write_volume: Callable[..., Path], roi: tuple[int, ...], message: str
) -> None:
    with pytest.raises(ImageStackError, match=message):
        read_image_stack(write_volume(noise()), ReadOptions(roi=roi))  # pyright: ignore[reportArgumentType]


def refused(path: Path, message: str, **arguments: Any) -> None:
    with pytest.raises(ImageStackError, match=message) as error:
        read_image_stack(path, ReadOptions(**arguments))
    assert "\n" not in str(error.value)


def test_other_than_one_grey_volume_is_refused(
    write_volume: Callable[..., Path], tmp_path: Path
) -> None:
    refused(write_volume(noise(shape=(2, 4, 5, 6)), ".nii.gz"), "holds 2 volumes")
    colour = noise(shape=(4, 5, 6, 3))
    image = itk.GetImageFromArray(colour, isVector=True)
    itk.WriteImage(image, str(tmp_path / "colour.nrrd"))
    refused(tmp_path / "colour.nrrd", "has 3 values in each voxel, as colour has")
    refused(write_volume(noise(shape=(5, 6)), ".mha"), "is one image and not a volume")
    refused(write_volume(np.full((3, 4, 5), np.nan, np.float32)), "holds no finite value")
    refused(write_volume(noise()), "an axis must be x, y, z, i, j, k, 0, 1 or 2, not w", axis="w")


def test_four_dimensions_with_one_volume_are_read(write_volume: Callable[..., Path]) -> None:
    voxels = noise(shape=(1, 4, 5, 6))
    stack = read_image_stack(write_volume(voxels, ".nii"))
    np.testing.assert_array_equal(np.stack(list(stack.images())), voxels[0])


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("fraction", [0.0, 0.05, 0.5, 0.99])
def test_a_file_cut_short_is_named(
    write_volume: Callable[..., Path], suffix: str, fraction: float
) -> None:
    path = write_volume(noise(np.int16, (20, 20, 20)), suffix)
    beside = {".nhdr": "volume.raw.gz", ".mhd": "volume.zraw"}.get(suffix)
    cut = path if beside is None else path.with_name(beside)
    cut.write_bytes(cut.read_bytes()[: int(fraction * cut.stat().st_size)])
    refused(path, r"volume\S* (is cut short|is damaged or cut short|cannot be read)")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_another_file_of_that_name_is_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"letter{suffix}"
    path.write_text("Dear Sir or Madam,\n" * 50)
    refused(path, "letter.* (cannot be read|is damaged)")


def test_a_file_of_another_kind_is_answered_with_what_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.pdf").write_text("%PDF")
    refused(tmp_path / "a.pdf", r"a.pdf is one file and not a .*NIfTI \(.nii, .nii.gz\), NRRD")


def test_without_the_extra_the_command_that_helps_is_said(
    write_volume: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_volume(noise())
    monkeypatch.setitem(sys.modules, "SimpleITK", None)
    refused(path, r"SimpleITK, which is missing: pip install 'bluntdissect\[medical\]'$")


def test_images_of_files_turn_across_another_axis(write_stack: Callable[..., Path]) -> None:
    voxels = noise()
    spacing = {"pixel_spacing_mm": [0.5, 0.25], "slice_spacing_mm": 2.0}
    folder = write_stack(list(voxels), spacing)
    whole, turned = read_image_stack(folder), read_image_stack(folder, ReadOptions(axis="j"))
    # Without directions in spacing.json the sections stand along x, and rows run down z.
    np.testing.assert_array_equal(
        read_image_stack(folder, ReadOptions(axis="z")).origins, turned.origins
    )
    assert turned.pixel_size.tolist() == [0.25, 2.0]
    assert turned.slice_spacing == 0.5
    np.testing.assert_array_equal(turned.image(4), voxels[:, 4, :])
    np.testing.assert_allclose(places(turned, 4, 2, 3), places(whole, 2, 4, 3), atol=1e-12)


@pytest.mark.parametrize(
    ("spacing", "message"),
    [
        ({"slice_dir": [0.8, 0.6, 0.0]}, "not straight above each other"),
        (
            {
                "frames": [
                    {"origin_mm": [x, 0, 0], "col_dir": [0, 1, 0], "row_dir": [0, 0, 1]}
                    for x in (0, 1, 2, 3, 5)
                ]
            },
            "not evenly spaced",
        ),
        (
            {
                "frames": [
                    {"origin_mm": [x, 0, 0], "col_dir": [0, 1, 0], "row_dir": [0, 0, 1]}
                    for x in range(4)
                ]
                + [{"origin_mm": [4, 0, 0], "col_dir": [0, 0.6, 0.8], "row_dir": [0, -0.8, 0.6]}]
            },
            "not parallel",
        ),
    ],
)
def test_what_is_no_volume_cannot_be_turned(
    write_stack: Callable[..., Path], spacing: dict[str, Any], message: str
) -> None:
    folder = write_stack(list(noise()), {"pixel_spacing_mm": 1, "slice_spacing_mm": 1} | spacing)
    refused(folder, message, axis="i")


def test_labels_and_windows_of_image_files(write_stack: Callable[..., Path]) -> None:
    voxels = noise()
    folder = write_stack(list(voxels), {"pixel_spacing_mm": 1, "slice_spacing_mm": 1})
    label = int(voxels[2, 3, 4])
    masks = np.stack(list(read_image_stack(folder, ReadOptions(label=label)).images()))
    np.testing.assert_array_equal(masks, (voxels == label) * 255)
    windowed = read_image_stack(folder, ReadOptions(window=(50, 90)))
    np.testing.assert_array_equal(values_of(windowed), voxels.clip(50, 90))
    refused(folder, "label 201 is not in .*, which has 1, 3, ", label=201)


def test_threads_read_the_same(
    write_volume: Callable[..., Path], write_stack: Callable[..., Path]
) -> None:
    voxels = noise(shape=(40, 30, 20))
    folder = write_stack(list(voxels), {"pixel_spacing_mm": 1, "slice_spacing_mm": 1})
    for path in (write_volume(voxels), folder):
        stack = read_image_stack(path)
        with ThreadPoolExecutor(8) as threads:
            images = list(threads.map(stack.image, range(40)))
        np.testing.assert_array_equal(np.stack(images), voxels)


def resized(path: Path, size: int) -> None:
    """Let a MetaImage's header say another size of its compressed voxels."""
    content = path.read_bytes()
    output = re.sub(rb"CompressedDataSize = \d+", b"CompressedDataSize = %d" % size, content)
    assert output != content
    path.write_bytes(output)


@pytest.mark.parametrize("suffix", [".mha", ".mhd"])
@pytest.mark.parametrize("dtype", [np.uint8, np.int16])
def test_compressed_voxels_are_read_whole_where_their_size_is_wrong(
    write_volume: Callable[..., Path], suffix: str, dtype: Any
) -> None:
    voxels = noise(dtype, (30, 40, 50))
    path = write_volume(voxels, suffix)
    expected = read_values(path)
    resized(path, 5000)
    # What was in memory before is what the reader leaves where it reads too little.
    for level in (1, 2, 3):
        spoiled = np.full(voxels.nbytes, level, np.uint8)
        del spoiled
        np.testing.assert_array_equal(read_values(path), expected)
    np.testing.assert_array_equal(expected, voxels)


def test_voxels_of_the_other_byte_order_are_read_whole(write_volume: Callable[..., Path]) -> None:
    voxels = noise(np.int16, (30, 40, 50))
    path = write_volume(voxels, ".mhd")
    packed = zlib.compress(voxels.astype(">i2").tobytes())
    (path.parent / "volume.zraw").write_bytes(packed)
    order = (b"BinaryDataByteOrderMSB = False", b"BinaryDataByteOrderMSB = True")
    path.write_bytes(path.read_bytes().replace(*order))
    resized(path, 5000)
    np.testing.assert_array_equal(read_values(path), voxels)


@pytest.mark.parametrize("damaged", [False, True])
def test_compressed_voxels_that_are_too_few_are_refused(
    write_volume: Callable[..., Path], damaged: bool
) -> None:
    voxels = noise(shape=(30, 40, 50))
    path = write_volume(voxels, ".mhd")
    beside = path.parent / "volume.zraw"
    packed = zlib.compress(voxels[:20].tobytes())
    beside.write_bytes(packed[:-2000] + bytes(2000) if damaged else packed)
    resized(path, len(packed))
    message = "cannot be unpacked" if damaged else "need 60,000 bytes and 40,000 are in it"
    refused(path, message if not damaged else f"({message}|cannot be read|cut short)")


def test_a_volume_s_bytes_count_its_voxels_file(write_volume: Callable[..., Path]) -> None:
    path = write_volume(noise(), ".mhd")
    expected = path.stat().st_size + path.with_suffix(".zraw").stat().st_size
    assert read_image_stack(path).bytes_in == expected
    assert read_image_stack(path, ReadOptions(axis="i", roi=(0, 0, 2, 2))).bytes_in == expected


def test_the_aorta_is_the_same_in_images_nifti_and_nrrd(data_dir: Path) -> None:
    folder = data_dir / "aorta_ct"
    images = read_image_stack(folder / "images")
    volume = read_image_stack(folder / "ct_cropped.nii.gz", ReadOptions(window=(-150, 500)))
    for section in (0, 50, 129):
        # The images' 256 levels stand for -150 to 500 HU.
        scaled = volume.image(section) * (255.0 / 650.0)
        assert np.abs(scaled - images.image(section)).max() <= 1.0
    roi = (26, 30, 105, 125, 0, 129)
    for grey, crop in (("ct_cropped", "ct_crop_small"), ("aorta", "aorta_crop_small")):
        whole = read_image_stack(folder / f"{grey}.nii.gz", ReadOptions(roi=roi))
        small = read_image_stack(folder / f"{crop}.nrrd")
        np.testing.assert_allclose(whole.origins, small.origins, atol=1e-6)
        np.testing.assert_allclose(whole.frames, small.frames, atol=1e-12)
        np.testing.assert_array_equal(values_of(whole), values_of(small))


def frog_masks(data_dir: Path, folder: str, record: str) -> tuple[ImageStack, dict[str, Any]]:
    spacing = json.loads((data_dir / record).read_text())
    down, along = spacing["pixel_spacing"]
    stack = read_image_stack(
        data_dir / folder,
        ReadOptions(pixel_size=(along, down), slice_spacing=spacing["slice_spacing"]),
    )
    return stack, spacing


@pytest.mark.slow
def test_the_frog_s_label_is_its_masks_along_x(data_dir: Path) -> None:
    masks, spacing = frog_masks(
        data_dir, "frog_large_intestine/masks", "frog_large_intestine/spacing.json"
    )
    x, y, z = spacing["first_slice_volume_index_xyz"]
    rows, columns = masks.shape
    roi = (y, z, y + columns - 1, z + rows - 1, x, x + len(masks) - 1)
    volume = read_image_stack(
        data_dir / "frog_labels_mhd" / "frogtissue.mhd", ReadOptions(label=9, axis="x", roi=roi)
    )
    assert volume.pixel_size.tolist() == masks.pixel_size.tolist() == [1.0, 1.5]
    assert volume.slice_spacing == masks.slice_spacing
    for ours, theirs in zip(volume.images(), masks.images(), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    # The volume's first voxel is at 0, 0, 0.
    np.testing.assert_allclose(places(volume, 0, 0, 0), [x, y, 1.5 * z])


def test_the_frog_s_label_is_its_masks_as_stored(data_dir: Path) -> None:
    masks, _ = frog_masks(data_dir, "frog_duodenum/axial_masks", "frog_duodenum/axial.json")
    volume = read_image_stack(data_dir / "frog_labels_mhd" / "frogtissue.mhd", ReadOptions(label=3))
    assert volume.pixel_size.tolist() == masks.pixel_size.tolist()
    assert volume.slice_spacing == masks.slice_spacing
    # The masks are the label's bounding box and a margin.
    boxes: list[NDArray[np.bool_]] = []
    for stack in (volume, masks):
        voxels = np.stack(list(stack.images())) > 0
        inside = [np.flatnonzero(voxels.any(axis=others)) for others in ((1, 2), (0, 2), (0, 1))]
        boxes.append(voxels[np.ix_(*inside)])
    np.testing.assert_array_equal(boxes[0], boxes[1])
