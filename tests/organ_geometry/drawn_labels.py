"""Volumes of labels of drawn tubes: straight capsules cut off flat, of known axes and radii."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from organ_geometry import LabelVolume

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Drawn:
    """A straight round tube between two points, mm."""

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radius: float

    def inside(self, places: Floats) -> NDArray[np.bool_]:
        start, end = np.array(self.start), np.array(self.end)
        length = float(np.linalg.norm(end - start))
        along = (end - start) / length
        off = places - start
        at = off @ along
        away = np.linalg.norm(off - at[..., np.newaxis] * along, axis=-1)
        return (away < self.radius) & (at >= 0.0) & (at <= length)


def turn_about_z(degrees: float) -> Floats:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def drawn_volume(
    tubes: dict[int, Drawn],
    size: float | tuple[float, float, float],
    *,
    turn: Floats | None = None,
    margin: float = 4.0,
) -> LabelVolume:
    """Voxels whose centres are inside: earlier tubes win. The body, not the volume, is turned."""
    sizes = np.broadcast_to(np.array(size, dtype=np.float64), 3).copy()
    turn = np.eye(3) if turn is None else turn
    ends = np.array([point for tube in tubes.values() for point in (tube.start, tube.end)]) @ turn.T
    most = max(tube.radius for tube in tubes.values()) + margin
    low, high = ends.min(axis=0) - most, ends.max(axis=0) + most
    counts = np.ceil((high - low) / sizes).astype(int) + 1
    i, j, k = np.meshgrid(*(np.arange(count) for count in counts), indexing="ij")
    places = (low + np.stack([i, j, k], axis=-1) * sizes) @ turn
    values = np.zeros(tuple(counts), dtype=np.int32)
    for label, tube in tubes.items():
        values[(values == 0) & tube.inside(places)] = label
    return LabelVolume(
        Path("drawn"), np.ascontiguousarray(values.transpose(2, 1, 0)), sizes, low, np.eye(3)
    )


def write(
    volume: LabelVolume, path: Path, flips: tuple[int, ...] = (), names: bool = False
) -> Path:
    """A file of it as SimpleITK writes it, stored the other way round along some axes."""
    import SimpleITK as sitk  # noqa: N813

    values, origin, axes = volume.values, volume.origin, volume.axes.copy()
    for axis in flips:
        count = values.shape[2 - axis]
        origin = origin + (count - 1) * volume.sizes[axis] * axes[:, axis]
        axes[:, axis] *= -1.0
        values = np.flip(values, axis=2 - axis)
    image = sitk.GetImageFromArray(np.ascontiguousarray(values).astype(np.uint8))
    image.SetSpacing(volume.sizes.tolist())
    image.SetOrigin(origin.tolist())
    image.SetDirection(axes.ravel().tolist())
    if names:
        for number, (label, name) in enumerate(volume.names.items()):
            image.SetMetaData(f"Segment{number}_Name", name)
            image.SetMetaData(f"Segment{number}_LabelValue", str(label))
            image.SetMetaData(f"Segment{number}_Layer", "0")
    sitk.WriteImage(image, str(path), useCompression=True)
    return path
