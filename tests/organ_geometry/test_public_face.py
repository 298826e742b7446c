"""What `organ_geometry` offers by name, and what a command loads with it."""

import ast
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

import organ_geometry


def test_every_name_that_the_types_show_can_be_had() -> None:
    path = Path(organ_geometry.__file__)
    typed = {
        alias.name: node.module
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("organ_geometry.")
        for alias in node.names
    }
    assert typed == vars(organ_geometry)["_MODULE_OF"]
    assert all(hasattr(organ_geometry, name) for name in typed)
    assert set(typed) <= set(dir(organ_geometry))
    # A module of the same name would take a name's place once it is imported.
    assert not {module.name for module in pkgutil.iter_modules(organ_geometry.__path__)} & set(
        typed
    )


@pytest.mark.slow
def test_reading_an_organ_loads_no_image_library() -> None:
    program = (
        "import sys; from organ_geometry import Organ, read_organ; import organ_geometry.mesh; "
        "print([name for name in ('cv2', 'trimesh', 'SimpleITK') if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
