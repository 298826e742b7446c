"""Stacks are read in order, placed in space, and refused with one clear line."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from organ_geometry import ReadOptions
from organ_geometry.images.grey_image import ImageStackError
from organ_geometry.images.image_files import _quiet_decoders
from organ_geometry.images.stack_reader import read_image_stack

WriteStack = Callable[..., Path]

PARALLEL = {"pixel_spacing_mm": [0.5, 0.25], "slice_spacing_mm": 2.0, "units": "mm"}


def grey(level: int, shape: tuple[int, int] = (6, 8)) -> NDArray[np.uint8]:
    return np.full(shape, level, dtype=np.uint8)


def test_files_are_read_in_natural_order(write_stack: WriteStack) -> None:
    names = ["slice_10", "slice_2", "slice_1", "Slice_3"]
    folder = write_stack([grey(10), grey(2), grey(1), grey(3)], PARALLEL, names=names)
    (folder / "notes.txt").write_text("not an image")
    (folder / ".hidden.png").write_text("not an image either")
    stack = read_image_stack(folder)
    assert stack.names == ("slice_1.png", "slice_2.png", "Slice_3.png", "slice_10.png")
    assert [int(image[0, 0]) for image in stack.images()] == [1, 2, 3, 10]
    assert len(stack) == 4
    assert stack.shape == (6, 8)


@pytest.mark.parametrize("suffix", [".png", ".tif", ".bmp", ".jpg"])
def test_formats(write_stack: WriteStack, suffix: str) -> None:
    stack = read_image_stack(write_stack([grey(50), grey(90)], PARALLEL, suffix=suffix))
    # JPEG keeps an even image to a level or so.
    assert [int(image[3, 3]) for image in stack.images()] == pytest.approx([50, 90], abs=1)


def test_sixteen_bit_stays_and_colour_turns_grey(write_stack: WriteStack) -> None:
    deep = np.full((6, 8), 40_000, dtype=np.uint16)
    colour = np.full((6, 8, 3), 120, dtype=np.uint8)
    stack = read_image_stack(write_stack([deep, colour], PARALLEL))
    assert stack.image(0).dtype == np.uint16
    assert stack.image(0)[0, 0] == 40_000
    assert stack.image(1).shape == (6, 8)
    assert stack.image(1)[0, 0] == 120


@pytest.mark.parametrize("alone_in_folder", [False, True])
def test_a_multipage_tiff_is_a_stack(tmp_path: Path, alone_in_folder: bool) -> None:
    file = tmp_path / "pages.tif"
    assert cv2.imwritemulti(str(file), [grey(5), grey(6), grey(7)])
    stack = read_image_stack(
        tmp_path if alone_in_folder else file, ReadOptions(pixel_size=(1.0, 1.0), slice_spacing=1.0)
    )
    assert [int(image[0, 0]) for image in stack.images()] == [5, 6, 7]
    assert stack.names[1] == "pages.tif page 1"


def test_pixel_spacing_in_the_file_is_row_first(write_stack: WriteStack) -> None:
    stack = read_image_stack(write_stack([grey(0)] * 2, PARALLEL))
    assert stack.pixel_size.tolist() == [0.25, 0.5]
    assert stack.slice_spacing == 2.0


def test_without_directions_the_organ_runs_along_x_with_image_up_as_z(
    write_stack: WriteStack,
) -> None:
    stack = read_image_stack(write_stack([grey(0)] * 3, PARALLEL))
    np.testing.assert_array_equal(stack.origins, [[0, 0, 0], [2, 0, 0], [4, 0, 0]])
    for frame in stack.frames:
        np.testing.assert_array_equal(frame.T, [[0, 1, 0], [0, 0, -1], [1, 0, 0]])


def test_arguments_win(write_stack: WriteStack) -> None:
    folder = write_stack([grey(0)] * 2, PARALLEL)
    stack = read_image_stack(folder, ReadOptions(pixel_size=(0.1, 0.2), slice_spacing=3.0))
    assert stack.pixel_size.tolist() == [0.1, 0.2]
    assert stack.slice_spacing == 3.0
    assert stack.origins[1].tolist() == [3.0, 0.0, 0.0]


def test_spacing_is_found_in_the_parent_and_nearest_first(write_stack: WriteStack) -> None:
    folder = write_stack([grey(0)] * 2)
    beside = folder.parent / "spacing.json"
    beside.write_text(json.dumps(PARALLEL))
    assert read_image_stack(folder).slice_spacing == 2.0
    (folder / "spacing.json").write_text(json.dumps(PARALLEL | {"slice_spacing_mm": 1.0}))
    assert read_image_stack(folder).slice_spacing == 1.0


def test_other_units_are_kept_by_name(write_stack: WriteStack) -> None:
    spacing = {
        "units": "relative",
        "pixel_spacing_mm": None,
        "pixel_spacing": [1.5, 1.0],
        "slice_spacing": 1.0,
        "anything_else": [1],
    }
    stack = read_image_stack(write_stack([grey(0)] * 2, spacing))
    assert stack.units == "relative"
    assert stack.pixel_size.tolist() == [1.0, 1.5]


def test_a_parallel_frame_places_the_sections(write_stack: WriteStack) -> None:
    directions = {
        "first_slice_origin_mm": [1.0, 2.0, 3.0],
        "col_dir": [0.0, 0.6, 0.8],
        "row_dir": [0.0, -0.8, 0.6],
        "slice_dir": [1.0, 0.0, 0.0],
    }
    stack = read_image_stack(write_stack([grey(0)] * 3, PARALLEL | directions))
    np.testing.assert_allclose(stack.origins[2], [5.0, 2.0, 3.0])
    np.testing.assert_allclose(
        stack.frames[1].T, [[0, 0.6, 0.8], [0, -0.8, 0.6], [1, 0, 0]], atol=1e-15
    )


def test_a_stack_may_lean(write_stack: WriteStack) -> None:
    leaning = {"slice_dir": [0.8, 0.6, 0.0]}
    stack = read_image_stack(write_stack([grey(0)] * 2, PARALLEL | leaning))
    np.testing.assert_allclose(stack.origins[1], [1.6, 1.2, 0.0])
    # The planes stay where col_dir and row_dir put them.
    np.testing.assert_array_equal(stack.frames[0][:, 2], [1.0, 0.0, 0.0])


def frames(count: int) -> list[dict[str, Any]]:
    return [
        {
            "origin_mm": [float(index), 0.0, 0.0],
            "col_dir": [0.0, 1.0, 0.0],
            "row_dir": [0.0, 0.0, 1.0],
            "normal": [1.0, 0.0, 0.0],
        }
        for index in range(count)
    ]


def test_one_frame_per_slice(write_stack: WriteStack) -> None:
    folder = write_stack([grey(0)] * 3, PARALLEL | {"frames": frames(3)})
    stack = read_image_stack(folder)
    np.testing.assert_array_equal(stack.origins[:, 0], [0, 1, 2])
    np.testing.assert_array_equal(stack.frames[2], [[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    # An explicit spacing wins over frames.
    straight = read_image_stack(folder, ReadOptions(slice_spacing=5.0))
    np.testing.assert_array_equal(straight.origins[:, 0], [0, 5, 10])


def test_arrays_are_locked(write_stack: WriteStack) -> None:
    stack = read_image_stack(write_stack([grey(0)] * 2, PARALLEL))
    with pytest.raises(ValueError, match="read-only"):
        stack.origins[0, 0] = 1.0


def fails(folder: Path, message: str, **arguments: Any) -> None:
    """Reading the stack and its images gives one line that matches."""
    with pytest.raises(ImageStackError, match=message) as error:
        list(read_image_stack(folder, ReadOptions(**arguments)).images())
    assert "\n" not in str(error.value)


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    fails(tmp_path / "nowhere", r"there is no folder of images at .*nowhere")


def test_a_folder_without_images_is_named(tmp_path: Path) -> None:
    (tmp_path / "read.me").write_text("nothing")
    fails(tmp_path, r"holds no images: PNG, JPEG, TIFF, BMP or DICOM files are read$")
    (tmp_path / "masks").mkdir()
    cv2.imwrite(str(tmp_path / "masks" / "slice_0.png"), np.zeros((8, 8), np.uint8))
    fails(tmp_path, r"holds no images: .*; masks within it does$")


def test_one_file_must_be_a_multipage_tiff(write_stack: WriteStack) -> None:
    folder = write_stack([grey(0)], PARALLEL)
    fails(folder / "slice_0.png", r"slice_0.png is one file and not a multipage TIFF")


@pytest.mark.parametrize("suffix", [".png", ".tif", ".jpg", ".bmp"])
@pytest.mark.parametrize("index", [0, 1])
def test_an_unreadable_image_is_named_and_nothing_else_is_said(
    write_stack: WriteStack, capfd: pytest.CaptureFixture[str], index: int, suffix: str
) -> None:
    textured = np.arange(48, dtype=np.uint8).reshape(6, 8)
    folder = write_stack([textured] * 3, PARALLEL, suffix=suffix)
    broken = folder / f"slice_{index}{suffix}"
    broken.write_bytes(broken.read_bytes()[: broken.stat().st_size // 2])
    fails(folder, rf"slice_{index}{suffix} cannot be read as an image")
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_an_image_with_changed_bytes_is_unreadable_in_one_line(
    write_stack: WriteStack, capfd: pytest.CaptureFixture[str], suffix: str
) -> None:
    noise = np.random.default_rng(3).integers(0, 256, (200, 200)).astype(np.uint8)
    folder = write_stack([noise] * 2, PARALLEL, suffix=suffix)
    broken = folder / f"slice_1{suffix}"
    content = bytearray(broken.read_bytes())
    content[len(content) // 2] ^= 0x55
    broken.write_bytes(content)
    fails(folder, rf"slice_1{suffix} cannot be read as an image")
    assert capfd.readouterr().err == ""


def test_what_others_say_while_an_image_is_read_is_not_lost(
    write_stack: WriteStack, capfd: pytest.CaptureFixture[str]
) -> None:
    stack = read_image_stack(write_stack([grey(0)] * 2, PARALLEL))
    with _quiet_decoders():
        os.write(2, b"libpng warning: a decoder's own\nanother thread's\n")
    stack.image(1)
    assert capfd.readouterr().err == "another thread's\n"


def test_an_empty_file_is_unreadable(write_stack: WriteStack) -> None:
    folder = write_stack([grey(0)] * 2, PARALLEL)
    (folder / "slice_1.png").write_bytes(b"")
    fails(folder, r"slice_1.png cannot be read as an image")


def test_a_broken_multipage_tiff_is_named(tmp_path: Path) -> None:
    (tmp_path / "pages.tif").write_bytes(b"II*\0 not a TIFF after all")
    fails(tmp_path / "pages.tif", r"pages.tif cannot be read as an image")


def test_a_multipage_tiff_among_others_is_refused(write_stack: WriteStack) -> None:
    folder = write_stack([grey(0)], PARALLEL)
    assert cv2.imwritemulti(str(folder / "slice_1.tif"), [grey(1), grey(2)])
    fails(folder, r"slice_1.tif has several pages .* give a multipage TIFF alone")


def test_other_pixel_types_are_refused(write_stack: WriteStack) -> None:
    folder = write_stack([np.zeros((6, 8), dtype=np.float32)] * 2, PARALLEL, suffix=".tif")
    fails(folder, r"slice_0.tif has float32 pixels .* 8 or 16 bit grey is read")


def test_sizes_must_agree(write_stack: WriteStack) -> None:
    folder = write_stack([grey(0), grey(0), grey(0, (5, 9))], PARALLEL)
    fails(folder, r"slice_0.png has 8 x 6 and slice_2.png has 9 x 5 pixels")


@pytest.mark.parametrize("given", [{}, {"pixel_size": (1.0, 1.0)}, {"slice_spacing": 1.0}])
def test_missing_spacing(write_stack: WriteStack, given: dict[str, Any]) -> None:
    fails(
        write_stack([grey(0)] * 2),
        r"is missing: give --pixel-size and --slice-spacing or a spacing.json",
        **given,
    )


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_spacing_must_be_above_zero(write_stack: WriteStack, value: float) -> None:
    folder = write_stack([grey(0)] * 2, PARALLEL)
    fails(folder, r"the pixel size of .* must be above 0 mm, not", pixel_size=(1.0, value))
    fails(folder, r"the slice spacing of .* must be above 0 mm, not", slice_spacing=value)
    if np.isfinite(value):
        spacing = folder / "spacing.json"
        spacing.write_text(json.dumps(PARALLEL | {"slice_spacing_mm": value}))
        fails(folder, rf"the slice spacing of {spacing} must be above 0 mm, not")


@pytest.mark.parametrize("value", [1e-7, 1e-300, 1000.1, 1e300])
def test_a_slip_of_the_unit_is_refused(write_stack: WriteStack, value: float) -> None:
    folder = write_stack([grey(0)] * 2, PARALLEL)
    right = r"must be from 1e-06 to 1000 mm, not .* mm, which looks like a slip of the unit"
    fails(folder, rf"the pixel size of .* {right}", pixel_size=(value, 1.0))
    fails(folder, rf"the slice spacing of .* {right}", slice_spacing=value)
    spacing = folder / "spacing.json"
    spacing.write_text(json.dumps(PARALLEL | {"pixel_spacing_mm": value}))
    fails(folder, rf"the pixel size of {spacing} {right}")
    spacing.write_text(json.dumps(PARALLEL | {"slice_spacing_mm": value, "frames": frames(2)}))
    fails(folder, rf"the slice spacing of {spacing} {right}")


@pytest.mark.parametrize("value", [1e-6, 1000.0])
def test_the_limits_of_spacing_are_allowed(write_stack: WriteStack, value: float) -> None:
    folder = write_stack([grey(0)] * 2)
    stack = read_image_stack(folder, ReadOptions(pixel_size=(value, value), slice_spacing=value))
    assert stack.slice_spacing == value


@pytest.mark.parametrize("pair", [(1e-3, 1.0), (1000.0, 1.0), (1e-6, 1e-3), (0.0003, 0.3)])
def test_a_pixel_a_thousand_times_as_long_as_wide_is_allowed(
    write_stack: WriteStack, pair: tuple[float, float]
) -> None:
    stack = read_image_stack(
        write_stack([grey(0)] * 2), ReadOptions(pixel_size=pair, slice_spacing=1.0)
    )
    assert tuple(stack.pixel_size) == pair


@pytest.mark.parametrize("pair", [(1e-6, 1000.0), (1000.0, 1e-6), (0.01, 10.1)])
def test_a_longer_pixel_is_refused_wherever_it_comes_from(
    write_stack: WriteStack, pair: tuple[float, float]
) -> None:
    right = r"must have sides of which one is up to 1000 times the other, not .* x .* mm"
    folder = write_stack([grey(0)] * 2, PARALLEL)
    fails(folder, rf"the pixel size of {folder} {right}", pixel_size=pair)
    fails(folder, rf"the pixel size of {folder} {right}", pixel_size=pair, slice_spacing=1.0)
    spacing = folder / "spacing.json"
    spacing.write_text(json.dumps(PARALLEL | {"pixel_spacing_mm": pair}))
    fails(folder, rf"the pixel size of {spacing} {right}")
    # Across another axis, pixels are as wide as slices are apart.
    spacing.write_text(
        json.dumps(PARALLEL | {"pixel_spacing_mm": pair[0], "slice_spacing_mm": pair[1]})
    )
    fails(folder, rf"the pixel size of {folder} {right}", axis="i")


@pytest.mark.parametrize("key", ["pixel_spacing_mm", "pixel_spacing"])
def test_one_number_makes_square_pixels(write_stack: WriteStack, key: str) -> None:
    folder = write_stack([grey(0)] * 2, {key: 0.25, "slice_spacing_mm": 1})
    assert read_image_stack(folder).pixel_size.tolist() == [0.25, 0.25]


def test_arguments_are_mm(write_stack: WriteStack) -> None:
    folder = write_stack([grey(0)] * 2, PARALLEL | {"units": "relative"})
    assert read_image_stack(folder, ReadOptions(pixel_size=(0.1, 0.1))).units == "relative"
    assert (
        read_image_stack(folder, ReadOptions(pixel_size=(0.1, 0.1), slice_spacing=3.0)).units
        == "mm"
    )


@pytest.mark.parametrize("units", ["cm", "MM", "", "m", "not relative", 1, ["mm"]])
def test_unknown_units_are_refused(write_stack: WriteStack, units: Any) -> None:
    folder = write_stack([grey(0)] * 2, PARALLEL | {"units": units})
    fails(folder, r'units in .*spacing.json must be "mm", or start with "relative" .*, not ')


@pytest.mark.parametrize("units", ["mm", "relative", "relative (voxels)"])
def test_known_units_are_kept(write_stack: WriteStack, units: str) -> None:
    folder = write_stack([grey(0)] * 2, PARALLEL | {"units": units})
    assert read_image_stack(folder).units == units


def test_one_image_with_its_frame_is_read(write_stack: WriteStack) -> None:
    spacing = {"pixel_spacing_mm": 1.0, "frames": frames(1)}
    assert len(read_image_stack(write_stack([grey(0)], spacing))) == 1


EXAMPLE = r'right would be, for example, {"pixel_spacing_mm": 0.1, "slice_spacing_mm": 0.5}'


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"{ not json", rf"is not written as JSON at line 1, column 3; {EXAMPLE}"),
        (b'{"units": "mm",\n}', rf"is not written as JSON at line [12], column .*; {EXAMPLE}"),
        (b"", rf"is not written as JSON at line 1, column 1; {EXAMPLE}"),
        (b"\xff\xfe", rf"is not written as JSON.*; {EXAMPLE}"),
        (b"\xc3\x28", rf"is not written as JSON.*; {EXAMPLE}"),
        (b"[" * 100_000, rf"is not written as JSON; {EXAMPLE}"),
        (b"[1, 2]", r"must hold keys and values in braces, not \[1, 2\]"),
        (
            b'{"pixel_spacing_mm": [0.5]}',
            r"pixel_spacing_mm in .* must be one number or two .*, as 0.1 or .*, not \[0.5\]",
        ),
        (b'{"pixel_spacing_mm": true}', r"pixel_spacing_mm in .* must be .*, not true"),
        (b'{"pixel_spacing_mm": [1, "2"]}', r"pixel_spacing_mm in .* must be .*, not \[1, \"2\"\]"),
        (
            b'{"slice_spacing_mm": "1 mm"}',
            r'slice_spacing_mm in .* must be one number, as 0.5, not "1 mm"',
        ),
        (b'{"col_dir": [0, 1]}', r"col_dir in .* must be three numbers .*, not \[0, 1\]"),
        (b'{"row_dir": [0, 1e300, 0]}', r"row_dir in .* must be three numbers up to 1e\+07"),
        (b'{"slice_dir": [0, NaN, 0]}', r"slice_dir in .* must be three numbers .*, not \[0, NaN"),
        (b'{"frames": 3}', r"frames in .* must be a list with origin_mm, .* of each image, not 3"),
        (b'{"frames": [{}, 3]}', r"entry 2 of frames in .* must hold keys and values .*, not 3"),
        (b'{"frames": [{}]}', r"origin_mm is missing in entry 1 of frames in .*: three numbers"),
        (b'{"units": "' + b"x" * 99 + b'"}', r'units in .*, not "x{36}\.\.\.$'),
    ],
)
def test_a_malformed_spacing_file_is_named(
    write_stack: WriteStack, content: bytes, message: str
) -> None:
    folder = write_stack([grey(0)] * 2)
    (folder / "spacing.json").write_bytes(content)
    fails(folder, message)
    fails(folder, rf"{folder / 'spacing.json'}")


def test_a_spacing_that_is_not_a_number_is_refused(write_stack: WriteStack) -> None:
    folder = write_stack([grey(0)] * 2)
    spacing = folder / "spacing.json"
    for number in ("NaN", "Infinity", "1e400", "1" + "0" * 400):
        spacing.write_text(f'{{"pixel_spacing_mm": 1, "slice_spacing_mm": {number}}}')
        fails(folder, rf"the slice spacing of {spacing} must be above 0 mm, not")


def test_frames_must_match_the_images(write_stack: WriteStack) -> None:
    folder = write_stack([grey(0)] * 3, PARALLEL | {"frames": frames(2)})
    fails(folder, r"has 2 frames and .* has 3 images: one frame for each image is needed")


@pytest.mark.parametrize(
    ("directions", "message"),
    [
        ({"col_dir": [0.0, 2.0, 0.0]}, r"col_dir in .* must have length 1"),
        ({"row_dir": [0.0, 0.6, -0.8]}, r"col_dir and row_dir in .* must be perpendicular"),
        ({"slice_dir": [0.0, 1.0, 0.0]}, r"lies in the plane of"),
        ({"slice_dir": [0.0, 0.0, 0.0]}, r"slice_dir in .* must have length 1"),
    ],
)
def test_directions_must_span_space(
    write_stack: WriteStack, directions: dict[str, Any], message: str
) -> None:
    fails(write_stack([grey(0)] * 2, PARALLEL | directions), message)


def test_a_png_whose_chunk_claims_more_than_the_file_has_is_refused_before_it_is_decoded(
    write_stack: WriteStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_stack([grey(0)] * 2, PARALLEL)
    content = (folder / "slice_1.png").read_bytes()
    at = content.index(b"IDAT") - 4
    (folder / "slice_0.png").write_bytes(content + b"what viewers leave alone")
    (folder / "slice_1.png").write_bytes(content[:at] + b"\xff\xff\xff\xa7" + content[at + 4 :])
    decoded: list[int] = []
    decode = cv2.imdecode

    def decoding(data: NDArray[np.uint8], flags: int) -> Any:
        decoded.append(data.size)
        return decode(data, flags)

    monkeypatch.setattr(cv2, "imdecode", decoding)
    stack = read_image_stack(folder)
    stack.image(0)
    taken = len(decoded)
    with pytest.raises(ImageStackError, match=r"slice_1\.png cannot be read as an image"):
        stack.image(1)
    assert len(decoded) == taken  # it would take 4 GB first
