"""Stacks into organ files: many at once, their reports, their figures, and what is in a file."""

import contextlib
import csv
import json
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import psutil
import pytest
from own_organ import phantom_start
from program import LONGEST, command, refused, run

from app.compression import stack_batch
from app.compression.report import report_lines
from app.compression.stack_job import StackJob, compress_stack, jobs_into
from app.workers import by_processes
from assets import BILE_DUCT_PHANTOM
from organ_geometry import Promise, TraceOptions, read_organ

SPACING = '{"pixel_spacing_mm": 0.1, "slice_spacing_mm": 0.5}'


def tube(folder: Path, *radii: int) -> Path:
    """Write a stack of discs."""
    folder.mkdir(parents=True)
    (folder / "spacing.json").write_text(SPACING)
    for number, radius in enumerate(radii):
        image = cv2.circle(np.zeros((64, 64), np.uint8), (32, 32), radius, 255, -1)
        cv2.imwrite(str(folder / f"slice_{number}.png"), image)
    return folder


@pytest.fixture
def stacks(tmp_path: Path) -> list[Path]:
    """Two stacks that are called alike, and a third."""
    return [
        tube(tmp_path / "left" / "masks", 16, 16, 16, 17),
        tube(tmp_path / "right" / "masks", 12, 13, 14, 15),
        tube(tmp_path / "duct", 20, 20, 20),
    ]


def test_many_stacks_go_into_one_folder_under_names_that_differ(
    tmp_path: Path, stacks: list[Path]
) -> None:
    done = run("compress", *stacks, "-o", tmp_path / "organs", "--json")
    assert done.returncode == 0, done.stderr
    message = json.loads(done.stdout)
    assert [one["stack"] for one in message] == [str(stack) for stack in stacks]
    names = [Path(one["file"]).name for one in message]
    written = {path.name for path in (tmp_path / "organs").iterdir()}
    assert written == {*names, "summary.jsonl", "summary.csv"}
    # What tells the two alike apart comes before all names.
    assert [name.split("-")[-2:] for name in names[:2]] == [
        ["left", "masks.organ"],
        ["right", "masks.organ"],
    ]
    for one in message:
        organ = read_organ(Path(one["file"]))
        assert len(organ.encoded) == one["bytes_out"]
        assert len(organ.keys) == one["sections_kept"]
    radii = [read_organ(Path(one["file"])).mean_radius for one in message]
    assert radii == pytest.approx([1.63, 1.35, 2.0], abs=0.1)


def test_a_stack_that_fails_does_not_stop_the_others(tmp_path: Path, stacks: list[Path]) -> None:
    empty = tube(tmp_path / "empty", 0, 0)
    for image in empty.glob("*.png"):
        cv2.imwrite(str(image), np.zeros((64, 64), np.uint8))
    missing = tmp_path / "missing"
    done = run("compress", stacks[0], empty, stacks[2], missing, "-o", tmp_path / "organs")
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        f"bluntdissect: 2 of 4 stacks could not be compressed: {empty}, {missing}"
    ]
    lines = done.stdout.splitlines()
    assert lines[0].split()[:3] == ["organ", "file", "in"]
    assert [line.split()[0].rsplit("/", 1)[1] for line in lines[1:3]] == [
        "masks.organ",
        "duct.organ",
    ]
    failed, absent = (line for line in lines if line.startswith("failed"))
    assert str(empty) in failed
    assert "two or more are needed" in failed
    assert f"there is no folder of images at {missing}" in absent
    written = {path.name for path in (tmp_path / "organs").iterdir()}
    assert written == {"masks.organ", "duct.organ", "summary.jsonl", "summary.csv"}
    row = list(csv.DictReader((tmp_path / "organs" / "summary.csv").read_text().splitlines()))[1]
    assert row["stack"] == str(empty)
    assert "two or more are needed" in row["error"]


def test_a_stack_given_twice_is_refused(tmp_path: Path, stacks: list[Path]) -> None:
    line = refused(("compress", stacks[0], stacks[2], stacks[0], "-o", tmp_path / "organs"))
    assert f"{stacks[0]} is given twice" in line
    assert not (tmp_path / "organs").exists()


def test_several_stacks_do_not_overwrite_a_file(tmp_path: Path, stacks: list[Path]) -> None:
    there = tmp_path / "duct.organ"
    there.write_text("kept")
    line = refused(("compress", stacks[0], stacks[2], "-o", there))
    assert "several stacks need a folder" in line
    assert there.read_text() == "kept"


def test_names_are_no_longer_than_they_must_be(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("a.nii.gz", "b.tif", "c")]
    (tmp_path / "c").mkdir()
    like = StackJob(Path("any"), Path("any"), promise=Promise(tolerance_px=1.0))
    jobs = jobs_into(Path("out"), paths, figures=Path("figures"), like=like)
    assert all(job.promise == like.promise for job in jobs)
    assert [job.output for job in jobs] == [Path(f"out/{name}.organ") for name in "abc"]
    assert [job.figure for job in jobs] == [Path(f"figures/{name}.png") for name in "abc"]
    with pytest.raises(ValueError, match="would give the same file"):
        jobs_into(Path("out"), [tmp_path / "b.tif", tmp_path / "b.png"], figures=None, like=like)


def test_an_overall_promise_leaves_single_sections_more(tmp_path: Path, stacks: list[Path]) -> None:
    output = tmp_path / "duct.organ"
    done = run("compress", stacks[1], "-o", output, "--overall-px", 0.4, "--json")
    assert done.returncode == 0, done.stderr
    overall = json.loads(done.stdout)
    # Each section may be off by four times what all together may.
    assert overall["tolerance_px"] == pytest.approx(1.6, rel=0.02)
    assert overall["overall_px"] == pytest.approx(0.4)
    assert overall["rms_error_px"] <= 0.4
    each, both = (
        compress_stack(StackJob(stacks[1], output, promise=promise))
        for promise in (Promise(tolerance_px=0.4), Promise(tolerance_px=0.5, overall_px=0.4))
    )
    assert overall["bytes_out"] <= each.bytes_out
    assert both.tolerance_px == pytest.approx(0.5, rel=0.02)
    assert both.rms_error_px <= 0.4
    assert each.overall_px is None
    (line,) = (one for one in report_lines(both, every_section=False) if one.startswith("promise"))
    assert line.endswith("px RMS at every section; 0.0400 mm, 0.400 px over all")
    line = refused(("compress", stacks[1], "-o", output, "--overall-px", 1, "--overall-mm", 1))
    assert "give either --overall-mm or --overall-px" in line


def test_the_promise_can_be_given_in_pixels(tmp_path: Path, stacks: list[Path]) -> None:
    message = []
    for option in (("--tolerance-px", 0.5), ("--tolerance-mm", 0.05)):
        done = run("compress", stacks[1], "-o", tmp_path / "duct.organ", *option, "--json")
        assert done.returncode == 0, done.stderr
        message.append(json.loads(done.stdout))
    assert message[0]["tolerance_mm"] == message[1]["tolerance_mm"]
    assert message[0]["tolerance_mm"] == pytest.approx(0.05, rel=0.02)
    assert message[0]["tolerance_px"] == pytest.approx(message[0]["tolerance_mm"] / 0.1)
    assert all(section["rms_mm"] <= 0.05 for section in message[0]["sections"])
    assert message[0]["max_error_px"] == pytest.approx(message[0]["max_error_mm"] / 0.1)
    both = ("--tolerance-px", 1, "--tolerance-mm", 1)
    line = refused(("compress", stacks[1], "-o", tmp_path / "x.organ", *both))
    assert "either --tolerance-mm or --tolerance-px" in line


def test_a_promise_that_cannot_be_kept_is_answered_with_the_smallest(tmp_path: Path) -> None:
    output, images = tmp_path / "duct.organ", phantom_start(tmp_path / "images", 16)
    line = refused(("compress", images, "-o", output, "--tolerance-mm", 0.001))
    smallest = float(line.split(" mm")[-2].split()[-1])
    assert 0.001 < smallest < 0.1
    assert not output.exists()
    done = run("compress", images, "-o", output, "--tolerance-mm", smallest, "--json")
    assert done.returncode == 0, done.stderr
    assert max(one["rms_mm"] for one in json.loads(done.stdout)["sections"]) <= smallest


def test_the_thesis_s_rule_can_be_asked_for(tmp_path: Path) -> None:
    sizes, images = {}, phantom_start(tmp_path / "images", 16)
    for rule in ("fewest", "thesis"):
        done = run("compress", images, "-o", tmp_path / "duct.organ", "--select", rule, "--json")
        assert done.returncode == 0, done.stderr
        sizes[rule] = json.loads(done.stdout)["bytes_out"]
    assert sizes["fewest"] < sizes["thesis"]
    line = refused(("compress", BILE_DUCT_PHANTOM, "-o", tmp_path / "x.organ", "--select", "best"))
    assert "--select must be fewest or thesis, not best" in line


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_the_figure_shows_all_sections_and_those_kept(tmp_path: Path, suffix: str) -> None:
    figure, images = tmp_path / f"organ{suffix}", phantom_start(tmp_path / "images", 16)
    done = run("compress", images, "-o", tmp_path / "duct.organ", "--figure", figure, "--json")
    assert done.returncode == 0, done.stderr
    kept = json.loads(done.stdout)["sections_kept"]
    if suffix == ".png":
        picture = cv2.imread(str(figure))
        assert picture is not None
        ink = (picture < 250).any(axis=(0, 2))
        thirds = np.array_split(ink, 3)
        assert all(third.any() for third in thirds)
    else:
        text = figure.read_text()
        assert "All 16 sections" in text
        assert f"{kept} sections kept" in text
        assert "driving points" in text


def test_a_figure_that_cannot_be_drawn_is_refused_before_the_work(tmp_path: Path) -> None:
    output = tmp_path / "duct.organ"
    line = refused(("compress", BILE_DUCT_PHANTOM, "-o", output, "--figure", tmp_path / "a.gif"))
    assert "a figure must end in .png, .svg, .pdf" in line
    assert not output.exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("-o", "SCANS/x.png"), "an organ file must end in .organ"),
        (("-o", "o.txt"), "an organ file must end in .organ"),
        (("-o", "o.organ", "--figure", "SCANS/s.png"), "taken for an image of"),
    ],
)
def test_what_is_read_is_never_written_over(
    tmp_path: Path, stacks: list[Path], options: tuple[str, ...], words: str
) -> None:
    before = {file.name: file.read_bytes() for file in stacks[0].iterdir()}
    places = [words_.replace("SCANS", str(stacks[0])) for words_ in options]
    places = [str(tmp_path / words_) if words_.startswith("o.") else words_ for words_ in places]
    assert words in refused(("compress", stacks[0], *places))
    assert {file.name: file.read_bytes() for file in stacks[0].iterdir()} == before
    assert not list(tmp_path.glob("o.*"))


def _interrupted(process: subprocess.Popen[str]) -> str:
    """Press Ctrl-C, and again where a compiled kernel has lost it; return what stderr says."""
    for _ in range(9):
        process.send_signal(signal.SIGINT)
        try:
            return process.communicate(timeout=8)[1]
        except subprocess.TimeoutExpired:
            continue
    raise AssertionError("it goes on")


def _worked(pid: int) -> float:
    """The processor's time, s, that a process has taken, with those that it has started."""
    found = psutil.Process(pid)
    seconds = 0.0
    for each in (found, *found.children(recursive=True)):
        with contextlib.suppress(psutil.NoSuchProcess):
            seconds += sum(each.cpu_times()[:2])
    return seconds


@pytest.mark.parametrize("several", [False, True])
def test_an_interrupt_ends_the_work_in_one_line(
    tmp_path: Path, stacks: list[Path], several: bool
) -> None:
    images = np.zeros((400, 256, 256), np.uint8)
    radii = 60.0 + np.random.default_rng(1).normal(size=len(images)).cumsum()
    for image, radius in zip(images, radii, strict=True):  # of which full effort tries for long
        cv2.circle(image, (128, 128), round(radius), 255, -1)
    long = tmp_path / "long.tif"
    cv2.imwritemulti(str(long), list(images))
    output = tmp_path / ("organs" if several else "long.organ")
    work = [long, *(stacks[:1] if several else [])]
    sizes = ("--pixel-size", 0.1, "--slice-spacing", 0.5, "--effort", "full")
    begins = "from app.command_line import main; print('it begins', flush=True); main()"
    with subprocess.Popen(
        command("compress", *work, "-o", output, *sizes, entry=begins),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "it begins\n"
            until = time.monotonic() + LONGEST
            while _worked(process.pid) < 2.5:
                assert process.poll() is None
                assert time.monotonic() < until, "it does not work"
                time.sleep(0.05)
            message = _interrupted(process)
        finally:
            process.kill()
    assert process.returncode == 130
    assert message.splitlines() == ["bluntdissect: stopped; no file is left half-written"]
    assert not list(tmp_path.rglob("long*.organ*"))


def two_things(folder: Path) -> Path:
    """Write a stack of discs with a smaller one beside them, about (56, 8)."""
    tube(folder, 14, 14, 14)
    for image in folder.glob("*.png"):
        shown = cv2.imread(str(image), cv2.IMREAD_GRAYSCALE)
        assert shown is not None
        cv2.imwrite(str(image), cv2.circle(shown, (56, 8), 5, 255, -1))
    return folder


def test_doubts_come_before_all_notes_and_in_the_json(tmp_path: Path) -> None:
    folder = two_things(tmp_path / "scene")
    message = compress_stack(StackJob(folder, tmp_path / "duct.organ"))
    doubt = "3 of 3 sections show another part of at least 5% of the organ's area beside it"
    (found,) = message.doubts
    assert found.startswith(doubt)
    assert found in message.warnings
    assert message.as_json()["doubts"] == [found]
    lines = list(report_lines(message, every_section=False))
    first = next(index for index, line in enumerate(lines) if line.startswith("doubtful"))
    assert lines[first].startswith("doubtful   probably another organ than the one wanted")
    assert lines[first + 1].startswith(f"doubtful   {doubt}")
    assert sum(doubt in line for line in lines) == 1
    pointed = compress_stack(
        StackJob(folder, tmp_path / "duct.organ", trace=TraceOptions(seed=(32.0, 32.0)))
    )
    assert pointed.doubts == ()
    assert not any("doubtful" in line for line in report_lines(pointed, every_section=False))


def test_a_seed_is_counted_in_the_whole_image(tmp_path: Path) -> None:
    folder = two_things(tmp_path / "scene")
    radii = []
    for options in (
        ("--seed", "56,8"),
        ("--seed", "56,8", "--roi", "40,0,63,20"),
        ("--seed", "56,8,2", "--roi", "40,0,63,20,1,2"),
    ):
        done = run("compress", folder, "-o", tmp_path / "duct.organ", *options, "--json")
        assert done.returncode == 0, done.stderr
        radii.append(json.loads(done.stdout)["mean_radius_mm"])
    assert radii == pytest.approx([0.5, 0.5, 0.5], abs=0.06)
    for wrong in ("56", "56,8,1.5", "56,8,1,2", "56,x"):
        line = refused(("compress", folder, "-o", tmp_path / "duct.organ", "--seed", wrong))
        assert line.endswith(f"or column,row,image as 120,95,30, not {wrong}")
    line = refused(("compress", folder, "-o", tmp_path / "duct.organ", "--seed", "56,8,3"))
    assert "the seed's image must be one of 3, from 0 to 2, not 3" in line


def test_info_says_what_is_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "duct.organ"
    images = phantom_start(tmp_path / "images", 16)
    assert run("compress", images, "-o", path).returncode == 0
    organ = read_organ(path)
    done = run("info", path, "--json")
    assert done.returncode == 0, done.stderr
    message = json.loads(done.stdout)
    assert message["bytes"] == path.stat().st_size
    assert message["length_mm"] == organ.length
    assert message["mean_radius_mm"] == organ.mean_radius
    assert message["tolerance_mm"] == organ.tolerance_mm
    assert message["sections_kept"] == len(organ.keys) == len(message["key_stations_mm"])
    assert message["key_stations_mm"] == pytest.approx(organ.key_stations, abs=1e-4)
    assert message["last_mm"] == pytest.approx(organ.axis[-1], abs=1e-4)
    words = run("info", path).stdout
    for words_ in ("version 3", "checksum right", "hollow", "mm RMS", "sections"):
        assert words_ in words


def test_info_refuses_what_is_no_organ_file(tmp_path: Path) -> None:
    path = tmp_path / "duct.organ"
    path.write_bytes(b"solid duct")
    assert "not an organ file" in refused(("info", path))


def test_a_batch_goes_on_from_where_it_was_ended(
    tmp_path: Path, stacks: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    def here(
        function: Callable[[StackJob], object], jobs: list[StackJob], *_: object, **__: object
    ) -> Iterator[tuple[StackJob, object]]:
        return ((job, function(job)) for job in jobs)

    monkeypatch.setattr(stack_batch, "by_processes", here)
    organs = tmp_path / "organs"
    first = json.loads(run("compress", *stacks[:2], "-o", organs, "--json").stdout)
    lines = (organs / "summary.jsonl").read_bytes()
    assert len(lines.splitlines()) == 2
    # A kill cut a third line short, and left no organ file of it.
    (organs / "summary.jsonl").write_bytes(lines + lines.splitlines()[0][:300])
    whole = json.loads(run("compress", *stacks, "-o", organs, "--json").stdout)
    # Seconds too: they are not compressed again.
    assert whole[:2] == first
    rows = list(csv.DictReader((organs / "summary.csv").read_text().splitlines()))
    assert [row["stack"] for row in rows] == [str(stack) for stack in stacks]
    assert [float(row["rms_error_mm"]) for row in rows] == [one["rms_error_mm"] for one in whole]
    # What has changed is compressed anew: other options, other images, an organ that is gone.
    Path(whole[2]["file"]).unlink()
    os.utime(next(stacks[1].glob("*.png")))
    again = json.loads(run("compress", *stacks, "-o", organs, "--json").stdout)
    assert [one["seconds"] == old["seconds"] for one, old in zip(again, whole, strict=True)] == [
        True,
        False,
        False,
    ]
    other = run("compress", stacks[0], "-o", organs, "--json", "--tolerance-px", 1.0)
    assert json.loads(other.stdout)[0]["tolerance_px"] > 1.5 * whole[0]["tolerance_px"]


def _end_at_three(number: int) -> int:
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number**2


def test_a_process_that_dies_takes_only_its_own_work_with_it() -> None:
    done = dict(by_processes(_end_at_three, range(8), 2, died=lambda number: -number))
    assert done == {number: -3 if number == 3 else number**2 for number in range(8)}
