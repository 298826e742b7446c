"""What `bluntdissect compress` reads, and every example of docs/images-in.md."""

import contextlib
import io
import json
import locale
import re
import shlex
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from program import refused, run

from organ_geometry.organ_file import read_organ

itk = pytest.importorskip("SimpleITK")

PAGE = (Path(__file__).parents[2] / "docs" / "images-in.md").read_text()
SPACING = (0.5, 0.5, 1.0)
ORIGIN = (-40.0, 12.0, 300.0)


def tube(dtype: type = np.uint8, lying: bool = False) -> NDArray[Any]:
    """(K, J, I) voxels of a round tube, 200 bright on 20, standing along k or lying along i."""
    k, j, i = np.indices((40, 60, 64)).astype(np.float64)
    across = k * 2.0 - 40.0 if lying else i - 31.0 - 0.1 * k
    distance = np.hypot(across, j - 30.0)
    return (np.clip((9.5 - distance) / 2.0 + 0.5, 0.0, 1.0) * 180.0 + 20.0).astype(dtype)


def write(voxels: NDArray[Any], path: Path) -> Path:
    image = itk.GetImageFromArray(voxels)
    image.SetSpacing(SPACING)
    image.SetOrigin(ORIGIN)
    itk.WriteImage(image, str(path), True)
    return path


def write_series(voxels: NDArray[Any], folder: Path) -> None:
    folder.mkdir()
    before = locale.setlocale(locale.LC_ALL)
    for index, values in enumerate(voxels):
        image = itk.GetImageFromArray(values)
        image.SetSpacing(SPACING[:2])
        image.SetMetaData("0008|0060", "CT")
        image.SetMetaData("0020|000e", "1.2.3")
        image.SetMetaData("0020|0032", f"-40\\12\\{300.0 + index}")
        image.SetMetaData("0020|0037", "1\\0\\0\\0\\1\\0")
        writer = itk.ImageFileWriter()
        writer.KeepOriginalImageUIDOn()
        writer.SetFileName(str(folder / f"{99 - index}.dcm"))
        writer.Execute(image)
    # GDCM leaves the process in the C locale after it has written.
    locale.setlocale(locale.LC_ALL, before)


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that the page's examples name."""
    folder = tmp_path_factory.mktemp("images")
    upright = tube()
    (folder / "scans").mkdir()
    for index, image in enumerate(upright):
        assert cv2.imwrite(str(folder / "scans" / f"slice_{index}.png"), image)
    assert cv2.imwritemulti(str(folder / "pages.tif"), list(upright))
    write_series(tube(np.int16), folder / "series")
    write(tube(np.int16), folder / "aorta.nii.gz")
    labels = np.zeros(upright.shape, dtype=np.uint8)
    labels[tube(lying=True) > 110] = 9
    write(labels, folder / "labels.mhd")
    write((tube(lying=True) > 110).astype(np.uint8), folder / "gut.nrrd")
    return folder


def examples(kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)^```", PAGE, flags=re.MULTILINE | re.DOTALL)


def test_the_page_s_commands_work(images: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))
    monkeypatch.chdir(images)
    lines = [line for block in examples("sh") for line in block.splitlines()]
    commands = [shlex.split(line) for line in lines]
    ours = [words[1:] for words in commands if words[0] == "bluntdissect"]
    assert len(ours) == 8
    assert [words for words in commands if words[0] != "bluntdissect"] == [
        ["pip", "install", "bluntdissect[medical]"]
    ]
    for words in ours:
        done = run(*words)
        assert done.returncode == 0, (words, done.stderr)
        assert read_organ(Path(words[words.index("-o") + 1])).length > 15.0
    first, stages = examples("python")
    names: dict[str, object] = {}
    with contextlib.redirect_stdout(io.StringIO()) as message:
        exec(first, names)
    assert int(message.getvalue().split()[0]) > 30
    with contextlib.redirect_stdout(io.StringIO()) as message:
        exec(stages, names)
    tight, loose = map(int, message.getvalue().split())
    assert tight >= loose >= 2


def test_an_organ_stands_where_its_volume_stands(images: Path, tmp_path: Path) -> None:
    for source in ("series", "aorta.nii.gz"):
        done = run("compress", images / source, "-o", tmp_path / "a.organ", "--json")
        assert done.returncode == 0, done.stderr
        axis = read_organ(tmp_path / "a.organ").axis
        k = axis[:, 2] - 300.0
        np.testing.assert_allclose(axis[:, 0], -40.0 + 0.5 * (31.0 + 0.1 * k), atol=0.05)
        np.testing.assert_allclose(axis[:, 1], 12.0 + 0.5 * 30.0, atol=0.05)
        assert json.loads(done.stdout)["bytes_in"] == sum(
            file.stat().st_size for file in (images / source).glob("*")
        ) or source.endswith("gz")


def test_an_organ_that_lies_flat_is_cut_again_and_stands_there(
    images: Path, tmp_path: Path
) -> None:
    done = run(
        "compress", images / "labels.mhd", "-o", tmp_path / "a.organ", "--label", 9, "--json"
    )
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert facts["warnings"][0].startswith("the organ lies flatter than 45 degrees to the images")
    axis = read_organ(tmp_path / "a.organ").axis
    middle = axis[5:-5]
    np.testing.assert_allclose(middle[:, 1], 12.0 + 0.5 * 30.0, atol=0.1)
    np.testing.assert_allclose(middle[:, 2], 300.0 + 20.0, atol=0.1)
    assert np.ptp(axis[:, 0]) == pytest.approx(32.0, abs=1.5)


@pytest.mark.parametrize(
    ("source", "options", "words"),
    [
        ("labels.mhd", ("--label", 4), "label 4 is not in"),
        ("labels.mhd", ("--label", "four"), "--label"),
        ("aorta.nii.gz", ("--axis", "w"), "x, y, z, i, j, k, 0, 1 or 2, not w"),
        ("aorta.nii.gz", ("--window", "40"), "--window must be the lowest and the highest value"),
        ("aorta.nii.gz", ("--window", "a,b"), "--window must be the lowest and the highest value"),
        ("aorta.nii.gz", ("--window", "9,1"), "the lowest and the highest value kept"),
        ("aorta.nii.gz", ("--roi", "1,2,3"), "--roi must be four or six whole numbers"),
        ("aorta.nii.gz", ("--roi", "1,2,3,4.5"), "--roi must be four or six whole numbers"),
        ("aorta.nii.gz", ("--roi", "0,0,64,59"), "columns must be from 0 to 63"),
        ("scans", ("--recut", "often"), "--recut must be auto, always or never, not often"),
        ("series", ("--label", 1), "has grey values and no labels"),
    ],
)
def test_wrong_input_options_are_one_line(
    images: Path, tmp_path: Path, source: str, options: tuple[object, ...], words: str
) -> None:
    assert words in refused(("compress", images / source, "-o", tmp_path / "a.organ", *options))
    assert not list(tmp_path.iterdir())
