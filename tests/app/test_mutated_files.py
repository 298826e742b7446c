"""The short form of `make soak`'s mutated files and kills."""

import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import file_fuzz
import pytest
from file_fuzz import KINDS, organ_of
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.classroom.exercise_file import read_exercise
from organ_geometry.organ_file import organ_from_bytes

EDITS = st.lists(
    st.tuples(st.floats(0.0, 1.0), st.integers(0, 8), st.binary(max_size=8)), min_size=1, max_size=5
)
"""Where in a file so many bytes are replaced, and by what."""


READ: dict[str, Callable[[bytes, Path], object]] = {
    "organ": lambda content, _: organ_from_bytes(organ_of(content[4:])),
    "exercise": lambda content, _: read_exercise(content.decode("utf-8", "replace")),
}
"""What is only read here, as what is done with it takes its time: `make soak` has it all."""


@pytest.mark.parametrize("kind", KINDS)
@settings(deadline=None, max_examples=20, suppress_health_check=[HealthCheck.too_slow])
@given(seed=st.integers(0, 100), edits=EDITS)
def test_mutated_files_are_taken_or_refused_in_words(
    kind: str, seed: int, edits: list[tuple[float, int, bytes]]
) -> None:
    use, seeds = KINDS[kind]
    good = seeds()
    content = good[seed % len(good)]
    for place, count, new in edits:
        at = round(place * len(content))
        content = content[:at] + new + content[at + count :]
    try:
        with tempfile.TemporaryDirectory() as folder:
            READ.get(kind, use)(content, Path(folder))
    except ValueError as refusal:
        words = str(refusal)
    else:
        words = "taken"
    assert words


@pytest.mark.long  # processes are killed
def test_a_killed_export_leaves_the_old_file_or_the_new_one() -> None:
    script = Path(file_fuzz.__file__).with_name("kill_fuzz.py")
    killed = subprocess.run(
        [sys.executable, str(script), "4", "export"], capture_output=True, text=True, check=False
    )
    assert killed.returncode == 0, killed.stderr
    assert "4 of export" in killed.stdout
    assert "0 half files, 0 left after the next start" in killed.stdout
