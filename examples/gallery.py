"""Take the gallery's pictures: run the lines of docs/gallery.md and draw what they write.

python examples/gallery.py docs/gallery.md docs/images/gallery
"""

import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import vtk

ROOT = Path(__file__).parents[1]
SIZE = (1200, 440)
SURFACE, STRANDS = (0.48, 0.3, 0.21), (0.6, 0.5, 0.4)


def entries(page: str) -> Iterator[tuple[str, str, str]]:
    """Yield the language, the lines and the picture's name of each block that has a picture."""
    block = r"^```(sh|python)\n(.*?)^```\n\n!\[.*?\]\(images/gallery/(.*?)\)"
    yield from re.findall(block, page, flags=re.MULTILINE | re.DOTALL)


def run_lines(language: str, lines: str) -> Path:
    """Run a block in this folder and return the last file that it names."""
    if language == "python":
        (script,) = re.findall(r'"(examples/.*?\.py)"', lines)
        subprocess.run([sys.executable, ROOT / script], check=True)
        return Path(Path(script).stem).with_suffix(".png")
    program = Path(sys.executable).with_name("bluntdissect")
    for line in lines.splitlines():
        subprocess.run([program, *shlex.split(line)[1:]], check=True)
    return Path(shlex.split(lines.splitlines()[-1])[-1])


def draw(written: Path, picture: Path) -> None:
    """Draw a file of a surface as its readers show it."""
    window, renderer = vtk.vtkRenderWindow(), vtk.vtkRenderer()
    window.SetOffScreenRendering(1)
    window.SetSize(*SIZE)
    window.SetMultiSamples(8)
    if written.suffix == ".glb":
        reader = vtk.vtkGLTFImporter()
        reader.SetFileName(str(written))
        reader.SetRenderWindow(window)
        reader.Update()
        renderer = reader.GetRenderer()
    else:
        window.AddRenderer(renderer)
        for actor in actors(written):
            renderer.AddActor(actor)
        # In the images' frame z is up from the bed.
        renderer.GetActiveCamera().SetPosition(0.0, -1.0, 0.0)
        renderer.GetActiveCamera().SetViewUp(0.0, 0.0, 1.0)
    lights = vtk.vtkLightKit()
    lights.SetKeyLightIntensity(1.6 if written.suffix == ".glb" else 1.0)
    lights.AddLightsToRenderer(renderer)
    renderer.SetBackground(0.96, 0.96, 0.95)
    renderer.ResetCamera()
    camera = renderer.GetActiveCamera()
    camera.Azimuth(18.0)
    camera.Elevation(14.0)
    camera.Zoom(1.9)
    renderer.ResetCameraClippingRange()
    window.Render()
    pixels, file = vtk.vtkWindowToImageFilter(), vtk.vtkPNGWriter()
    pixels.SetInput(window)
    file.SetInputConnection(pixels.GetOutputPort())
    file.SetFileName(str(picture))
    file.Write()


def actors(written: Path) -> Iterator[vtk.vtkActor]:
    """Yield the surface of a PLY or VTP, and the strands beside it."""
    strands = written.with_name(f"{written.stem}_strands.vtp")
    for path in (written, *([strands] if strands.exists() else [])):
        reader = vtk.vtkPLYReader() if path.suffix == ".ply" else vtk.vtkXMLPolyDataReader()
        reader.SetFileName(str(path))
        mapper, actor = vtk.vtkPolyDataMapper(), vtk.vtkActor()
        mapper.SetInputConnection(reader.GetOutputPort())
        actor.GetProperty().SetAmbient(0.3)
        if path.suffix == ".vtp":
            mapper.ScalarVisibilityOff()
            actor.GetProperty().SetColor(*(STRANDS if path == strands else SURFACE))
            actor.GetProperty().SetLineWidth(1.5)
        actor.SetMapper(mapper)
        yield actor


def main(page: Path, folder: Path) -> None:
    """Take a picture of each block of the page."""
    page, folder = page.resolve(), folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as work:
        os.chdir(work)
        Path("assets").symlink_to(ROOT / "assets")
        for language, lines, name in entries(page.read_text()):
            written = run_lines(language, lines)
            if written.suffix == ".png":
                (folder / name).write_bytes(written.read_bytes())
            else:
                draw(written, folder / name)
            print(folder / name)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
