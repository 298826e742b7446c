"""Files of a dissection: what plays its run, and the duct and the strands at its end."""

import io
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np

from app.export.motion import MOST_FRAMES, PAGE_FRAMES
from app.export.recorded_run import RecordedRun
from app.export.snapshot import Snapshot
from app.export.strands import BedRecorder, StrandsSnapshot
from app.export.vtk_series import snapshot_contents
from app.simulation import SurfaceStress
from app.simulation.bed import BedSession, DissectionFile, DissectionReplay
from app.trainer.pages.downloads import VERTICES, Download, file_name, organ_content
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
FEW = 300
"""Vertices of the skin where only its motion is asked for."""


def run_download(run: DissectionFile | None, organ: Organ, suffix: str) -> Download:
    """Return a run on an organ as a file. It can take seconds: not for the clock."""
    if suffix not in RUN_SUFFIXES:
        raise ValueError(f"a download must be one of {', '.join(RUN_SUFFIXES)}, got {suffix!r}")
    name = file_name(organ)
    if suffix == ".organ":
        return Download(f"{name}{suffix}", organ_content(organ))
    if run is None or not run.log.ticks:
        raise ValueError("There is no run yet: take hold of the duct, and pull.")
    return Download(f"{name}{suffix}", _content(run, organ, name, suffix))


def _content(run: DissectionFile, organ: Organ, name: str, suffix: str) -> bytes:
    at_end = suffix in (".stl", ".zip")
    replay = DissectionReplay(run.log, organ, vertices=VERTICES if at_end else FEW)
    if not at_end:
        most = MOST_FRAMES if suffix == ".glb" else PAGE_FRAMES
        played = RecordedRun.of_dissection(replay, frames=min(most, run.log.ticks + 1))
        if suffix == ".glb":
            return played.rigged(edge_length=page_edge_length(organ, VERTICES))
        return run_page(played, edge_length=page_edge_length(organ)).encode()
    replay.seek_tick(replay.ticks)
    if suffix == ".stl":
        return mesh_content(replay.session.drawn.surfaces, suffix)
    packed = io.BytesIO()
    with ZipFile(packed, "w", ZIP_DEFLATED) as archive:
        for end, content in snapshot_contents(_snapshot(replay.session)).items():
            archive.writestr(f"{name}{end}.vtp", content)
    return packed.getvalue()


def _snapshot(session: BedSession) -> Snapshot:
    """Return the duct, whole or in two, and the strands as they are now."""
    duct, surfaces = session.duct, session.drawn.surfaces
    beam, dissection = duct.beam, duct.dissection
    at, stresses = beam.stations / duct.surface.scale, beam.stresses()
    freed = [duct.freed_at(each.skin.stations - dissection.clamps[0]) for each in surfaces]
    return Snapshot(
        surfaces,
        tuple(
            SurfaceStress(dissection, each.skin).in_space(at, stresses, duct.threshold)
            for each in surfaces
        ),
        float(np.linalg.norm(session.reading().forces, axis=1).max()),
        0.0,
        np.concatenate(freed).astype(np.float32),
        _strands(session),
    )


def _strands(session: BedSession) -> StrandsSnapshot:
    """Return the strands as they are now, those of a torn duct at the piece that has them."""
    duct = session.duct
    recorder = BedRecorder(duct.surface)
    recorder.add(duct.beam)
    track = recorder.track()

    def on(piece: int | None) -> StrandsSnapshot:
        moved = duct.move(duct.dissection.rest_transforms(), piece)
        return track.strands_at(0, duct.dissection.driving, moved)

    if duct.torn is None:
        return on(None)
    first, second = on(0), on(1)
    on_first = track.strand_stations - duct.dissection.clamps[0] < duct.torn.station
    ends = np.where(on_first[:, None, None], first.ends, second.ends)
    return StrandsSnapshot(first.feet, ends, first.damage, first.force)
