"""Photographs for the record: from the page to the class, the teacher's page and the export."""

import base64
import csv
import io
from functools import partial
from pathlib import Path

import pytest
from class_runs import record
from PIL import Image

from app.classroom.photograph import MOST_BYTES, kind_of, photograph_of
from app.classroom.report import results_html
from app.classroom.research import write_research
from app.classroom.store import ClassFullError, ClassStore
from app.classroom.xapi import voiding


def image(kind: str = "WEBP", side: int = 40) -> bytes:
    """A picture of one colour."""
    out = io.BytesIO()
    Image.new("RGB", (side, side), (140, 60, 40)).save(out, kind)
    return out.getvalue()


def url(content: bytes) -> str:
    return f"data:image/webp;base64,{base64.b64encode(content).decode()}"


def test_what_is_no_picture_is_refused() -> None:
    for kind, media in (("WEBP", "image/webp"), ("PNG", "image/png"), ("JPEG", "image/jpeg")):
        content = image(kind)
        assert photograph_of(url(content)) == content
        assert kind_of(content) == media
    script = base64.b64encode(b"<svg onload='x'>").decode()
    large = b"RIFF0000WEBP" + bytes(MOST_BYTES)
    for wrong in (
        None, 3.0, "", "data:image/webp;base64,", "data:image/webp;base64,????",
        f"data:image/svg+xml;base64,{script}", "data:text/html;base64,AAAA", url(large),
    ):  # fmt: skip
        with pytest.raises(ValueError, match="no picture"):
            photograph_of(wrong)


def test_a_teacher_gives_points_beside_those_computed(store: ClassStore, tmp_path: Path) -> None:
    person = store.name_person("browser", "Ann")
    run = record(person.id, passed=True)
    store.save(run)
    assert "photograph?" not in results_html(store)
    front, back = image("WEBP"), image("PNG")
    store.keep_photographs(run.id, [front])
    store.keep_photographs(run.id, [front, back])
    assert store.photographs(run.id) == [front, back]
    store.rate(run.id, 4)
    store.rate(run.id, 3)
    page = results_html(store)
    assert page.count(f"photograph?run={run.id}") == 2
    assert "<option selected>3</option>" in page
    for wrong in (-1, 7):
        with pytest.raises(ValueError, match="0 to 6 points"):
            store.rate(run.id, wrong)
    with pytest.raises(ValueError, match="no such run"):
        store.rate("nobody", 3)
    with pytest.raises(ClassFullError, match="at most 2"):
        store.keep_photographs(run.id, [front] * 3)
    with pytest.raises(ValueError, match="no photograph"):
        store.keep_photographs(run.id, [b"<html>"])
    folder = tmp_path / "study"
    write_research(store, {person.id: ""}, folder, b"k" * 32)
    (attempt,) = csv.DictReader(io.StringIO((folder / "attempts.csv").read_text()))
    assert attempt["critical_view_by_teacher"] == "3"
    kept = sorted((folder / "photographs").iterdir())
    assert [each.name for each in kept] == [
        f"{attempt['attempt']}-1.webp", f"{attempt['attempt']}-2.png",
    ]  # fmt: skip
    assert [each.read_bytes() for each in kept] == [front, back]
    store.rate(run.id, None)
    assert store.ratings() == {}
    # They go with the person.
    store.rate(run.id, 5)
    store.delete_person(person.id, partial(voiding, store.id))
    assert store.photographs(run.id) == []
    assert store.ratings() == {}
