"""Snapshots for ParaView: a surface with its stresses, strands with their forces, and series."""

import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.export.snapshot import Snapshot
from app.export.strands import StrandsSnapshot
from organ_geometry import check_target, write_atomic
from organ_geometry.mesh import pvd_content, vtp_content

STRANDS = "_strands"
"""What the names of files of strands end in."""


def snapshot_contents(snapshot: Snapshot) -> dict[str, bytes]:
    """Return a snapshot as VTP files: its surface, and its strands by the ending `_strands`."""
    surface = _surface(snapshot)
    return (
        {"": surface}
        if snapshot.strands is None
        else {"": surface, STRANDS: _lines(snapshot.strands)}
    )


def _surface(snapshot: Snapshot) -> bytes:
    """Return the surface, both pieces of a torn organ in one."""
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
    point_data: dict[str, NDArray[Any]] = {
        name: np.concatenate([each[name] for each in figures]) for name in figures[0]
    }
    if snapshot.freed:
        point_data["freed"] = np.concatenate(snapshot.freed)
        point_data["nick_depth_mm"] = np.concatenate(snapshot.nicked)
    point_data["surface"] = np.repeat(np.arange(len(surfaces), dtype=np.int32), np.diff(before))
    return vtp_content(
        np.concatenate([surface.vertices for surface in surfaces]),
        faces=np.concatenate(
            [
                surface.skin.faces + np.int32(first)
                for first, surface in zip(before, surfaces, strict=False)
            ]
        ),
        point_data=point_data,
        names={"surfaces": [surface.name for surface in surfaces]},
    )


def _lines(strands: StrandsSnapshot) -> bytes:
    """Return strands as lines: one of each that is whole, two of a parted one."""
    lines, strand = strands.lines()
    return vtp_content(
        lines.reshape(-1, 3).astype(np.float32),
        lines=np.arange(2 * len(lines), dtype=np.int32).reshape(-1, 2),
        cell_data={
            "strand": strand.astype(np.int32),
            "damage": strands.damage[strand].astype(np.float32),
            "force_N": strands.force[strand].astype(np.float32),
            "parted": strands.parted[strand].astype(np.uint8),
        },
    )


def check_series_path(path: Path) -> None:
    """Raise if a series cannot be written to this path."""
    check_target(path)
    frames = _frames_folder(path)
    if frames.exists() and not path.is_file():
        raise ValueError(f"cannot write {path}: its frames go to {frames}, which is there already")


def write_series(moments: Iterable[tuple[float, Mapping[str, bytes]]], path: Path) -> list[Path]:
    """Write a series, VTP files by their names' endings at each time: all or none."""
    check_series_path(path)
    folder = _frames_folder(path)
    fresh = folder.with_name(f".{folder.name}.part")
    files: list[tuple[float, int, Path]] = []
    try:
        shutil.rmtree(fresh, ignore_errors=True)
        fresh.mkdir()
        for number, (value, contents) in enumerate(moments):
            for index, (ending, content) in enumerate(contents.items()):
                name = f"{path.stem}{ending}_{number:04d}.vtp"
                write_atomic(fresh / name, content)
                files.append((value, index, Path(folder.name) / name))
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
    return [path, *(path.parent / file for *_, file in files)]


def _frames_folder(path: Path) -> Path:
    return path.with_name(f"{path.stem}_frames")
