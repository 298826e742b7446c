"""The command line as its users run it: a process, its output, its files and its exit status."""

import importlib.metadata
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numba
import numpy as np
import pytest
import trimesh
from own_organ import phantom_start
from program import refused, run

from app.command_line import main
from app.command_line.bed_options import BED_NAMES
from app.command_line.load import PRESET_NAMES
from app.simulation import bed_presets, presets
from app.validation.thesis_tables import INCH, LBF, TABLE_6_3
from assets import BILE_DUCT, BILE_DUCT_PHANTOM
from organ_geometry.organ_file import read_organ

KEYS = {
    "theory",
    "preset",
    "section",
    "span_mm",
    "area_mm2",
    "second_moment_mm4",
    "fibre_distance_mm",
    "strength",
    "threshold_MPa",
    "force_N",
    "deflection_mm",
    "normal_stress_MPa",
    "bending_stress_MPa",
    "station_mm",
    "side",
    "distance_to_break",
    "breaks_at_N",
}
ROUND = ("--span", 50.8, "--diameter", 8.89, "--modulus", 0.310264, "--poisson", 0.3)


@pytest.fixture(scope="module")
def compressed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """The shipped phantom, compressed, and what is said of it."""
    path = tmp_path_factory.mktemp("organ") / "duct.organ"
    done = run("compress", BILE_DUCT_PHANTOM, "-o", path, "--json")
    assert done.returncode == 0, done.stderr
    return path, json.loads(done.stdout)


@pytest.fixture(scope="module")
def duct(compressed: tuple[Path, dict[str, Any]]) -> Path:
    """The shipped phantom, compressed."""
    return compressed[0]


def solved(*arguments: object) -> dict[str, float]:
    done = run("solve", *arguments, "--json")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return json.loads(done.stdout)


def test_solve_the_thesis_s_duct_at_its_break() -> None:
    found = solved("--preset", "thesis-bile-duct", "--force", 3.56)
    assert set(found) == KEYS | {"q"}
    assert found["theory"] == "cubic"
    assert found["force_N"] == 3.56
    assert found["breaks_at_N"] == pytest.approx(0.8 * LBF, rel=1e-6)
    assert found["distance_to_break"] == pytest.approx(0.0, abs=5e-4)
    assert found["distance_to_break"] < 0.0
    # P = 0.4 lbf is 3.5586 N: 12.8013 mm in the table, and 0.0014 N more here.
    assert found["deflection_mm"] == pytest.approx(0.503987995 * INCH, rel=3e-4)


def test_solve_any_round_beam_by_force_and_by_deflection() -> None:
    force, calculated, _ = TABLE_6_3.rows[10]
    found = solved(*ROUND, "--force", 2.0 * force * LBF)
    assert found["deflection_mm"] == pytest.approx(float(calculated) * INCH, rel=2e-6)
    assert found["distance_to_break"] is None
    assert found["breaks_at_N"] is None
    back = solved(*ROUND, "--deflection", found["deflection_mm"], "--threshold", 0.2)
    assert back["force_N"] == pytest.approx(found["force_N"], rel=1e-12)
    assert 0.0 < back["distance_to_break"] < 1.0
    assert back["breaks_at_N"] > back["force_N"]


def test_solve_options_reach_the_theory() -> None:
    string = solved(*ROUND, "--force", 3.0, "--theory", "string")
    assert string["theory"] == "string"
    assert string["bending_stress_MPa"] == 0.0
    stiffer = solved(*ROUND, "--force", 3.0, "--q", 1.0)
    near_clamp = solved(*ROUND, "--force", 3.0, "--grasp", 10.0)
    middle = solved(*ROUND, "--force", 3.0)
    assert stiffer["deflection_mm"] < middle["deflection_mm"]
    assert near_clamp["deflection_mm"] < middle["deflection_mm"]
    assert near_clamp["bending_stress_MPa"] > middle["bending_stress_MPa"]


def test_solve_a_tissue_preset_on_the_shipped_organ_and_on_a_given_one(duct: Path) -> None:
    shipped = solved("--preset", "porcine-gallbladder", "--force", 1.0)
    given = solved("--preset", "porcine-gallbladder", "--organ", duct, "--force", 1.0)
    assert given == shipped


def test_solve_in_words() -> None:
    done = run("solve", "--preset", "thesis-bile-duct", "--force", 3.6)
    assert done.returncode == 0
    for words in ("deflection", "mm", "kPa", "it breaks", "side of the pull"):
        assert words in done.stdout


def test_compress_says_what_it_found_and_kept(compressed: tuple[Path, dict[str, Any]]) -> None:
    path, found = compressed
    assert found["sections_in"] == found["sections_found"] == len(found["sections"]) == 128
    kept = [section["name"] for section in found["sections"] if section["kept"]]
    assert len(kept) == found["sections_kept"] < 64
    assert found["bytes_out"] == path.stat().st_size
    assert found["bytes_in"] == sum(file.stat().st_size for file in BILE_DUCT_PHANTOM.glob("*.png"))
    assert found["hollow"] is True
    assert found["length_mm"] == pytest.approx(50.8, abs=0.05)
    assert found["rms_error_px"] == pytest.approx(found["rms_error_mm"] / 0.125)
    assert found["rms_error_mm"] < found["tolerance_mm"]
    for fit in ("normal", "algebraic"):
        fit_mm = found[f"fit_{fit}_rms_mm"]
        assert found[f"fit_{fit}_rms_px"] == pytest.approx(fit_mm / 0.125)
        squares = [
            section["edge_points"] * section[f"fit_{fit}_rms_mm"] ** 2
            for section in found["sections"]
        ]
        points = sum(section["edge_points"] for section in found["sections"])
        assert fit_mm == pytest.approx((sum(squares) / points) ** 0.5)
    assert found["fit_normal_rms_mm"] < found["fit_algebraic_rms_mm"]
    assert found["warnings"] == []
    assert path.read_bytes() == BILE_DUCT.read_bytes()
    organ = read_organ(path)
    assert len(organ.keys) == found["sections_kept"]


def test_compress_report_lists_every_section(tmp_path: Path) -> None:
    images = phantom_start(tmp_path / "images", 16)
    done = run("compress", images, "-o", tmp_path / "duct.organ", "--sections")
    assert done.returncode == 0
    assert sum(line.startswith("section_") for line in done.stdout.splitlines()) == 16
    assert "RMS px" in done.stdout
    assert "mm" in done.stdout
    assert not any(line.startswith("note") for line in done.stdout.splitlines())


def test_a_tighter_tolerance_keeps_more_sections(tmp_path: Path) -> None:
    images, kept = phantom_start(tmp_path / "images", 32), list[int]()
    for tolerance in (0.04, 0.3):
        done = run(
            "compress", images, "-o", tmp_path / "duct.organ", "--tolerance-mm", tolerance, "--json"
        )
        kept.append(json.loads(done.stdout)["sections_kept"])
    assert kept[0] > kept[1]


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".glb", ".zip"])
def test_export_is_closed_and_has_the_volume_of_the_organ(
    duct: Path, tmp_path: Path, suffix: str
) -> None:
    path = tmp_path / f"duct{suffix}"
    done = run("export", duct, "-o", path, "--still")
    assert done.returncode == 0, done.stderr
    mesh = trimesh.load_mesh(path)
    mesh.merge_vertices(merge_norm=True, merge_tex=True)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    organ = read_organ(duct)
    stations = np.linspace(0.0, organ.length, 1001)
    volume = np.trapezoid(organ.section_properties(stations).area, stations)
    scale = 1e-9 if suffix == ".glb" else 1.0
    assert mesh.volume == pytest.approx(scale * volume, rel=0.01)  # half-millimetre facets


def test_export_bends_by_what_solve_says(duct: Path, tmp_path: Path) -> None:
    tops: list[float] = []
    for force in (0.0, 2.0):
        path = tmp_path / f"duct_{force}.stl"
        done = run("export", duct, "--force", force, "-o", path)
        assert done.returncode == 0, done.stderr
        assert ("theory cubic, q 0.5; pulled with 2 N" in done.stdout) == (force == 2.0)
        mesh = trimesh.load_mesh(path)
        assert mesh.is_watertight
        middle = np.abs(mesh.vertices[:, 0] - 25.4) < 0.5
        tops.append(float(mesh.vertices[middle][:, 2].max()))
    deflection = solved("--preset", "thesis-bile-duct", "--force", 2.0)["deflection_mm"]
    assert tops[1] - tops[0] == pytest.approx(deflection, abs=0.05)


def test_export_counts_the_faces_of_each_surface_of_a_series(duct: Path, tmp_path: Path) -> None:
    lines = []
    for name in ("pull.pvd", "pull.vtp"):
        done = run("export", duct, "--frames", 2, "--edge-length", 2, "-o", tmp_path / name)
        assert done.returncode == 0, done.stderr
        lines.append(done.stdout.splitlines()[0])
    series, single = lines
    faces = re.findall(r", ([\d,]+ faces)", single)[0]
    assert f", {faces} each, " in series


def test_export_torn_is_two_closed_pieces(duct: Path, tmp_path: Path) -> None:
    path = tmp_path / "torn.ply"
    done = run("export", duct, "--torn", "-o", path, "--json")
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert facts["force_N"] == pytest.approx(0.8 * LBF, rel=1e-6)
    mesh = trimesh.load_mesh(path, process=False)
    pieces = mesh.split(only_watertight=True)
    assert len(pieces) == 2
    assert len(mesh.vertices) == facts["vertices"]


@pytest.mark.long  # a real organ
def test_the_real_duct_goes_through_the_same_commands(data_dir: Path, tmp_path: Path) -> None:
    organ = tmp_path / "duct.organ"
    done = run("compress", data_dir / "bile_duct_perpendicular" / "masks", "-o", organ, "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["sections_in"] == found["sections_found"] == 128
    assert found["sections_kept"] < 64
    assert found["rms_error_px"] < 1.0
    for options in (("--force", 2.0), ("--torn",), ("--preset", "porcine-bile-duct", "--torn")):
        mesh_path = tmp_path / "duct.stl"
        done = run("export", organ, *options, "-o", mesh_path)
        assert done.returncode == 0, done.stderr
        mesh = trimesh.load_mesh(mesh_path)
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
    given = solved("--preset", "porcine-bile-duct", "--organ", organ, "--force", 0.01)
    assert given["deflection_mm"] > 0.0


def test_nothing_of_an_extra_is_needed_to_begin() -> None:
    """Neither by the command line, nor the trainer, nor, but for Gymnasium, an environment."""
    blocked = ("scipy", "matplotlib", "pyarrow", "SALib", "SimpleITK", "manifold3d", "distributed")
    blocked += ("onnxruntime", "onnx", "highdicom", "cma", "pandas")
    lines = (
        "import sys",
        f"sys.modules.update(dict.fromkeys({blocked!r}))",
        "import app.command_line.replay, app.rl.environment, app.trainer",
    )
    found = subprocess.run(
        [sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, check=False
    )
    assert not found.returncode, found.stderr


def test_version_is_the_installed_one() -> None:
    done = run("--version")
    assert done.returncode == 0
    assert done.stdout == f"bluntdissect {importlib.metadata.version('bluntdissect')}\n"


def test_help_names_every_preset() -> None:
    assert PRESET_NAMES.replace(" or ", ", ").split(", ") == list(presets())


def test_help_of_every_command_has_an_example() -> None:
    for name in ("trainer", "compress", "export", "solve", "replay"):
        done = run(name, "--help")
        assert done.returncode == 0
        assert f"bluntdissect {name}" in done.stdout
        assert "Example" in done.stdout
    assert "not a medical device" in " ".join(run("--help").stdout.split())


# Wrong input: one line that says what, where and what would be right, exit 2, no file.


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--preset", "nothing", "--force", 1), "unknown preset 'nothing'; there are: thesis-bile"),
        (("--preset", "thesis-bile-duct", "--force", "nan"), "force must be a finite number of N"),
        (("--preset", "thesis-bile-duct", "--force", "inf"), "force must be a finite number of N"),
        (("--preset", "thesis-bile-duct", "--force", "much"), "--force"),
        (("--preset", "thesis-bile-duct", "--force", -1), "--force must be 0 N or more"),
        (("--preset", "thesis-bile-duct"), "either --force (N) or --deflection (mm)"),
        (("--preset", "thesis-bile-duct", "--force", 1, "--deflection", 1), "either --force"),
        (("--preset", "thesis-bile-duct", "--force", 1, "--span", 9), "leave out --span"),
        (("--preset", "thesis-bile-duct", "--force", 1, "--poisson", 0.4), "leave out --poisson"),
        (("--preset", "thesis-bile-duct", "--force", 1, "--grasp", 60), "below 50.8 mm"),
        (("--preset", "thesis-bile-duct", "--force", 1, "--theory", "x"), "cubic, string"),
        (("--preset", "thesis-bile-duct", "--force", 1, "--q", -1), "q must be from 0 to 2"),
        (("--preset", "thesis-bile-duct", "--force", 1, "--threshold", 0), "threshold must be"),
        (("--force", 1), "--span, --diameter and --modulus"),
        ((*ROUND[:-4], "--modulus", -1, "--force", 1), "modulus must be above 0 MPa"),
        (("--span", 0, *ROUND[2:], "--force", 1), "span must be above 0 mm"),
        (("--nonsense",), "--nonsense"),
        (("--preset", "thesis-bile-duct", "--force", 1e300), "--force can be at most 1e+09 N"),
        (("--span", 1e300, *ROUND[2:], "--force", 1), "--span can be at most 1e+06 mm"),
    ],
)
def test_solve_refuses(arguments: tuple[object, ...], words: str) -> None:
    assert words in refused(("solve", *arguments))


def stack(folder: Path, *images: np.ndarray, spacing: bool = True) -> Path:
    folder.mkdir()
    for index, image in enumerate(images):
        cv2.imwrite(str(folder / f"slice_{index}.png"), image)
    if spacing:
        (folder / "spacing.json").write_text(
            '{"pixel_spacing_mm": [0.1, 0.1], "slice_spacing_mm": 1}'
        )
    return folder


def disc(size: int = 64) -> np.ndarray:
    return cv2.circle(np.zeros((size, size), np.uint8), (size // 2, size // 2), size // 4, 255, -1)


EMPTY = np.zeros((64, 64), np.uint8)


def test_compress_leaves_out_sections_without_an_edge_and_names_them(tmp_path: Path) -> None:
    folder = stack(tmp_path / "stack", disc(), EMPTY, disc(), disc())
    done = run("compress", folder, "-o", tmp_path / "duct.organ")
    assert done.returncode == 0, done.stderr
    assert "slice_1.png" in done.stdout
    assert "4 in, 3 found" in done.stdout


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("--preset", "thesis-bile-duct", "--force", 1e9), "times the span, where no theory"),
        (("--span", 0.0508, "--diameter", 0.00889, "--modulus", 0.3, "--force", 1e-9),
         "a span of 0.0508 mm is very short"),
        (("--span", 50.8, "--diameter", 8.89, "--modulus", 310264, "--force", 1),
         "a modulus of 310264 MPa is above that of steel"),
        (("--span", 50.8, "--diameter", 80, "--modulus", 0.3, "--force", 1),
         "a beam of 80 mm by 50.8 mm is hardly one"),
    ],
)  # fmt: skip
def test_solve_doubts_what_is_most_likely_a_wrong_unit(
    given: tuple[object, ...], words: str
) -> None:
    found = json.loads(run("solve", *given, "--json").stdout)
    assert [note for note in found["notes"] if words in note], found["notes"]
    usual = json.loads(run("solve", "--preset", "thesis-bile-duct", "--force", 3, "--json").stdout)
    assert "notes" not in usual


def test_compress_notes_what_may_make_it_another_organ(tmp_path: Path) -> None:
    shown = disc()
    cv2.circle(shown, (7, 7), 5, 255, -1)
    folder = stack(tmp_path / "stack", shown, disc(), shown, spacing=False)
    (folder / "spacing.json").write_text(
        '{"pixel_spacing": 0.1, "slice_spacing": 1, "units": "relative"}'
    )
    done = run("compress", folder, "-o", tmp_path / "duct.organ")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    written = next(number for number, line in enumerate(lines) if line.startswith("written"))
    doubtful, components, units = lines[written + 1 : written + 4]
    assert doubtful.startswith("doubtful   probably another organ than the one wanted")
    assert components.startswith("doubtful   2 of 3 sections show another part of at least 5% of")
    assert units == "note       the images' lengths are relative, not mm: one unit is taken as 1 mm"
    message = json.loads(run("compress", folder, "-o", tmp_path / "duct.organ", "--json").stdout)
    assert [f"doubtful   {doubt}" for doubt in message["doubts"]] == [components]
    assert f"note       {message['warnings'][-1]}" == units


@pytest.mark.parametrize("key", ["--pixel-size", "--slice-spacing"])
@pytest.mark.parametrize("value", [1e300, 1e-300])
def test_compress_names_a_slip_of_the_unit(tmp_path: Path, key: str, value: float) -> None:
    folder = stack(tmp_path / "stack", disc(), disc())
    line = refused(("compress", folder, "-o", tmp_path / "duct.organ", key, value))
    assert "from 1e-06 to 1000 mm" in line


@pytest.mark.parametrize("pixel_size", ["1e-6", "1000", "1e-6,1e-3", "1000,1"])
@pytest.mark.parametrize("slice_spacing", ["1e-6", "1000"])
def test_compress_says_nothing_else_at_the_limits_of_spacing(
    tmp_path: Path, pixel_size: str, slice_spacing: str
) -> None:
    folder = stack(tmp_path / "stack", disc(), disc())
    options = ("--pixel-size", pixel_size, "--slice-spacing", slice_spacing)
    if pixel_size.startswith("1000"):  # a disc of 10 m
        line = refused(("compress", folder, "-o", tmp_path / "duct.organ", *options))
        assert "10,000 mm" in line or "1,000 mm" in line
        return
    done = run("compress", folder, "-o", tmp_path / "duct.organ", *options)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("pixel_size", ["1e-6,1000", "1000,1e-6", "1.01,1e-3"])
def test_compress_says_which_pixels_are_too_long(tmp_path: Path, pixel_size: str) -> None:
    folder = stack(tmp_path / "stack", disc(), disc())
    options = ("--pixel-size", pixel_size, "--slice-spacing", "1")
    line = refused(("compress", folder, "-o", tmp_path / "duct.organ", *options))
    assert "one is up to 1000 times the other" in line


def test_compress_does_not_take_the_background_for_the_organ(tmp_path: Path) -> None:
    output = tmp_path / "duct.organ"
    line = refused(("compress", BILE_DUCT_PHANTOM, "-o", output, "--polarity", "dark"))
    assert "the organ touches the image's border" in line
    assert not output.exists()


@pytest.mark.parametrize(
    ("images", "spacing", "options", "words"),
    [
        ([], True, (), "no images"),
        ([disc(), disc(48)], True, (), "slice_1.png"),
        ([EMPTY, EMPTY, disc()], True, (), "slice_0.png"),
        ([disc(), disc()], False, (), "--pixel-size"),
        ([disc(), disc()], False, ("--pixel-size", 0.1), "--slice-spacing"),
        ([disc(), disc()], False, ("--pixel-size", 0, "--slice-spacing", 1), "above 0"),
        ([disc(), disc()], False, ("--pixel-size", 0.1, "--slice-spacing", "nan"), "slice"),
        ([disc(), disc()], False, ("--pixel-size", "a,b", "--slice-spacing", 1), "--pixel-size"),
        ([disc(), disc()], True, ("--polarity", "blue"), "auto, bright or dark"),
        ([disc(), disc()], True, ("--tolerance-mm", -1), "tolerance"),
    ],
)
def test_compress_refuses(
    tmp_path: Path,
    images: list[np.ndarray],
    spacing: bool,
    options: tuple[object, ...],
    words: str,
) -> None:
    folder = stack(tmp_path / "stack", *images, spacing=spacing)
    output = tmp_path / "duct.organ"
    assert words in refused(("compress", folder, "-o", output, *options))
    assert [entry.name for entry in tmp_path.iterdir()] == ["stack"]


def test_compress_refuses_a_folder_that_is_not_there(tmp_path: Path) -> None:
    assert "nowhere" in refused(("compress", tmp_path / "nowhere", "-o", tmp_path / "duct.organ"))
    assert not list(tmp_path.iterdir())


def test_compress_refuses_a_target_before_it_works(tmp_path: Path) -> None:
    line = refused(("compress", BILE_DUCT_PHANTOM, "-o", tmp_path / "nowhere" / "duct.organ"))
    assert "there is no folder" in line


def test_failed_compress_keeps_the_file_that_was_there(tmp_path: Path) -> None:
    output = tmp_path / "duct.organ"
    output.write_bytes(b"precious")
    refused(("compress", stack(tmp_path / "stack", EMPTY, EMPTY), "-o", output))
    assert output.read_bytes() == b"precious"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--force", 4.0), "past the break of thesis-bile-duct at 3.559 N"),
        (("--force", "inf"), "force must be a finite number of N"),
        (("--force", 1.0, "--torn"), "breaks at 3.559 N"),
        (("--preset", "nothing"), "unknown preset 'nothing'"),
        (("--grasp", 0.0), "grasp must lie between the clamps"),
        (("--edge-length", 0.0), "edge_length must be above 0 mm"),
        (("--edge-length", 50.0), "at most the organ's mean radius"),
        (("--force", "nan", "--torn"), "force must be a finite number of N"),
        (("--edge-length", 1e-6), "600,000"),
    ],
)
def test_export_refuses(
    duct: Path, tmp_path: Path, options: tuple[object, ...], words: str
) -> None:
    assert words in refused(("export", duct, "-o", tmp_path / "duct.stl", *options))
    assert not list(tmp_path.iterdir())


def test_export_refuses_foreign_and_truncated_organs(duct: Path, tmp_path: Path) -> None:
    whole = duct.read_bytes()
    output = tmp_path / "out" / "duct.stl"
    output.parent.mkdir()
    for name, content in (
        ("foreign", b"PK\x03\x04 not an organ"),
        ("empty", b""),
        ("truncated", whole[: len(whole) // 2]),
        ("damaged", whole[:-3] + bytes([whole[-3] ^ 255]) + whole[-2:]),
    ):
        organ = tmp_path / f"{name}.organ"
        organ.write_bytes(content)
        assert f"{name}.organ" in refused(("export", organ, "-o", output))
    assert "missing.organ" in refused(("export", tmp_path / "missing.organ", "-o", output))
    assert not list(output.parent.iterdir())


def test_export_refuses_unknown_kinds_and_missing_folders(duct: Path, tmp_path: Path) -> None:
    assert ".stl, .ply, .obj, .glb" in refused(("export", duct, "-o", tmp_path / "duct.fbx"))
    assert "no folder" in refused(("export", duct, "-o", tmp_path / "no" / "duct.stl"))


def test_organ_too_short_for_the_thesis_s_span_says_so(tmp_path: Path) -> None:
    folder = tmp_path / "short"
    folder.mkdir()
    for index in range(40):
        shutil.copy(BILE_DUCT_PHANTOM / f"section_{index:03d}.png", folder)
    organ = tmp_path / "short.organ"
    sizes = ("--pixel-size", 0.125, "--slice-spacing", 0.4)
    assert run("compress", folder, "-o", organ, *sizes).returncode == 0
    output = tmp_path / "duct.stl"
    line = refused(("export", organ, "-o", output, "--preset", "thesis-bile-duct"))
    assert "50.8 mm" in line
    done = run("export", organ, "-o", output, "--json")
    assert json.loads(done.stdout)["preset"] == "assumed-duct"


# What other tools get; what is in the files is tested beside the exporters.


def test_export_of_a_glb_is_rigged_and_says_so(duct: Path, tmp_path: Path) -> None:
    path = tmp_path / "duct.glb"
    done = run(
        "export", duct, "-o", path, "--force", 2.0, "--frames", 9, "--edge-length", 1.0, "--json"
    )
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert facts["animations"] == ["pull", "tear"]
    assert facts["surfaces"] == ["organ", "first_piece", "second_piece"]
    assert facts["bytes"] == path.stat().st_size
    assert facts["force_N"] == 2.0
    solution = solved("--preset", "thesis-bile-duct", "--force", 2.0)
    assert facts["deflection_mm"] == pytest.approx(solution["deflection_mm"])


def test_export_writes_a_page_and_a_file_at_once(duct: Path, tmp_path: Path) -> None:
    page, curve = tmp_path / "player.html", tmp_path / "curve.csv"
    done = run("export", duct, "--html", page, "-o", curve, "--force", 2.0)
    assert done.returncode == 0, done.stderr
    assert f"{page}: a page that plays, {page.stat().st_size:,} bytes" in done.stdout
    assert "the force-deflection curve" in done.stdout
    assert curve.read_text().startswith("force_N,deflection_mm,")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ((), "--output FILE or --html PAGE"),
        (("-o", "duct.glb", "--frames", 100_000), "to 2,000"),
        (("-o", "duct.glb", "--force", 4.0), "past the break of thesis-bile-duct at 3.559 N"),
        (("-o", "duct.ply", "--color", "red"), "--color must be stress"),
        (("-o", "duct.csv", "--table", "stress"), "--table must be curve or axis"),
        (("--html", "player.html", "--torn"), "plays a motion"),
        (("--html", "player.html", "-o", "duct.fbx"), ".vtp, .pvd, .csv"),
    ],
)
def test_export_refuses_what_other_tools_have_no_use_for(
    duct: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    options: tuple[object, ...],
    words: str,
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))
    monkeypatch.chdir(tmp_path)
    assert words in refused(("export", duct, *options))
    assert not list(tmp_path.iterdir())


def test_info_lists_every_bed_with_its_source_and_confidence() -> None:
    done = run("info", "--beds")
    assert done.returncode == 0, done.stderr
    listed = json.loads(run("info", "--beds", "--json").stdout)
    assert [bed["name"] for bed in listed] == list(bed_presets())
    for bed in bed_presets().values():
        assert bed.name in BED_NAMES
        words = " ".join(done.stdout.split())
        assert f"{bed.name} {bed.title}" in words
        assert " ".join(bed.source.split()) in words
        assert f"confidence {bed.confidence}. " in words
    for wrong in (["info"], ["info", "duct.organ", "--beds"]):
        assert "either an .organ file or --beds" in refused(wrong)


TUBE = ("--span", 30, "--diameter", 4, "--wall", 1, "--modulus", 5)


def test_solve_a_pull_along_an_avulsion_and_an_inflation() -> None:
    along = solved(*TUBE, "--load", "along", "--force", 3.0, "--threshold", 1.0)
    area = 3.0 * np.pi
    assert along["stress_MPa"] == pytest.approx(3.0 / area, rel=1e-9)
    assert along["elongation_mm"] == pytest.approx(30.0 * 3.0 / area / 5.0, rel=1e-9)
    assert along["breaks_at_N"] == pytest.approx(area, rel=1e-9)
    torn = solved(*TUBE, "--load", "avulsion", "--threshold", 1.0, "--law", "neo-hooke")
    assert torn["breaks_at_N"] == pytest.approx(area, rel=1e-9)
    blown = solved(*TUBE, "--load", "inflation", "--pressure", 10)
    assert blown["diameter_mm"] > 4.0
    assert blown["hoop_stress_MPa"] == pytest.approx(0.01 * 1.5, rel=0.02)
    preset = solved("--preset", "thesis-bile-duct", "--load", "along", "--deflection", 5)
    assert preset["law"] == "linear"
    assert preset["force_N"] == pytest.approx(0.310264 * 62.0716664 * 5.0 / 50.8, rel=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--load", "twist", "--force", 1), "--load must be one of across, along"),
        (("--load", "inflation"), "an inflation needs --pressure, kPa"),
        (("--load", "avulsion"), "an avulsion needs a strength"),
        (("--load", "along", "--force", 1, "--angle", 5), "--angle is not of --load along"),
        (("--load", "along", "--force", 1, "--grasp", 5), "--grasp are not of --load along"),
        (("--force", 1, "--pressure", 5), "--pressure of --load inflation"),
        (("--load", "inflation", "--pressure", 1e6), "MPa at most, under which it grows"),
    ],
)
def test_what_is_not_of_a_load_is_named(options: tuple[object, ...], message: str) -> None:
    assert message in refused(["solve", *TUBE, *options])


@pytest.mark.parametrize("terminal", [True, False])
def test_a_first_run_in_a_terminal_tells_that_it_compiles(
    terminal: bool, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """In a pipe it does not, where a program would take the line for an error."""
    numba.njit(lambda x: x)(1)  # whatever was to be told is told
    caplog.clear()
    monkeypatch.setattr(sys, "argv", ["bluntdissect", "--version"])
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    with pytest.raises(SystemExit):
        main()
    for _ in range(2):
        numba.njit(lambda x: x + 1)(1)
    assert caplog.text.count("Compiling") == terminal


def test_the_program_starts_without_what_compiles() -> None:
    code = "import sys, app.command_line.program; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
