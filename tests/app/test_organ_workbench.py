"""The workbench: what is sent is taken apart safely, and gives the bytes that compress writes."""

import dataclasses
import io
import stat
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from program import refused

from app.compression.edge_picture import LUMEN_COLOR, OUTER_COLOR, edge_picture
from app.compression.image_extent import UnknownImageError, image_extents
from app.compression.image_upload import UploadBounds, UploadRefusedError, unpack_upload
from app.compression.organ_workbench import (
    Abandoned,
    OrganChoice,
    OrganWorkbench,
    PromiseRefusedError,
)
from app.compression.stack_job import StackJob, compress_stack
from assets import BILE_DUCT_PHANTOM
from organ_geometry import Promise, ReadOptions, TraceOptions, read_image_stack
from organ_geometry.contours.traced_organ import TracedSection

BOUNDS = UploadBounds()
FEW = 12
"""Images of the phantom that a test sends."""


def png(width: int = 8, height: int = 6) -> bytes:
    return encoded(np.zeros((height, width), np.uint8), ".png")


def dicom_like() -> bytes:
    return bytes(128) + b"DICM"


def encoded(image: np.ndarray, suffix: str) -> bytes:
    done, data = cv2.imencode(suffix, image)
    assert done
    return data.tobytes()


def zipped(files: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            entry = zipfile.ZipInfo("x")
            entry.filename = name
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content)
    return out.getvalue()


def phantom_files(count: int = FEW) -> dict[str, bytes]:
    paths = sorted(BILE_DUCT_PHANTOM.glob("*.png"))[:count]
    return {path.name: path.read_bytes() for path in paths}


@pytest.fixture
def own_temp(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where temporary files go, with nothing else in it."""
    place = tmp_path / "temp"
    place.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(place))
    return place


@pytest.fixture
def bench(own_temp: Path) -> Iterator[OrganWorkbench]:
    made = OrganWorkbench()
    yield made
    made.close()
    assert list(own_temp.iterdir()) == []


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp", ".tif"])
@pytest.mark.parametrize("shape", [(7, 13), (300, 20, 3)])
def test_a_header_states_the_size_that_is_decoded(suffix: str, shape: tuple[int, ...]) -> None:
    content = encoded(np.zeros(shape, np.uint8), suffix)
    assert image_extents(content) == [(shape[1], shape[0])]


def test_a_tiff_states_the_size_of_every_page() -> None:
    pages = [np.zeros((5, 9), np.uint8), np.zeros((4, 3), np.uint16)]
    done, data = cv2.imencodemulti(".tif", pages)
    assert done
    assert image_extents(data.tobytes()) == [(9, 5), (3, 4)]


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp", ".tif"])
def test_a_cut_header_is_refused(suffix: str) -> None:
    content = encoded(np.zeros((7, 13), np.uint8), suffix)
    for length in range(20):
        with pytest.raises(UnknownImageError):
            image_extents(content[:length])


def test_a_tiff_whose_pages_go_round_is_refused() -> None:
    content = bytearray(encoded(np.zeros((2, 2), np.uint8), ".tif"))
    first = int.from_bytes(content[4:8], "little")
    after = first + 2 + 12 * int.from_bytes(content[first : first + 2], "little")
    content[after : after + 4] = content[4:8]
    with pytest.raises(UnknownImageError, match="more than 10,000 pages"):
        image_extents(bytes(content))


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"../a.png": png()}, "leads out"),
        ({"x/../../a.png": png()}, "leads out"),
        ({"/etc/a.png": png()}, "leads out"),
        ({"..\\a.png": png()}, "leads out"),
        ({"C:\\a.png": png()}, "leads out"),
        ({"C:a.png": png()}, "leads out"),
        ({"a.png": png(), "../notes.txt": b""}, "leads out"),
        ({"notes.txt": b"", "b.zip": b""}, "no PNG"),
        ({}, "no PNG"),
        ({"__MACOSX/._a.png": b"", ".hidden.png": b""}, "no PNG"),
        ({"a/1.png": png(), "b/1.png": png()}, "several folders"),
        ({"1.png": b"not an image"}, "'1.png' cannot be read"),
        ({"1.png": b"GIF89a"}, "'1.png' cannot be read"),
        ({f"{'x' * 252}.png": png()}, "a name of 256 bytes and files take 255"),
        ({f"{'é' * 126}.png": png()}, "a name of 256 bytes and files take 255"),
        ({f"{'d' * 300}/1.png": png()}, "a name of 300 bytes and files take 255"),
        ({"1.png": png(), "1.dcm": dicom_like()}, "1 DICOM files and 1 other images"),
        ({"a/1": dicom_like(), "b/2": dicom_like()}, "several folders"),
        ({"a.nrrd": b"NRRD0004", "b.mha": b""}, "2 volumes, 'a.nrrd', 'b.mha': send one"),
        ({"a.mhd": b"ElementDataFile = /etc/passwd"}, "voxels in '/etc/passwd', which is not"),
        ({"a.mhd": b"ElementDataFile : ../b.raw", "b.raw": b""}, "voxels in '../b.raw'"),
        ({"a.mha": b"ElementDataFile = LIST"}, "voxels in 'LIST'"),
        ({"a.nhdr": b"NRRD0004\ndata file: /etc/passwd"}, "voxels in '/etc/passwd'"),
        ({"a.nrrd": b"NRRD0004\ndatafile: LIST"}, "voxels in 'LIST'"),
        ({"1.png": png(5000, 5000)}, r"5,000 x 5,000 pixels and the most is 5.0 million"),
        ({f"{n}.png": png(2000, 2000) for n in range(31)}, "124 million"),
    ],
)
def test_hostile_zips_are_refused_in_one_line(
    files: dict[str, bytes], message: str, tmp_path: Path
) -> None:
    place = tmp_path / "place"
    place.mkdir()
    with pytest.raises(UploadRefusedError, match=message) as refusal:
        unpack_upload("scan.zip", zipped(files), place, BOUNDS)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 250
    assert [path for path in tmp_path.rglob("*") if path != place] == []


@pytest.mark.parametrize(
    "content", [b"NRRD0004\ndata file: /etc/passwd", b"NDims = 3\nElementDataFile = /etc/passwd"]
)
def test_a_header_that_names_a_file_of_this_machine_is_refused(
    content: bytes, tmp_path: Path
) -> None:
    with pytest.raises(UploadRefusedError, match="'/etc/passwd', which is not with it"):
        unpack_upload("a.nrrd", content, tmp_path, BOUNDS)
    assert list(tmp_path.iterdir()) == []


def test_links_are_refused(tmp_path: Path) -> None:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        entry = zipfile.ZipInfo("a.png")
        entry.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(entry, "/etc/passwd")
    with pytest.raises(UploadRefusedError, match="a link"):
        unpack_upload("scan.zip", out.getvalue(), tmp_path, BOUNDS)


@pytest.mark.parametrize("content", [b"", b"PK\3\4", b"hello" * 100, b"II*\0" + b"\0" * 40])
def test_what_is_neither_zip_nor_tiff_is_refused(content: bytes, tmp_path: Path) -> None:
    with pytest.raises(UploadRefusedError):
        unpack_upload("scan.zip", content, tmp_path, BOUNDS)
    assert list(tmp_path.iterdir()) == []


def test_every_cut_and_most_flips_of_a_zip_give_a_refusal_or_the_images(tmp_path: Path) -> None:
    whole = zipped({"1.png": png(), "2.png": png()})
    rng = np.random.default_rng(5)
    cases = [whole[:length] for length in range(0, len(whole), 3)]
    for _ in range(300):
        other = bytearray(whole)
        other[rng.integers(len(whole))] ^= 1 << int(rng.integers(8))
        cases.append(bytes(other))
    for number, content in enumerate(cases):
        place = tmp_path / str(number)
        place.mkdir()
        try:
            found = unpack_upload("scan.zip", content, place, BOUNDS)
        except UploadRefusedError:
            assert list(place.iterdir()) == []
        else:
            assert found == place / "scan"


def test_bounds_hold_at_the_last_byte_and_entry(tmp_path: Path) -> None:
    image = png(100, 100)
    content = zipped({"1.png": image, "2.png": image})
    exact = UploadBounds(
        file_bytes=len(content),
        entries=2,
        unpacked_bytes=2 * len(image),
        image_pixels=10_000,
        all_pixels=20_000,
    )
    found = unpack_upload("scan.zip", content, tmp_path, exact)
    assert sorted(path.name for path in found.iterdir()) == ["1.png", "2.png"]
    for bound in ("file_bytes", "entries", "unpacked_bytes", "image_pixels", "all_pixels"):
        less = dataclasses.replace(exact, **{bound: getattr(exact, bound) - 1})
        words = "most.*--build-pixels" if "pixels" in bound else "most"
        with pytest.raises(UploadRefusedError, match=words):
            unpack_upload("again.zip", content, tmp_path, less)
    assert [path.name for path in tmp_path.iterdir()] == ["scan"]


def test_a_zip_that_lies_about_its_sizes_is_refused(tmp_path: Path) -> None:
    bomb = png() + bytes(2_000_000)
    honest = zipped({"1.png": bomb})
    size = len(bomb).to_bytes(4, "little")
    assert honest.count(size) == 2
    lying = honest.replace(size, len(png()).to_bytes(4, "little"))
    with pytest.raises(UploadRefusedError):
        unpack_upload("scan.zip", lying, tmp_path, UploadBounds(unpacked_bytes=1000))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "called"),
    [
        ("../../etc/passwd", "passwd"),
        ("C:\\Users\\me\\my duct (2).zip", "my_duct_2"),
        ("..", "organ"),
        ("", "organ"),
        ("a\0b.zip", "a_b"),
        ("x" * 300, "x" * 60),
    ],
)
def test_an_upload_is_called_by_a_plain_name(name: str, called: str, tmp_path: Path) -> None:
    found = unpack_upload(name, zipped({"in/1.png": png()}), tmp_path, BOUNDS)
    assert found == tmp_path / called
    assert [path.name for path in found.iterdir()] == ["1.png"]


def test_spacing_beside_or_above_the_images_is_used(tmp_path: Path) -> None:
    spacing = b'{"pixel_spacing_mm": 0.125, "slice_spacing_mm": 0.4}'
    for number, name in enumerate(("scan/images/spacing.json", "scan/spacing.json")):
        place = tmp_path / str(number)
        place.mkdir()
        files = {"scan/images/1.png": png(), "scan/images/2.png": png(), name: spacing}
        stack = read_image_stack(unpack_upload("a.zip", zipped(files), place, BOUNDS))
        assert stack.slice_spacing == 0.4
        assert stack.pixel_size.tolist() == [0.125, 0.125]


@pytest.mark.parametrize("tolerance_px", [None, 0.5])
def test_bytes_are_those_of_compress(
    tolerance_px: float | None, bench: OrganWorkbench, tmp_path: Path
) -> None:
    bench.open_upload("few.zip", zipped(phantom_files()), pixel_mm=0.125, slice_mm=0.4)
    built = bench.build(tolerance_px)
    assert bench.built is built
    folder = tmp_path / "few"
    folder.mkdir()
    for name, content in phantom_files().items():
        (folder / name).write_bytes(content)
    output = tmp_path / "few.organ"
    compress_stack(
        StackJob(
            folder,
            output,
            read=ReadOptions((0.125, 0.125), 0.4),
            promise=Promise(tolerance_px=tolerance_px),
        )
    )
    assert built.organ.encoded == output.read_bytes()


def test_a_tiff_of_pages_gives_the_organ_of_its_images(bench: OrganWorkbench) -> None:
    images = [
        np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED))
        for data in phantom_files().values()
    ]
    done, data = cv2.imencodemulti(".tif", images)
    assert done
    bench.open_upload("same.tif", data.tobytes(), pixel_mm=0.125, slice_mm=0.4)
    of_pages = bench.build(0.5).organ.encoded
    bench.open_upload("same.zip", zipped(phantom_files()), pixel_mm=0.125, slice_mm=0.4)
    assert bench.build(0.5).organ.encoded == of_pages


def scene(count: int = 6) -> np.ndarray:
    """A bright tube about column 20, row 24, and a thin one about 52, 10."""
    image = np.zeros((48, 64), np.uint8)
    cv2.circle(image, (20, 24), 14, 200, -1)
    cv2.circle(image, (52, 10), 6, 200, -1)
    return np.repeat(image[None], count, axis=0)


def volume(values: np.ndarray, suffix: str, place: Path) -> bytes:
    """A medical file of voxels with sides of 0.5, 0.5 and 2 mm."""
    itk = pytest.importorskip("SimpleITK")
    image = itk.GetImageFromArray(values)
    image.SetSpacing((0.5, 0.5, 2.0))
    path = place / f"made{suffix}"
    itk.WriteImage(image, str(path), True)
    return path.read_bytes()


@pytest.mark.parametrize(
    "suffix",
    [
        ".nii.gz",
        *(pytest.param(each, marks=pytest.mark.long) for each in (".nii", ".nrrd", ".mha")),
    ],
)
@pytest.mark.parametrize("in_a_zip", [False, True])
def test_a_volume_gives_the_bytes_of_compress(
    bench: OrganWorkbench, tmp_path: Path, suffix: str, in_a_zip: bool
) -> None:
    content = volume(scene(), suffix, tmp_path)
    name = f"scan{suffix}"
    sent = ("scan.zip", zipped({f"in/{name}": content})) if in_a_zip else (name, content)
    bench.open_upload(*sent)
    built = bench.build()
    assert built.doubts
    (tmp_path / sent[0]).write_bytes(sent[1])
    job = StackJob(tmp_path / sent[0], tmp_path / "duct.organ")
    message = compress_stack(job)
    assert built.organ.encoded == job.output.read_bytes()
    assert message.doubts == built.doubts


def test_a_header_and_its_voxels_are_read_of_a_zip(bench: OrganWorkbench, tmp_path: Path) -> None:
    volume(scene(), ".mhd", tmp_path)
    files = {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    assert len(files) == 2
    opened = bench.open_upload("scan.zip", zipped(files))
    assert len(opened.whole) == 6
    with pytest.raises(UploadRefusedError, match="which is not with it: send both in one zip"):
        bench.open_upload("made.mhd", files["made.mhd"])


def test_zipped_dicom_is_read(bench: OrganWorkbench, data_dir: Path) -> None:
    pytest.importorskip("SimpleITK")
    files = {
        f"exam/{path.stem}": path.read_bytes()
        for path in sorted((data_dir / "dicom_abdomen_ct" / "series").glob("*.dcm"))[:6]
    }
    opened = bench.open_upload("ct.zip", zipped(files | {"exam/DICOMDIR": b"not an image"}))
    assert len(opened.whole) == 6
    assert opened.whole.slice_spacing == 2.0


def test_a_volume_is_refused_before_it_is_read_if_it_is_too_large(
    own_temp: Path, tmp_path: Path
) -> None:
    bench = OrganWorkbench(UploadBounds(voxels=scene().size - 1))
    with pytest.raises(ValueError, match="million voxels and the most is 0 million: build its"):
        bench.open_upload("scan.nrrd", volume(scene(), ".nrrd", tmp_path))
    assert list(own_temp.iterdir()) == []


def test_without_simpleitk_the_line_that_installs_it_is_named(
    bench: OrganWorkbench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = volume(scene(), ".nrrd", tmp_path)
    monkeypatch.setitem(sys.modules, "SimpleITK", None)
    with pytest.raises(ValueError, match=r"pip install 'bluntdissect\[medical\]'"):
        bench.open_upload("scan.nrrd", content)


def test_labels_are_offered_and_a_point_takes_the_one_it_is_on(
    bench: OrganWorkbench, tmp_path: Path
) -> None:
    values = (scene() > 0).astype(np.int16)
    values[:, :, 40:] *= 7
    opened = bench.open_upload("labels.nrrd", volume(values, ".nrrd", tmp_path))
    assert opened.labels == (1, 7)
    assert opened.traced is None
    with pytest.raises(ValueError, match="the images hold labels: choose"):
        bench.build()
    with pytest.raises(ValueError, match="no label at 0, 0 of image 3"):
        bench.choose(OrganChoice(seed=(0, 0, 3)))
    assert bench.choose(OrganChoice(seed=(52, 10, 3))).choice.label == 7
    small = bench.build().organ
    bench.choose(OrganChoice(label=1))
    large = bench.build().organ
    assert (small.mean_radius, large.mean_radius) == pytest.approx((3.1, 7.1), abs=0.15)


def test_an_organ_longer_than_is_allowed_is_not_built() -> None:
    content = zipped({f"{n}.png": encoded(image, ".png") for n, image in enumerate(scene())})
    bench = OrganWorkbench(UploadBounds(organ_mm=4.0))
    try:
        bench.open_upload("scan.zip", content, pixel_mm=0.5, slice_mm=2.0)
        with pytest.raises(ValueError, match=r"mm long and the most is 4 mm \(--organ-mm\)"):
            bench.build()
    finally:
        bench.close()


def test_a_point_and_a_region_are_those_of_compress(bench: OrganWorkbench, tmp_path: Path) -> None:
    content = zipped({f"{n}.png": encoded(image, ".png") for n, image in enumerate(scene())})
    bench.open_upload("scan.zip", content, pixel_mm=0.5, slice_mm=2.0)
    assert bench.build().doubts
    choice = OrganChoice(seed=(52, 10, 3), region=(40, 0, 63, 30, 1, 4))
    opened = bench.choose(choice)
    built = bench.build()
    assert built.sections_found == 4
    assert built.doubts == ()
    (tmp_path / "scan.zip").write_bytes(content)
    job = StackJob(
        tmp_path / "scan.zip",
        tmp_path / "duct.organ",
        read=ReadOptions((0.5, 0.5), 2.0, roi=choice.region),
        trace=TraceOptions(seed=(12.0, 10.0, 2)),
    )
    compress_stack(job)
    assert built.organ.encoded == job.output.read_bytes()
    # The whole image is shown, with the edge where it is in it, and dark beyond the region.
    picture = opened.picture(3)
    drawn = np.argwhere((picture == OUTER_COLOR).all(axis=2)).mean(axis=0)
    assert drawn / 7.5 == pytest.approx((10.5, 52.5), abs=0.3)
    assert picture[180, 150].tolist() == [85, 85, 85]
    assert opened.problem(0) == "it is left out"
    for wrong in (OrganChoice(seed=(20, 24, 3), region=choice.region), OrganChoice((90, 0, 0))):
        with pytest.raises(ValueError, match=r"the point is outside|seed must be a point"):
            bench.choose(wrong)
        assert bench.opened is opened


def test_a_threshold_reads_no_image_again(bench: OrganWorkbench, own_temp: Path) -> None:
    bench.open_upload("few.zip", zipped(phantom_files()), pixel_mm=0.125, slice_mm=0.4)
    first = bench.build()
    for path in own_temp.rglob("*.png"):
        path.unlink()
    assert len(bench.build(1.6).organ.encoded) < len(first.organ.encoded)


def test_a_zip_is_compressed_and_errors_name_it(tmp_path: Path) -> None:
    bad = tmp_path / "long.zip"
    bad.write_bytes(zipped({f"{'x' * 300}.png": png()}))
    line = refused(("compress", bad, "-o", tmp_path / "duct.organ"))
    assert f"{bad}: the zip has a name of 304 bytes and files take 255" in line
    assert "Traceback" not in line


def test_a_threshold_that_cannot_be_kept_names_the_smallest_that_can(
    bench: OrganWorkbench,
) -> None:
    bench.open_upload("few.zip", zipped(phantom_files()), pixel_mm=0.125, slice_mm=0.4)
    bench.build()
    with pytest.raises(PromiseRefusedError, match="the smallest that can is") as refusal:
        bench.build(0.01)
    assert bench.built is None
    smallest = refusal.value.smallest_px
    assert f"about {smallest:.3f} px, {smallest * 0.125:.4f} mm" in str(refusal.value)
    built = bench.build(1.001 * smallest)
    assert max(section.rms_px for section in built.sections) <= 1.001 * smallest
    with pytest.raises(PromiseRefusedError):
        bench.build(0.5 * smallest)


def test_without_sizes_the_refusal_names_fields_and_no_path(
    bench: OrganWorkbench, own_temp: Path
) -> None:
    with pytest.raises(ValueError, match="give the pixel size and the slice distance") as refusal:
        bench.open_upload("few.zip", zipped(phantom_files()))
    assert str(own_temp) not in str(refusal.value)
    assert "--" not in str(refusal.value)
    assert list(own_temp.iterdir()) == []


def test_images_without_an_organ_say_why_each_and_build_nothing(
    bench: OrganWorkbench, own_temp: Path
) -> None:
    opened = bench.open_upload(
        "dark.zip", zipped({f"{n}.png": png(40, 30) for n in range(3)}), pixel_mm=1.0, slice_mm=1.0
    )
    assert all(opened.problem(index) for index in range(3))
    assert opened.picture(1).shape == (360, 480, 3)
    with pytest.raises(ValueError, match="0 of 3 images") as refusal:
        bench.build()
    assert str(own_temp) not in str(refusal.value)


def test_images_of_two_sizes_or_damaged_are_refused_and_the_former_stay(
    bench: OrganWorkbench,
) -> None:
    first = bench.open_upload("few.zip", zipped(phantom_files()), pixel_mm=0.125, slice_mm=0.4)
    files = phantom_files(3)
    name = list(files)[1]
    for other in (png(10, 10), files[name][:-200]):
        with pytest.raises(ValueError, match=name):
            bench.open_upload("b.zip", zipped({**files, name: other}), pixel_mm=1.0, slice_mm=1.0)
        assert bench.opened is first
        assert first.picture(0).shape == (480, 480, 3)


def test_new_images_replace_the_files_of_the_former(bench: OrganWorkbench, own_temp: Path) -> None:
    for name in ("a.zip", "b.zip"):
        bench.open_upload(name, zipped(phantom_files(3)), pixel_mm=0.125, slice_mm=0.4)
        (folder,) = own_temp.iterdir()
        assert [path.name for path in folder.iterdir()] == [name[0]]
    bench.open_folder(BILE_DUCT_PHANTOM)
    assert list(own_temp.iterdir()) == []


def test_a_workbench_that_is_closed_stops_and_leaves_no_file(own_temp: Path) -> None:
    bench = OrganWorkbench()
    with pytest.raises(Abandoned):
        bench.open_upload(
            "few.zip",
            zipped(phantom_files()),
            pixel_mm=0.125,
            slice_mm=0.4,
            progress=lambda done, _total: bench.close() if done == 2 else None,
        )
    assert list(own_temp.iterdir()) == []
    with pytest.raises(ValueError, match="no images"):
        bench.build()


def test_edges_are_drawn_where_they_are() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    middle = np.array([24.0, 20.0])
    section = TracedSection(0, middle + 15.0 * circle, middle + 8.0 * circle, False, 0.5)
    image = np.zeros((40, 48), np.uint16)
    picture = edge_picture(image, section)
    assert picture.shape == (400, 480, 3)
    rows, columns = np.mgrid[:400, :480]
    radius = np.hypot((columns + 0.5) / 10.0 - 24.5, (rows + 0.5) / 10.0 - 20.5)
    for color, expected in ((OUTER_COLOR, 15.0), (LUMEN_COLOR, 8.0)):
        drawn = (picture == color).all(axis=2)
        assert drawn.sum() > 2.0 * np.pi * 10.0 * expected
        assert radius[drawn].mean() == pytest.approx(expected, abs=0.05)
        assert np.abs(radius[drawn] - expected).max() < 0.25
    assert not edge_picture(image, None).any()
