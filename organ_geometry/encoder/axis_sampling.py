"""An organ's contours sampled across its axis, in frames that lie as the images do.

For one quantised axis this finds what does not depend on the sections' integers:

    frames    x_dir, y_dir and normal along the axis, from integers alone: the start axis, the roll
              that turns x_dir to the images' columns (the mean angle of all of them, by the sum of
              their unit vectors), and tilts that lean both end sections into their images' planes
    places    where along the axis each imaged section's centroid is
    outlines  the contours cut at even places: lofts through them, carried on beyond both ends, met
              by the planes of the frames. Key sections are fitted to these
    edges     every edge point in the section (piece of the axis, place across it) that it lies in.
              Distances are measured with these, and so depend on the axis too

The frames are those of a reader, by the same operations on the same integers, so that distances
in them are a reader's too.
"""

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from organ_geometry.contours.contour import ContourLoft, SectionContour
from organ_geometry.curves.half_curves import HALF_WIDTH, closed_outlines
from organ_geometry.curves.key_blend import KeyBlend
from organ_geometry.curves.outline_distance import polygon_distances
from organ_geometry.encoder.axis_encoder import QuantisedAxis
from organ_geometry.encoder.jacobian import EdgeJacobian
from organ_geometry.encoder.section_encoder import (
    Outlines,
    SectionEncoder,
    extents,
    fitted_signals,
)
from organ_geometry.encoder.settings import EncoderSettings
from organ_geometry.organ_file.coefficients import signals_to_rows
from organ_geometry.organ_file.organ_code import (
    COARSEST_TILTS,
    ROLLS,
    TURNS,
    axis_and_frames,
    axis_pieces,
    leans_of,
)
from organ_geometry.surface_distance import LocatedPoints


class AxisSampling:
    """An organ's contours sampled across one axis."""

    def __init__(
        self,
        contours: Sequence[SectionContour],  # S sections
        lofts: Sequence[ContourLoft],
        centroids: NDArray[np.float64],  # (S, 3) mm
        axis: QuantisedAxis,
        depth: int,  # 2^depth pieces between candidates for key sections
        far: float,  # How far the lofts are carried on beyond both ends, mm
        turn: int = 0,  # How far half-curves are turned in their sections, as in `OrganCode`
        *,
        settings: EncoderSettings,
        left_handed: bool,
        tilt_scale: int = 3,  # Step of the end sections' tilts, see `leans_of`
        frames_from: "AxisSampling | None" = None,
    ) -> None:
        # `frames_from` is a sampling of some of the contours across this axis: an encoding of the
        # sample is evaluated in its frames and at its candidates, and the depth then only says how
        # many outlines there are. One loft goes through each wall's contours.
        self.axis, keys = axis, axis.keys
        self._settings = settings
        self.turn = turn if frames_from is None else frames_from.turn
        # Number of pieces between candidates.
        self.candidates = 2**depth if frames_from is None else frames_from.candidates
        # Number of pieces between outlines, a multiple of that.
        # Twice as many outlines as candidates where sections are closer together than those, so
        # that no section falls between outlines.
        self.samples = (1 if 2**depth + 1 >= len(contours) else 2) * 2**depth
        samples, hand = self.samples, left_handed
        self.tilt_scale = tilt_scale
        if frames_from is None:
            self._fit_frames(contours, centroids, left_handed)
        else:
            self.start_axis, self.roll, self.tilts = (
                frames_from.start_axis,
                frames_from.roll,
                frames_from.tilts,
            )
            self.tilt_scale = frames_from.tilt_scale
        points, frames = axis_and_frames(
            keys, samples, self.start_axis, self.roll, self._leans, self.turn, left_handed=hand
        )
        # (S,) from 0 to 1 along the axis.
        self.places = _places(centroids, points, frames[:, :, 2])
        self._lofts, self._far = lofts, far
        self._points, self._frames = points, frames
        self._locate_points(contours, keys, left_handed=hand, hollow=len(lofts) > 1)

    @property
    def depth(self) -> int:
        """How often the axis is halved for the candidates for key sections."""
        return self.candidates.bit_length() - 1

    @cached_property
    def outlines(self) -> Outlines:
        """The contours at equal distances along the axis."""
        points, frames = self._points, self._frames
        numbers = np.interp(
            np.linspace(0.0, 1.0, len(points)), self.places, np.arange(len(self.places))
        )
        normals = frames[:, :, 2]
        # `numbers` say between which contours a plane is; one is added for the loft's first shift.
        walls: list[NDArray[np.float64]] = []
        for loft in self._lofts:
            longer = loft.extended(-self._far * normals[0], self._far * normals[-1])
            rings = longer.cuts(points, normals, numbers + 1.0) - points[:, np.newaxis, :]
            walls.append(rings @ frames[:, :, :2])
        return Outlines(walls[0], walls[1] if len(walls) > 1 else None)

    @cached_property
    def encoder(self) -> SectionEncoder:
        """The encoder of the outlines; its fits are made once for all steps."""
        return SectionEncoder(self.outlines, self.candidates, self._settings)

    def _fit_frames(
        self,
        contours: Sequence[SectionContour],
        centroids: NDArray[np.float64],
        left_handed: bool,
    ) -> None:
        """Fit roll and tilts: frames lie as the images do, at the ends in their planes."""
        # x_dir starts from the axis of space most nearly across the first tangent.
        keys, samples, hand = self.axis.keys, self.samples, left_handed
        upright, tilts = np.zeros((2, 2)), COARSEST_TILTS << self.tilt_scale
        self.tilts = np.zeros((2, 2), dtype=np.int64)
        _, frames = axis_and_frames(keys, samples, 0, 0, upright, left_handed=hand)
        start = self.start_axis = int(np.abs(frames[0, :, 2]).argmin())
        points, frames = axis_and_frames(keys, samples, start, 0, upright, left_handed=hand)
        at = np.asarray(
            np.round(_places(centroids, points, frames[:, :, 2]) * samples), dtype=np.intp
        )
        right = np.array([contour.x_dir for contour in contours])
        local = np.einsum("si,sij->sj", right, frames[at])
        angle = math.atan2(float(local[:, 1].sum()), float(local[:, 0].sum()))
        # The roll turns about the tangent; in a left-handed frame that is away from y.
        angle *= -1.0 if hand else 1.0
        self.roll = round(angle * ROLLS / (2.0 * math.pi)) % ROLLS
        points, frames = axis_and_frames(keys, samples, start, self.roll, upright, left_handed=hand)
        if not self._settings.tilts:
            return
        for end, contour in ((0, contours[0]), (-1, contours[-1])):
            lean_x, lean_y, onwards = contour.normal @ frames[end]
            # Tangents of the angles, from the image's normal. An image that is nearly along the
            # axis says little of how its section leans: a quarter bounds the tangent to 4.
            self.tilts[end] = np.round(
                np.array([lean_x, lean_y]) / max(float(onwards), 0.25) * tilts
            ).astype(np.int64)

    def _locate_points(
        self,
        contours: Sequence[SectionContour],
        keys: NDArray[np.float64],
        *,
        left_handed: bool,
        hollow: bool,
    ) -> None:
        """Find the piece and the place of each edge point across the axis of a reader."""
        # Number of pieces of the axis that a reader will have.
        self.pieces = axis_pieces(self.candidates)
        axis, frames = axis_and_frames(
            keys, self.pieces, self.start_axis, self.roll, self._leans, self.turn,
            left_handed=left_handed,
        )  # fmt: skip
        # For each wall its edge points in their sections, and the (N,) slices that they are of.
        self.edges: list[tuple[LocatedPoints, NDArray[np.intp]]] = []
        for wall in ("outer", "lumen") if hollow else ("outer",):
            edges = [getattr(contour, wall) for contour in contours]
            section = np.repeat(np.arange(len(edges)), [len(edge) for edge in edges])
            # Points are sought from their section's centroid on, by pieces nearby.
            near = self.places[section] * self.pieces
            located = LocatedPoints.along(np.concatenate(edges), near, axis, frames)
            self.edges.append((located, section))

    @property
    def _leans(self) -> NDArray[np.float64]:
        return leans_of(self.tilts, self.tilt_scale)

    def jacobian(self) -> EdgeJacobian:
        """Return how edge points' distances change with integers about this axis."""
        return EdgeJacobian.of(
            self.edges, len(self.places), self.pieces, self.candidates, self._settings.points
        )  # fmt: skip

    def section_rms(
        self, keys: NDArray[np.intp], walls: Sequence[NDArray[np.float64]]
    ) -> NDArray[np.float64] | None:
        """Return the RMS distance of each section's edge points to decoded signals."""
        # (K,) keys and each wall's (K, 16) coefficients, mm, give (S,) mm; None where rounding left
        # a section no width.
        blend = KeyBlend.at(np.arange(self.pieces + 1), keys * (self.pieces // self.candidates))
        squares, counts = np.zeros(len(self.places)), np.zeros(len(self.places))
        for (located, section), signals in zip(self.edges, walls, strict=True):
            rows = blend.of(signals_to_rows(signals))
            if (rows[:, HALF_WIDTH] <= 0.0).any():
                return None
            away = located.distances(rows)
            squares += np.bincount(section, away * away, len(squares))
            counts += np.bincount(section, minlength=len(squares))
        return np.sqrt(squares / counts)


def best_turn(outlines: NDArray[np.float64]) -> tuple[int, float]:
    """Return the rotation of half-curves of least error, and its error over that of none."""
    # Half-curves y(x) follow flat sides best and upright ones worst, so that an oblong section
    # gains by being turned. 32 outlines and every second rotation are enough: the error has one
    # minimum.
    some = outlines[:: max(1, len(outlines) // 32)]
    errors = np.empty(TURNS // 2)
    for number in range(len(errors)):
        angle = number * 2 * math.pi / TURNS
        turned = some @ np.array(
            [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
        )
        corners = closed_outlines(signals_to_rows(fitted_signals(turned, extents(turned))), 64)
        errors[number] = sum(
            float((polygon_distances(ring[::2], near) ** 2).sum())
            for ring, near in zip(turned, corners, strict=True)
        )
    best = int(errors.argmin())
    return best * 2, float(errors[best] / max(errors[0], np.finfo(np.float64).tiny))


def _places(
    centroids: NDArray[np.float64], points: NDArray[np.float64], tangents: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return where along the axis the centroids are, from 0 to 1, growing."""
    # The nearest axis point in a window from the one before on, which an axis that comes back to
    # itself cannot mislead; then to first order along the tangent there.
    last = len(points) - 1
    window = 8 + 4 * (last // len(centroids) + 1)
    piece = float(np.linalg.norm(np.diff(points, axis=0), axis=1).mean())
    places = np.empty(len(centroids))
    near = 0
    for number, centroid in enumerate(centroids):
        start = max(0, near - window)
        around = points[start : near + window + 1] - centroid
        near = start + int(np.einsum("ij,ij->i", around, around).argmin())
        places[number] = near + float((centroid - points[near]) @ tangents[near]) / piece
    return np.clip(np.maximum.accumulate(places) / last, 0.0, 1.0)
