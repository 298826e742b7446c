"""An organ: an axis with frames along it and half-curves at its key sections."""

import math
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.half_curves import (
    HALF_WIDTH,
    ROW_SIZE,
    closed_outlines,
    outline_points,
)
from organ_geometry.curves.key_blend import KeyBlend

Wall: TypeAlias = Literal["outer", "lumen"]

FRAME_TOLERANCE = 1e-3
# A direction this near to the axis points across no section.
SMALLEST_IN_PLANE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class SectionProperties:
    """Area and second moments of an organ's sections, as a beam needs them.

    (N,) each: area of tissue, mm^2; about the centroidal axis across a direction the second moment,
    mm^4, and the largest distance of the outer boundary along that direction, mm.
    """

    area: NDArray[np.float64]
    second_moment: NDArray[np.float64]
    fibre_distance: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Organ:
    """A tubular organ where its images stand.

    S sections have an axis point and a frame; K of them are key sections with curves, and those of
    the sections between follow from them by their numbers, as `KeyBlend` has it. Between two
    sections everything is linear. Arrays are copied, checked and locked. Stations are arc lengths
    along the axis, mm; what lies beyond an end is taken at that end.

    Attributes
    ----------
    axis
        (S, 3) points of the axis, one for each section, mm.
    frames
        (S, 3, 3) unit directions as columns: x_dir, y_dir (down the image, if `turn` is 0) and the
        section's normal. All are right-handed or all are left-handed, see `handedness`.
    keys
        (K,) which sections are key sections; the first is 0, the last S-1.
    outer, lumen
        (K, 16) half-curves of each boundary at the key sections, mm; no lumen if it is solid.
    units
        What the lengths are called where they come from.
    tolerance_mm
        Largest RMS distance of a section's edge points to the organ, mm.
    encoded
        Content of the organ's file, or nothing if the organ comes from none.
    turn
        How far x_dir is turned from the images' right towards y_dir, rad.
    """

    axis: NDArray[np.float64]
    frames: NDArray[np.float64]
    keys: NDArray[np.intp]
    outer: NDArray[np.float64]
    lumen: NDArray[np.float64] | None = None
    units: str = "mm"
    tolerance_mm: float = 0.0
    name: str = ""
    encoded: bytes = b""
    turn: float = 0.0
    # Of the circle; found when it is first asked for: an encoder makes many organs.
    _mean_radius: float | None = field(default=None, init=False, repr=False)
    # (S, 16) half-curves of all sections.
    _outer_rows: NDArray[np.float64] = field(init=False, repr=False)
    _lumen_rows: NDArray[np.float64] | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        sections = len(self.axis)
        if sections < 2:
            raise ValueError(f"an organ needs two or more sections, not {sections}")
        self._lock("axis", (sections, 3))
        self._lock("frames", (sections, 3, 3))
        keys = np.array(self.keys)
        if keys.ndim != 1 or keys.dtype.kind not in "iu" or len(keys) < 2:
            raise ValueError("keys must be (K,) whole numbers, two or more")
        if keys[0] != 0 or keys[-1] != sections - 1 or (np.diff(keys.astype(np.int64)) <= 0).any():
            raise ValueError(
                f"keys must increase from 0 to {sections - 1}, the last section, "
                f"not from {keys[0]} to {keys[-1]}"
            )
        keys = keys.astype(np.intp)
        keys.setflags(write=False)
        object.__setattr__(self, "keys", keys)
        self._lock("outer", (len(keys), ROW_SIZE))
        if self.lumen is not None:
            self._lock("lumen", (len(keys), ROW_SIZE))
        if not (np.linalg.norm(np.diff(self.axis, axis=0), axis=1) > 0.0).all():
            raise ValueError("neighbouring points of axis must be apart, above 0 mm")
        products = np.einsum("sij,sik->sjk", self.frames, self.frames)
        if np.abs(products - np.eye(3)).max() > FRAME_TOLERANCE:
            raise ValueError(
                f"frames must have perpendicular unit columns to within {FRAME_TOLERANCE:g}"
            )
        turns = np.linalg.det(self.frames)
        if (turns > 0.0).any() and (turns < 0.0).any():
            raise ValueError("frames must be all right-handed or all left-handed")
        if not (math.isfinite(self.tolerance_mm) and self.tolerance_mm >= 0.0):
            raise ValueError(
                f"tolerance_mm must be 0 mm or more and finite, not {self.tolerance_mm:g} mm"
            )
        blend = KeyBlend.at(np.arange(sections), keys)
        for wall, rows in (("outer", self.outer), ("lumen", self.lumen)):
            if rows is not None:
                between = blend.of(rows)
                if not (between[:, HALF_WIDTH] > 0.0).all():
                    raise ValueError(f"every half width in {wall} must be above 0 mm")
                object.__setattr__(self, f"_{wall}_rows", between)

    def _lock(self, field: str, shape: tuple[int, ...]) -> None:
        locked = np.array(getattr(self, field), dtype=np.float64)
        if locked.shape != shape:
            raise ValueError(f"{field} must have shape {shape}, not {locked.shape}")
        if not np.isfinite(locked).all():
            raise ValueError(f"{field} must be finite")
        locked.setflags(write=False)
        object.__setattr__(self, field, locked)

    @property
    def stations(self) -> NDArray[np.float64]:
        """(S,) arc length of each section along the axis from the first, mm."""
        steps = np.linalg.norm(np.diff(self.axis, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def length(self) -> float:
        """Length of the axis, mm."""
        return float(self.stations[-1])

    @property
    def key_stations(self) -> NDArray[np.float64]:
        """(K,) arc length of each key section, mm."""
        return self.stations[self.keys]

    @property
    def hollow(self) -> bool:
        """Whether the organ has a lumen."""
        return self.lumen is not None

    @property
    def handedness(self) -> int:
        """1 if x_dir, y_dir, normal are right-handed, -1 if left-handed."""
        return 1 if float(np.linalg.det(self.frames[0])) > 0.0 else -1

    @property
    def mean_radius(self) -> float:
        """Radius of the circle of the outer boundary's area, averaged over the length, mm."""
        found = self._mean_radius
        if found is None:
            stations = self.stations
            outlines = closed_outlines(self.rows_at(stations))
            radii = np.sqrt(_moments(outlines).area / np.pi)
            found = float(np.trapezoid(radii, stations) / stations[-1])
            object.__setattr__(self, "_mean_radius", found)
        return found

    @property
    def largest_radius(self) -> float:
        """Largest distance of the surface from the axis at a key section, mm."""
        count = 32
        centres = np.repeat(self.axis_at(self.key_stations), count, axis=0)
        return float(np.linalg.norm(self.key_points(count) - centres, axis=1).max())

    def axis_at(self, stations: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (N, 3) points of the axis, mm, straight between sections."""
        places = self.stations
        columns = [np.interp(stations, places, self.axis[:, column]) for column in range(3)]
        return np.stack(columns, axis=-1)

    def frames_at(self, stations: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (N, 3, 3) frames, between two sections the perpendicular mean of theirs."""
        before, fraction = _neighbours(self.stations, np.asarray(stations, dtype=np.float64))
        fraction = fraction[:, np.newaxis, np.newaxis]
        mixed = self.frames[before] * (1.0 - fraction) + self.frames[before + 1] * fraction
        normal = mixed[:, :, 2] / np.linalg.norm(mixed[:, :, 2], axis=1, keepdims=True)
        x_dir = mixed[:, :, 0]
        x_dir = x_dir - normal * np.einsum("ni,ni->n", x_dir, normal)[:, np.newaxis]
        x_dir = x_dir / np.linalg.norm(x_dir, axis=1, keepdims=True)
        y_dir = self.handedness * np.cross(normal, x_dir)
        return np.stack([x_dir, y_dir, normal], axis=2)

    @property
    def _up(self) -> NDArray[np.float64]:
        """(2,) the images' up in a section's own coordinates."""
        return np.array([-math.sin(self.turn), -math.cos(self.turn)])

    def up_at(self, stations: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (N, 3) unit directions, the images' up in the sections along the axis."""
        frames, (x, y) = self.frames_at(stations), self._up
        return frames[:, :, 0] * x + frames[:, :, 1] * y

    def rows_at(self, stations: NDArray[np.float64], wall: Wall = "outer") -> NDArray[np.float64]:
        """Return (N, 16) half-curves, mm; a ValueError for the lumen of a solid organ."""
        rows = self._outer_rows if wall == "outer" else self._lumen_rows
        if rows is None:
            raise ValueError(f"the organ {self.name!r} is solid and has no lumen")
        before, fraction = _neighbours(self.stations, np.asarray(stations, dtype=np.float64))
        fraction = fraction[:, np.newaxis]
        return rows[before] * (1.0 - fraction) + rows[before + 1] * fraction

    def surface(
        self,
        stations: NDArray[np.float64],
        angles: NDArray[np.float64],
        wall: Wall = "outer",
    ) -> NDArray[np.float64]:
        """Return (N, 3) surface points, mm, at stations and angles (rad, x_dir towards y_dir)."""
        stations = np.asarray(stations, dtype=np.float64)
        angles = np.asarray(angles, dtype=np.float64)
        local = outline_points(self.rows_at(stations, wall), angles)
        frames = self.frames_at(stations)
        return (
            self.axis_at(stations) + frames[:, :, 0] * local[:, :1] + frames[:, :, 1] * local[:, 1:]
        )

    def key_points(self, count: int = 32) -> NDArray[np.float64]:
        """Return (K*count, 3) points of the outer surface at the key sections, mm."""
        angles = 2.0 * np.pi * np.arange(count) / count
        stations = self.key_stations
        return self.surface(np.repeat(stations, count), np.tile(angles, len(stations)))

    def section_properties(
        self, stations: NDArray[np.float64], direction: NDArray[np.float64] | None = None
    ) -> SectionProperties:
        """Return area, second moment and fibre distance of sections, of the wall if hollow.

        Parameters
        ----------
        stations
            (N,) arc lengths, mm.
        direction
            (3,) direction in which the organ is bent, of any length; what of it lies in a section
            counts there. Default: up in the image.

        Returns
        -------
        SectionProperties
            (N,) each, mm^2, mm^4 and mm.

        Raises
        ------
        ValueError
            If the direction is not finite or points along the axis at a station.
        """
        stations = np.asarray(stations, dtype=np.float64)
        across = self._in_plane(stations, direction)
        outlines = closed_outlines(self.rows_at(stations))
        whole = _moments(outlines)
        tissue = whole
        if self.hollow:
            tissue = whole.without(_moments(closed_outlines(self.rows_at(stations, "lumen"))))
        # Steiner: moments about the centroid are those about the origin less A offset^2.
        centroid = tissue.first / tissue.area[:, np.newaxis]
        about_axis = np.einsum("ni,nij,nj->n", across, tissue.second, across)
        offset = np.einsum("ni,ni->n", centroid, across)
        reach = np.einsum("npi,ni->np", outlines, across) - offset[:, np.newaxis]
        return SectionProperties(
            area=tissue.area,
            second_moment=about_axis - tissue.area * offset**2,
            fibre_distance=np.abs(reach).max(axis=1),
        )

    def _in_plane(
        self, stations: NDArray[np.float64], direction: NDArray[np.float64] | None
    ) -> NDArray[np.float64]:
        """Return the (N, 2) unit direction in each section's own coordinates."""
        if direction is None:
            return np.broadcast_to(self._up, (len(stations), 2))
        pull = np.asarray(direction, dtype=np.float64)
        if pull.shape != (3,) or not np.isfinite(pull).all() or not pull.any():
            raise ValueError(f"direction must be (3,), finite and not zero, not {pull.tolist()}")
        pull = pull / np.linalg.norm(pull)
        across = np.einsum("nij,i->nj", self.frames_at(stations)[:, :, :2], pull)
        sizes = np.linalg.norm(across, axis=1, keepdims=True)
        if (sizes < SMALLEST_IN_PLANE).any():
            raise ValueError(f"direction {pull.tolist()} points along the axis, not across it")
        return across / sizes


@dataclass(frozen=True, slots=True, eq=False)
class _Moments:
    """Integrals over the area of N polygons, about the origin of their coordinates."""

    area: NDArray[np.float64]  # (N,) mm^2
    first: NDArray[np.float64]  # (N, 2) integrals of x and y, mm^3
    second: NDArray[np.float64]  # (N, 2, 2) integrals of the products of x and y, mm^4

    def without(self, hole: "_Moments") -> "_Moments":
        """Return the integrals without those of a hole."""
        return _Moments(self.area - hole.area, self.first - hole.first, self.second - hole.second)


def _moments(outlines: NDArray[np.float64]) -> _Moments:
    """Return the integrals over (N, C, 2) closed polygons by Green's theorem."""
    # Sums over the sides from p to q, with c = p x q: area = sum c / 2, integral of x = sum
    # c (p + q) / 6, of x x' = sum c (p p' + q q' + (p + q)(p + q)') / 24. Their sign is the sense.
    here = outlines
    after = np.roll(outlines, -1, axis=1)
    cross = here[..., 0] * after[..., 1] - here[..., 1] * after[..., 0]
    area = 0.5 * cross.sum(axis=1)
    both = here + after
    first = np.einsum("nc,nci->ni", cross, both) / 6.0
    second = (
        np.einsum("nc,nci,ncj->nij", cross, here, here)
        + np.einsum("nc,nci,ncj->nij", cross, after, after)
        + np.einsum("nc,nci,ncj->nij", cross, both, both)
    ) / 24.0
    sign = np.sign(area)
    return _Moments(
        sign * area, sign[:, np.newaxis] * first, sign[:, np.newaxis, np.newaxis] * second
    )


def _neighbours(
    places: NDArray[np.float64], stations: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the point before each station and its share of the distance to the next, 0 to 1."""
    before = np.clip(np.searchsorted(places, stations, side="right") - 1, 0, len(places) - 2)
    fraction = (stations - places[before]) / (places[before + 1] - places[before])
    return before, np.clip(fraction, 0.0, 1.0)
