"""What tests of several packages share."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real sections, which is not part of the repository."""
    named = os.environ.get("BLUNTDISSECT_DATA")
    folder = Path(named) if named else Path(__file__).parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"real sections are not here: no folder {folder}; set BLUNTDISSECT_DATA")
    return folder
