"""Downloads: what is on the screen, or a run, as a file, as `bluntdissect export` writes it."""

import io
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from zipfile import ZIP_DEFLATED, ZipFile

from app.export.motion import MOST_FRAMES, PAGE_FRAMES
from app.export.pull_export import PullExport
from app.export.recorded_run import rigged_runs, run_snapshots
from app.export.recorded_tubes import recorded_runs
from app.export.vtk_series import snapshot_contents
from app.simulation import Phase, Replay, RunFile, RunLog, Session, Specimen
from app.trainer.pages.html_player import export_page, page_edge_length, run_page
from app.trainer.pages.scope_player import scope_page
from organ_geometry import Organ, file_name
from organ_geometry.mesh import mesh_content

SUFFIXES = {
    ".glb": "Animated model (glTF)",
    ".stl": "Closed mesh (STL)",
    ".vtp": "Mesh with stresses (ParaView)",
    ".csv": "Force-deflection curve (CSV)",
    ".html": "Page that plays it",
    ".organ": "Organ file",
}
"""Suffixes and what the panel calls the files of a duct in a plane as it is now."""
PLAYED_SUFFIXES = {
    ".glb": "Animated model of the run (glTF)",
    ".html": "Page that plays the run",
}
"""The same of any run."""
RUN_SUFFIXES = {
    **PLAYED_SUFFIXES,
    ".stl": "Closed mesh at its end (STL)",
    ".stl.zip": "An STL of each mesh at its end (zip)",
    ".zip": "Mesh and strands at its end (ParaView)",
    ".organ": "Organ file",
}
"""The same of a run in space."""


class Download(NamedTuple):
    """A file for the browser: its name and bytes."""

    name: str
    content: bytes


def export_on_screen(session: Session, vertices: int) -> PullExport:
    """Return a session's duct: its theory, grasp, force and threshold, or its tear."""
    with session.lock:  # the clock may play a replay meanwhile
        duct, reading = session.planar, session.reading()
        dissection, grasp = duct.dissection, duct.grasp
        specimen = Specimen(
            dissection.preset,
            dissection.organ,
            theory=duct.theory,
            threshold_MPa=duct.threshold,
        )
    export = PullExport(
        specimen,
        grasp,
        torn=reading.phase is not Phase.INTACT,
        edge_length=page_edge_length(dissection.organ, vertices),
        seed=session.seed,
    )
    if export.torn:
        return export
    force = reading.force
    if not reading.held and reading.deflection > 0.0:
        held = export.theory.pull(dissection.beam, grasp).to_deflection(reading.deflection)
        force = held.force
    if export.break_event is not None:
        force = min(force, export.break_event.force)
    return replace(export, force=max(0.0, force))


def download(session: Session, suffix: str, vertices: int) -> Download:
    """Return what is on the screen as a file, its surface of about so many vertices."""
    # It can take seconds: not for the clock.
    # Static meshes are as the duct is now, in two if it is torn. What moves pulls the duct to where
    # it is now, or a duct at rest or torn to its break, where it tears. The curve goes to the
    # break. Where nothing breaks, the grasper's largest force is the end.
    if suffix not in SUFFIXES:
        raise ValueError(f"a download must be one of {', '.join(SUFFIXES)}, got {suffix!r}")
    name = file_name(session.tissue.dissection.organ.name)
    return Download(f"{name}{suffix}", _content(session, suffix, vertices))


def _content(session: Session, suffix: str, vertices: int) -> bytes:
    organ = session.tissue.dissection.organ
    if suffix == ".organ":
        return organ_content(organ)
    export = export_on_screen(session, vertices)
    if suffix in (".stl", ".vtp"):
        return export.content(suffix)
    export = _moving(export, session.planar.force_limit, whole_curve=suffix == ".csv")
    if suffix == ".html":
        return export_page(export, edge_length=page_edge_length(organ)).encode()
    return export.content(suffix)


def _moving(export: PullExport, most: float, *, whole_curve: bool) -> PullExport:
    """Return the export with a last force, as a motion or a curve needs one."""
    force = None if whole_curve or not export.force else export.force
    if force is None and export.break_event is None:
        force = most
    return replace(export, force=force, torn=False)


def organ_content(organ: Organ) -> bytes:
    """Return the content of an organ's file; a `ValueError` where it has none."""
    if not organ.encoded:
        raise ValueError("only an organ that was built from images has an organ file")
    return organ.encoded


def run_download(run: RunFile | None, organ: Organ, suffix: str, vertices: int) -> Download:
    """Return a run on an organ or at an anatomy as a file, a surface of about so many vertices."""
    # It can take seconds: not for the clock.
    if suffix not in RUN_SUFFIXES:
        raise ValueError(f"a download must be one of {', '.join(RUN_SUFFIXES)}, got {suffix!r}")
    name = file_name(organ.name)
    if suffix == ".organ":
        return Download(f"{name}{suffix}", organ_content(organ))
    if run is None or not run.log.ticks:
        raise ValueError("There is no run yet: take hold of the duct, and pull.")
    anatomy = run.log.start.anatomy
    if anatomy is not None:
        name = file_name(anatomy if isinstance(anatomy, str) else anatomy.name)
    return Download(f"{name}{suffix}", _run_content(run.log, organ, name, suffix, vertices))


def _run_content(log: RunLog, organ: Organ, name: str, suffix: str, vertices: int) -> bytes:
    most = {".glb": MOST_FRAMES, ".html": PAGE_FRAMES}.get(suffix, 2)
    frames = min(most, log.ticks + 1)
    if suffix == ".html" and log.start.anatomy is not None:
        return scope_page(Replay(log, organ), frames=frames).encode()
    played = recorded_runs(log, organ, frames=frames)
    if suffix == ".html":
        return run_page(played[0], edge_length=page_edge_length(organ)).encode()
    # Of several tubes the largest has so many vertices.
    edge_length = max(page_edge_length(each.dissection.organ, vertices) for each in played)
    if suffix == ".glb":
        return rigged_runs(played, edge_length=edge_length)
    ((_, at_end),) = run_snapshots(played, edge_length=edge_length, last=True)
    if suffix != ".zip":
        return mesh_content(at_end.surfaces, Path(f"{name}{suffix}").suffix)
    packed = io.BytesIO()
    with ZipFile(packed, "w", ZIP_DEFLATED) as archive:
        for end, content in snapshot_contents(at_end).items():
            archive.writestr(f"{name}{end}.vtp", content)
    return packed.getvalue()
