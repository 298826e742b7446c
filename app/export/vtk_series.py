"""Snapshots for ParaView: one surface with its stresses, or a series of them over the force."""

import shutil
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from app.export.snapshot import Snapshot
from organ_geometry import check_target, write_atomic
from organ_geometry.mesh import pvd_content, vtp_content

__all__ = ["check_series_path", "snapshot_content", "write_series"]


def snapshot_content(snapshot: Snapshot) -> bytes:
    """Return a snapshot as a VTP file, both pieces of a torn organ in one."""
    surfaces = snapshot.surfaces
    before = np.cumsum([0, *(len(surface.vertices) for surface in surfaces)])
    figures = [
        {
            "displacement_mm": surface.vertices - surface.skin.vertices,
            "normal_stress_MPa": stress.normal,
            "bending_stress_MPa": stress.bending,
            "total_stress_MPa": stress.total,
            "distance_to_break": stress.distance_to_break,
        }
        for surface, stress in zip(surfaces, snapshot.stresses, strict=True)
    ]
    return vtp_content(
        np.concatenate([surface.vertices for surface in surfaces]),
        np.concatenate(
            [
                surface.skin.faces + np.int32(first)
                for first, surface in zip(before, surfaces, strict=False)
            ]
        ),
        {name: np.concatenate([each[name] for each in figures]) for name in figures[0]},
    )


def check_series_path(path: Path) -> None:
    """Raise if a series cannot be written to this path."""
    check_target(path)
    frames = _frames_folder(path)
    if frames.exists() and not path.is_file():
        raise ValueError(f"cannot write {path}: its frames go to {frames}, which is there already")


def write_series(snapshots: Iterable[Snapshot], path: Path) -> list[Path]:
    """Write snapshots as a series over the force: all files or none."""
    check_series_path(path)
    folder = _frames_folder(path)
    fresh = folder.with_name(f".{folder.name}.part")
    files: list[tuple[float, Path]] = []
    try:
        shutil.rmtree(fresh, ignore_errors=True)
        fresh.mkdir()
        for number, snapshot in enumerate(snapshots):
            name = f"{path.stem}_{number:04d}.vtp"
            write_atomic(fresh / name, snapshot_content(snapshot))
            files.append((snapshot.force, Path(folder.name) / name))
        shutil.rmtree(folder, ignore_errors=True)
        fresh.replace(folder)
        try:
            write_atomic(path, pvd_content(files))
        except ValueError:
            shutil.rmtree(folder)
            raise
    except OSError as error:
        raise ValueError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    return [path, *(path.parent / file for _, file in files)]


def _frames_folder(path: Path) -> Path:
    return path.with_name(f"{path.stem}_frames")
