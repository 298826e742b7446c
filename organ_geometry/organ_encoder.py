"""From section contours to the organ in fewest bytes that keeps every section to a tolerance."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from organ_geometry.axis_encoder import ALONG_STEPS, CodedAxis, coded_axes
from organ_geometry.contour import (
    LOFT_POINTS,
    ContourLoft,
    SectionContour,
    centroid_and_radius,
)
from organ_geometry.key_sections import key_sections
from organ_geometry.organ import Organ
from organ_geometry.organ_code import (
    LARGEST_KEY_DEPTH,
    ROLLS,
    TILTS,
    OrganCode,
    axis_and_frames,
    scale_number,
    scale_of,
    tolerance_number,
    tolerance_of,
)
from organ_geometry.organ_file import OrganFileError, code_bytes, organ_from_bytes
from organ_geometry.section_encoder import CodedSections, Outlines, SectionEncoder
from organ_geometry.section_signals import signals_to_rows
from organ_geometry.surface_distance import wall_distances

Selection: TypeAlias = Literal["fewest", "thesis"]

BIT_PRICE = 0.2
"""Squared error, summed over the sections, that a bit is worth, in squared steps."""
AXIS_STEP = 1.0
"""Step of the axis in tolerances."""

# Steps of half-curves in tolerances, four to an octave between these.
_COARSEST_STEP, _FINEST_STEP = 0.75, 1.0 / 16.0
_ROUGH_POINTS = 40
_ROUGHLY = 1.1
_FINEST_SHARE, _COARSEST_SHARE, _LARGEST_SHARE = 1e-3, 0.2, 50.0
_FINER_CANDIDATES = 2
_WEIGHTINGS = 4
_VARIANTS = ((0, 2.0), (2, 2.0), (2, 4.0), (4, 4.0))
_AXES = 4
_HEAVIEST = 1.6
# An end section leans out of the axis by up to 1 in 1/4.
_STEEPEST = 0.25


class ToleranceTooSmall(ValueError):  # noqa: N818
    """A tolerance below what half-curves and pixels allow.

    Attributes
    ----------
    smallest_mm
        The smallest tolerance that can be kept, mm.
    """

    def __init__(self, message: str, smallest_mm: float) -> None:
        super().__init__(message)
        self.smallest_mm = smallest_mm


@dataclass(frozen=True, slots=True, eq=False)
class EncodedOrgan:
    """An organ, decoded from its file's content, and where its sections are.

    Attributes
    ----------
    organ
        The organ; it carries the content of its file.
    places
        (S,) place of each section along it, from 0 to 1.
    outlines
        What the contours are at equal distances along it.
    """

    organ: Organ
    places: NDArray[np.float64]
    outlines: Outlines


def encoded_organ(
    contours: Sequence[SectionContour],
    tolerance: float,
    *,
    hollow: bool = False,
    left_handed: bool = False,
    select: Selection = "fewest",
    units: str = "mm",
    name: str = "",
) -> EncodedOrgan:
    """Return the organ that keeps every section to a tolerance in few bytes.

    Parameters
    ----------
    contours
        Two or more sections in order.
    tolerance
        Largest RMS distance of a section's edge points to the organ, mm.
    hollow
        Whether all sections have a lumen that counts.
    left_handed
        Whether right, down and along the stack are left-handed in the images.
    select
        How key sections are chosen: "fewest" keeps as few bytes as it can, "thesis" compares each
        section with the last key section.
    units
        What the lengths are called.
    name
        What the organ is called.

    Returns
    -------
    EncodedOrgan
        The organ, decoded from what its file holds.

    Raises
    ------
    ToleranceTooSmall
        If a section cannot be kept to the tolerance; the smallest that can is named.
    ValueError
        If there are fewer than two sections.
    """
    if len(contours) < 2:
        raise ValueError(f"an organ needs two or more sections, not {len(contours)}")
    encoder = _Encoder(
        contours, tolerance, hollow=hollow, left_handed=left_handed, units=units, name=name
    )
    if select == "thesis":
        return encoder.by_the_thesis()
    return encoder.in_fewest_bytes()


def section_distances(
    organ: Organ,
    contours: Sequence[SectionContour],
    places: NDArray[np.float64],
    most: int | None = None,
) -> list[NDArray[np.float64]]:
    """Return how far every section's edge points are from an organ.

    Parameters
    ----------
    organ
        The organ.
    contours
        The S sections.
    places
        (S,) place of each along the organ, from 0 to 1.
    most
        Number of points of an edge that is enough.

    Returns
    -------
    list[NDArray[np.float64]]
        For each section the distances of its edge points, the lumen's after the outer ones, mm.
    """
    parts: list[list[NDArray[np.float64]]] = [[] for _ in contours]
    for wall in ("outer", "lumen") if organ.hollow else ("outer",):
        edges = [_thinned(getattr(contour, wall), most) for contour in contours]
        counts = [len(edge) for edge in edges]
        near = np.repeat(places * organ.length, counts)
        away = wall_distances(organ, np.concatenate(edges), near, wall)
        for part, distances in zip(parts, np.split(away, np.cumsum(counts)[:-1]), strict=True):
            part.append(distances)
    return [np.concatenate(part) for part in parts]


def root_mean_squares(distances: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the root mean square of each section's distances.

    Parameters
    ----------
    distances
        Distances of S sections, mm.

    Returns
    -------
    NDArray[np.float64]
        (S,) mm.
    """
    return np.array([math.sqrt(float(away @ away) / len(away)) for away in distances])


def _thinned(points: NDArray[np.float64], most: int | None) -> NDArray[np.float64]:
    return points if most is None else points[:: max(1, len(points) // most)]


def _size(encoded: EncodedOrgan) -> int:
    return len(encoded.organ.encoded)


class _Encoder:
    """One organ's contours, cut across its axis and coded in steps of several sizes."""

    def __init__(
        self,
        contours: Sequence[SectionContour],
        tolerance: float,
        *,
        hollow: bool,
        left_handed: bool,
        units: str,
        name: str,
    ) -> None:
        self._contours = contours
        self._name = name
        self._units = units
        self._left_handed = left_handed
        self._depth = min(
            max(1, math.ceil(math.log2(max(2, len(contours) - 1)) - 0.4)), LARGEST_KEY_DEPTH
        )

        normals = np.array([contour.normal for contour in contours])
        measures = [centroid_and_radius(contour.outer) for contour in contours]
        self._centroids = np.array([centroid for centroid, _ in measures])
        self._radius = float(np.mean([radius for _, radius in measures]))
        self._lofts = [ContourLoft.through([contour.outer for contour in contours], normals)]
        if hollow:
            lumens = [contour.lumen for contour in contours if contour.lumen is not None]
            self._lofts.append(ContourLoft.through(lumens, normals))
        self._allowed = tolerance
        within = max(tolerance, _FINEST_SHARE * self._radius)
        self._number = tolerance_number(min(within, _LARGEST_SHARE * self._radius))
        self._tolerance = tolerance_of(self._number)
        # Steps go with the tolerance, but none is so long that it would leave nothing of a section.
        narrowest = min(float(np.ptp(contour.outer @ contour.x_dir)) for contour in contours)
        longest = _COARSEST_SHARE * min(self._radius, 0.5 * narrowest)
        usual = min(1.0, longest / self._tolerance)
        self._coarsest = scale_number(usual * _COARSEST_STEP)
        self._finest_scale = scale_number(usual * _FINEST_STEP)
        self._axis_scale = scale_number(usual * AXIS_STEP)
        step = self._tolerance * scale_of(self._axis_scale)
        self._axes = coded_axes(self._centroids, step, 2.0 * BIT_PRICE * (0.5 * step) ** 2)
        self._axis: CodedAxis = self._axes[0]
        self._cut()

    def in_fewest_bytes(self) -> EncodedOrgan:
        """Return the organ of the coarsest steps that keep the tolerance."""
        best = self._exact()
        fine, coarse = self._finest_scale, self._coarsest + 1
        # Halving: `coarse` breaks the tolerance; `fine` keeps it, or is the finest there is.
        while coarse - fine > 1:
            middle = (fine + coarse) // 2
            organ = self._kept(middle)
            if organ is None:
                coarse = middle
            else:
                fine = middle
                best = min(best, organ, key=_size)
        # Finer steps that leave out more may take fewer bytes, and so may dearer bits.
        for finer, dearer in _VARIANTS:
            organ = self._kept(max(fine - finer, self._finest_scale), dearer)
            if organ is not None:
                best = min(best, organ, key=_size)
        return best

    def _kept(self, scale: int, dearer: float = 1.0) -> EncodedOrgan | None:
        """Return an organ in steps of a size that keeps the tolerance, or None."""
        weights = self._weights
        for _ in range(_WEIGHTINGS):
            organ = self._organ(scale, weights=weights, dearer=dearer)
            if organ is None:
                return None
            excess = self._excess(organ)
            if float(excess.max()) <= 1.0:
                return organ
            # What sections are off too far weighs more the next time.
            heavier = np.clip(excess, 1.0, _HEAVIEST) ** 3
            stations = np.linspace(0.0, 1.0, len(weights))
            weights = weights * np.interp(stations, self._places, heavier)
        return None

    def _exact(self) -> EncodedOrgan:
        """Return the organ with all candidates as key sections, which keeps the tolerance."""
        # An axis of many keys may bend so sharply that sections cross: another may do.
        nearest = math.inf
        best: tuple[CodedAxis, EncodedOrgan] | None = None
        for axis in self._axes[:_AXES]:
            if axis is not self._axis:
                self._axis = axis
                self._cut()
            organ, excess = self._with_all_candidates()
            if organ is not None and (best is None or excess < nearest):
                nearest, best = excess, (axis, organ)
            if excess <= 1.0:
                break
        if best is None:
            raise ValueError("the sections make no organ: their widths vanish")
        axis, organ = best
        if axis is not self._axis:
            self._axis = axis
            self._cut()
        for _ in range(_FINER_CANDIDATES):
            if nearest <= 1.0 or self._depth >= LARGEST_KEY_DEPTH:
                break
            # What changes between two sections needs keys at less than their distance.
            self._depth += 1
            self._cut()
            finer, excess = self._with_all_candidates()
            if finer is not None and excess < nearest:
                nearest, organ = excess, finer
        if nearest > 1.0:
            raise self._refusal(organ)
        return organ

    def _with_all_candidates(self) -> tuple[EncodedOrgan | None, float]:
        """Return the organ with all candidates as key sections, and its largest excess."""
        organ = self._organ(
            self._finest_scale, np.arange(self._candidates + 1, dtype=np.intp), exact=True
        )
        return organ, math.inf if organ is None else float(self._excess(organ).max())

    def by_the_thesis(self) -> EncodedOrgan:
        """Return the organ whose key sections the thesis's rule keeps."""
        exact = self._exact()
        finer = self._samples // self._candidates
        rows = [signals_to_rows(fit[::finer]) for fit in self._encoder.fits]
        lumen = rows[1] if len(rows) > 1 else None
        threshold = self._tolerance
        for _ in range(24):
            keys = key_sections(rows[0], lumen, threshold)
            organ = self._organ(scale_number(0.25), keys)
            if organ is not None and self._keeps(organ):
                return organ
            threshold *= 0.8
        return exact

    def _organ(
        self,
        scale: int,
        keys: NDArray[np.intp] | None = None,
        *,
        exact: bool = False,
        weights: NDArray[np.float64] | None = None,
        dearer: float = 1.0,
    ) -> EncodedOrgan | None:
        """Return the organ in steps of a size, decoded from its file's content, or None."""
        step = self._tolerance * scale_of(scale)
        price = 0.0 if exact else dearer * BIT_PRICE * step * step
        sections = self._encoder.coded(
            step, price, self._weights if weights is None else weights, keys
        )
        code = self._code(scale, sections)
        try:
            # Steps as long as a section is wide may leave none of it.
            organ = organ_from_bytes(code_bytes(code), self._name)
        except OrganFileError:
            return None
        return EncodedOrgan(organ, self._places, self._outlines)

    def _code(self, scale: int, sections: CodedSections) -> OrganCode:
        return OrganCode(
            units=self._units,
            left_handed=self._left_handed,
            tolerance=self._number,
            axis_scale=self._axis_scale,
            along_steps=ALONG_STEPS,
            start_axis=self._start_axis,
            roll=self._roll,
            tilts=self._tilts,
            ends=self._axis.ends,
            bends=self._axis.bends,
            section_scale=scale,
            candidates=self._candidates,
            keys=sections.keys,
            outer=sections.outer,
            lumen=sections.lumen,
        )

    def _keeps(self, encoded: EncodedOrgan) -> bool:
        """Return whether every section is kept to the tolerance."""
        return float(self._excess(encoded).max()) <= 1.0

    def _excess(self, encoded: EncodedOrgan) -> NDArray[np.float64]:
        """Return the (S,) RMS distance of each section in tolerances, roughly if far above one."""
        excess = np.zeros(len(self._contours))
        for most in (_ROUGH_POINTS, None):
            away = section_distances(encoded.organ, self._contours, encoded.places, most)
            rms = root_mean_squares(away)
            excess = rms / self._allowed if self._allowed > 0.0 else np.full(len(rms), np.inf)
            if float(excess.max()) > _ROUGHLY:
                break
        return excess

    def _refusal(self, finest: EncodedOrgan) -> ToleranceTooSmall:
        """Return the error that names the smallest tolerance."""
        rms = root_mean_squares(section_distances(finest.organ, self._contours, finest.places))
        worst = int(rms.argmax())
        # Tolerances are stored in steps of 1/64, rounded down, and steps go with them.
        smallest = float(rms[worst]) * (1.0 + 2.0**-4)
        return ToleranceTooSmall(
            f"a tolerance of {self._allowed:.4g} mm cannot be kept by two degree-6 curves a "
            f"boundary: section {self._contours[worst].index} needs {smallest:.4g} mm",
            smallest,
        )

    def _cut(self) -> None:
        """Cut the organ across its axis, in frames that lie as the images do."""
        self._candidates = 2**self._depth
        finer = 1 if self._candidates + 1 >= len(self._contours) else 2
        self._samples = finer * self._candidates
        self._weights = np.full(self._samples + 1, len(self._contours) / (self._samples + 1))
        keys, samples = self._axis.keys, self._samples
        hand = self._left_handed
        upright = np.zeros((2, 2), dtype=np.int64)
        _, frames = axis_and_frames(keys, samples, 0, 0, upright, left_handed=hand)
        self._start_axis = int(np.abs(frames[0, :, 2]).argmin())
        start = self._start_axis
        points, frames = axis_and_frames(keys, samples, start, 0, upright, left_handed=hand)
        self._places = _places(self._centroids, points, frames[:, :, 2])
        at = np.asarray(np.round(self._places * samples), dtype=np.intp)
        right = np.array([contour.x_dir for contour in self._contours])
        local = np.einsum("si,sij->sj", right, frames[at])
        lean = math.atan2(float(local[:, 1].sum()), float(local[:, 0].sum()))
        angle = lean * (-1.0 if hand else 1.0)
        self._roll = round(angle * ROLLS / (2.0 * math.pi)) % ROLLS
        points, frames = axis_and_frames(
            keys, samples, start, self._roll, upright, left_handed=hand
        )
        for end, contour in ((0, self._contours[0]), (-1, self._contours[-1])):
            lean_x, lean_y, onwards = contour.normal @ frames[end]
            upright[end] = np.round(
                np.array([lean_x, lean_y]) / max(float(onwards), _STEEPEST) * TILTS
            ).astype(np.int64)
        self._tilts = upright
        points, frames = axis_and_frames(
            keys, samples, start, self._roll, upright, left_handed=hand
        )
        self._places = _places(self._centroids, points, frames[:, :, 2])
        numbers = np.interp(
            np.linspace(0.0, 1.0, samples + 1), self._places, np.arange(len(self._places))
        )
        far = 4.0 * self._radius
        walls: list[NDArray[np.float64]] = []
        for loft in self._lofts:
            longer = loft.extended(-far * frames[0, :, 2], far * frames[-1, :, 2])
            outlines = np.empty((samples + 1, LOFT_POINTS, 2))
            for place, (point, frame) in enumerate(zip(points, frames, strict=True)):
                ring = longer.cut(point, frame[:, 2], numbers[place] + 1.0)
                outlines[place] = (ring - point) @ frame[:, :2]
            walls.append(outlines)
        self._outlines = Outlines(walls[0], walls[1] if len(walls) > 1 else None)
        self._encoder = SectionEncoder(self._outlines, self._candidates)


def _places(
    centroids: NDArray[np.float64], points: NDArray[np.float64], tangents: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return where along the axis the centroids are, from 0 to 1, growing."""
    last = len(points) - 1
    window = 8 + 4 * (last // len(centroids) + 1)
    piece = float(np.linalg.norm(np.diff(points, axis=0), axis=1).mean())
    places = np.empty(len(centroids))
    near = 0
    for number, centroid in enumerate(centroids):
        start = max(0, near - window)
        around = points[start : near + window + 1] - centroid
        near = start + int((around * around).sum(axis=1).argmin())
        places[number] = near + float((centroid - points[near]) @ tangents[near]) / piece
    return np.clip(np.maximum.accumulate(places) / last, 0.0, 1.0)
