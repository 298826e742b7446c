"""Files of a dissection: what plays its run, and the duct and the strands at its end."""

import io
from zipfile import ZIP_DEFLATED, ZipFile

from app.export.motion import MOST_FRAMES, PAGE_FRAMES
from app.export.recorded_run import RecordedRun
from app.export.vtk_series import snapshot_contents
from app.simulation import RunFile
from app.trainer.pages.downloads import Download, file_name, organ_content
from app.trainer.pages.html_player import page_edge_length, run_page
from organ_geometry import Organ
from organ_geometry.mesh import mesh_content

__all__ = ["RUN_SUFFIXES", "run_download"]

RUN_SUFFIXES = {
    ".glb": "Animated model of the run (glTF)",
    ".html": "Page that plays the run",
    ".stl": "Closed mesh at its end (STL)",
    ".zip": "Mesh and strands at its end (ParaView)",
    ".organ": "Organ file",
}
"""Suffixes and what the panel calls the files."""


def run_download(run: RunFile | None, organ: Organ, suffix: str, vertices: int) -> Download:
    """Return a run on an organ as a file, its surface of about so many vertices."""
    # It can take seconds: not for the clock.
    if suffix not in RUN_SUFFIXES:
        raise ValueError(f"a download must be one of {', '.join(RUN_SUFFIXES)}, got {suffix!r}")
    name = file_name(organ)
    if suffix == ".organ":
        return Download(f"{name}{suffix}", organ_content(organ))
    if run is None or not run.log.ticks:
        raise ValueError("There is no run yet: take hold of the duct, and pull.")
    return Download(f"{name}{suffix}", _content(run, organ, name, suffix, vertices))


def _content(run: RunFile, organ: Organ, name: str, suffix: str, vertices: int) -> bytes:
    most = {".glb": MOST_FRAMES, ".html": PAGE_FRAMES}.get(suffix, 2)
    played = RecordedRun.of_log(run.log, organ, frames=min(most, run.log.ticks + 1))
    if suffix == ".html":
        return run_page(played, edge_length=page_edge_length(organ)).encode()
    edge_length = page_edge_length(organ, vertices)
    if suffix == ".glb":
        return played.rigged(edge_length=edge_length)
    at_end = played.at_end(edge_length=edge_length)
    if suffix == ".stl":
        return mesh_content(at_end.surfaces, suffix)
    packed = io.BytesIO()
    with ZipFile(packed, "w", ZIP_DEFLATED) as archive:
        for end, content in snapshot_contents(at_end).items():
            archive.writestr(f"{name}{end}.vtp", content)
    return packed.getvalue()
