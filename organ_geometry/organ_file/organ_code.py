"""An organ in integers, as its file holds it, and the organ that they give.

    tolerance    a floating-point number of 6 binary digits, from 2^-32 mm on
    steps        multiples of the tolerance, four to an octave: one of the axis, one of the sections
    axis         natural cubic spline through 2^La + 1 keys: two ends, and bends between them, each
                 an offset from what the coarser keys foretell, in the frame of the chord
    frames       rotation-minimising from the first point on (`least_turning`), which stands by an
                 axis of space, turned by the roll; near both ends the sections lean by tilts
    sections     16 shape coefficients at K key sections of 2^L + 1 candidates (`coefficients`),
                 as residuals in bisection order (`key_order`), blended between

All of it is decoded with the same operations in the same order everywhere: the encoder evaluates
the very organ that a reader will have. docs/organ-format.md specifies it for other readers.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.axis_curve import even_axis, key_depth, least_turning, refinement
from organ_geometry.curves.ordered_product import ordered_product
from organ_geometry.organ import Organ
from organ_geometry.organ_file.coefficients import ASIDE, SIGNALS, WIDTH, signals_to_rows
from organ_geometry.organ_file.key_order import differences_to_values

# Parts of a full turn by which x_dir is turned at the first point: a byte. Sections are fitted in
# the turned frame, so that nothing is lost by rounding it by up to 0.7 degrees.
ROLLS = 256
TURNS = 32
"""Parts of half a turn by which the sections' half-curves may be turned in them."""
# Tilts are tangents in steps of 1/8, 1/16, 1/32 or 1/64.
COARSEST_TILTS = 8
# The axis may be off along its chord by 2^2 times what it may be off across it.
_ALONG_STEPS = 2
# Share of the length over which the sections turn from an end's plane to those across the axis.
TILTED_FRACTION = 0.25
# Width and middle are kept in steps twice as long: half-curves take up what they leave.
SPAN_STEPS = 2
# 129 keys of the axis and 4097 candidates for key sections at most: three bits and four say which.
LARGEST_AXIS_DEPTH = 7
LARGEST_KEY_DEPTH = 12
# A reader's axis has at least so many pieces of equal length: chords of a quarter turn over half of
# them are shorter than their arcs by less than 1e-5.
_FEWEST_AXIS_PIECES = 256
# Parts of an octave, and how many octaves below 1 mm tolerances begin.
_TOLERANCE_STEPS = 64
_TOLERANCE_BIAS = 32


@dataclass(frozen=True, slots=True, eq=False)
class OrganCode:
    """An organ as integers."""

    units: str
    left_handed: bool  # Whether x_dir, y_dir and the way along the axis are a left-handed frame
    tolerance: int  # See `tolerance_of`
    axis_scale: int  # Step of the axis in tolerances, see `scale_of`
    start_axis: int  # 0, 1 or 2: the axis of space from which x_dir is turned at the first point
    roll: int  # That turn, in 1/256
    turn: int  # How far the half-curves' x is turned from there towards y, in 1/32 of half a turn
    tilt_scale: int  # Step of the tilts, see `leans_of`
    # (2, 2) how far the normals of the first and the last section lean out of the axis, along x_dir
    # and y_dir there, in steps.
    tilts: NDArray[np.int64]
    ends: NDArray[np.int64]  # (2, 3) first end of the axis, and from there to the last, in steps
    # (2^La + 1, 3) stored differences of the axis's keys, in steps along the chord and two
    # directions across it; the rows of the ends are zero.
    bends: NDArray[np.int64]
    section_scale: int  # Step of shape coefficients, see `scale_of`
    candidates: int  # Number of equal pieces along the axis at whose ends key sections can be, 2^L
    # (K,) which ends of pieces are key sections, growing from 0 to the number of pieces.
    keys: NDArray[np.intp]
    # (K, 16) stored differences of the outer boundary's shape coefficients, in steps, and of the
    # lumen's less the outer's, which a wall of even thickness leaves nearly constant.
    outer: NDArray[np.int64]
    lumen: NDArray[np.int64] | None

    @property
    def axis_step(self) -> float:
        """Step in which the axis is kept, mm."""
        return tolerance_of(self.tolerance) * scale_of(self.axis_scale)

    @property
    def section_step(self) -> float:
        """Step in which the sections' shape coefficients are kept, mm."""
        return tolerance_of(self.tolerance) * scale_of(self.section_scale)

    def signals(self) -> list[NDArray[np.float64]]:
        """Return the (K, 16) shape coefficients at the key sections, mm, by wall."""
        steps = signal_steps(self.section_step)
        values = differences_to_values(self.keys)
        outer = ordered_product(values, self.outer) * steps
        if self.lumen is None:
            return [outer]
        return [outer, outer + ordered_product(values, self.lumen) * steps]

    def organ(self, name: str = "", encoded: bytes = b"") -> Organ:
        """Return the organ."""
        tolerance = tolerance_of(self.tolerance)
        pieces = axis_pieces(self.candidates)
        points, frames = axis_and_frames(
            axis_keys(self.ends, self.bends, self.axis_step),
            pieces,
            self.start_axis,
            self.roll,
            leans_of(self.tilts, self.tilt_scale),
            self.turn,
            left_handed=self.left_handed,
        )
        walls = [signals_to_rows(signals) for signals in self.signals()]
        return Organ(
            axis=points,
            frames=frames,
            keys=self.keys * (pieces // self.candidates),
            outer=walls[0],
            lumen=walls[1] if len(walls) > 1 else None,
            units=self.units,
            tolerance_mm=tolerance,
            turn=self.turn * math.pi / TURNS,
            name=name,
            encoded=encoded,
        )


def axis_pieces(candidates: int) -> int:
    """Return into how many pieces of equal length an organ's axis is divided."""
    # A multiple of the candidates, so that each of them is a point of the axis.
    return max(_FEWEST_AXIS_PIECES, 2 * candidates)


def signal_steps(step: float) -> NDArray[np.float64]:
    """Return the (16,) steps of shape coefficients, mm."""
    steps = np.full(SIGNALS, step)
    steps[[WIDTH, ASIDE]] *= SPAN_STEPS
    return steps


def tolerance_of(number: int) -> float:
    """Return a tolerance, mm, from its number n from 0 to 4095."""
    # (1 + n mod 64 / 64) 2^(n div 64 - 32)
    power, mantissa = divmod(number, _TOLERANCE_STEPS)
    return math.ldexp(1.0 + mantissa / _TOLERANCE_STEPS, power - _TOLERANCE_BIAS)


def tolerance_number(tolerance: float) -> int:
    """Return the number of the largest tolerance not above a given one, mm."""
    mantissa, power = math.frexp(max(tolerance, math.ldexp(1.0, -_TOLERANCE_BIAS)))
    number = (power - 1 + _TOLERANCE_BIAS) * _TOLERANCE_STEPS
    number += math.floor((2.0 * mantissa - 1.0) * _TOLERANCE_STEPS)
    return min(number, 64 * _TOLERANCE_STEPS - 1)


def scale_of(number: int) -> float:
    """Return a step in tolerances from its number n from 0 to 63."""
    # (4 + n mod 4) 2^(n div 4 - 16)
    power, mantissa = divmod(number, 4)
    return math.ldexp(4.0 + mantissa, power - 16)


def scale_number(scale: float) -> int:
    """Return the number of the step nearest below a scale."""
    mantissa, power = math.frexp(scale)
    number = 4 * (power + 13) + math.floor((2.0 * mantissa - 1.0) * 4.0)
    return min(max(number, 0), 63)


def leans_of(tilts: NDArray[np.int64], scale: int) -> NDArray[np.float64]:
    """Return (2, 2) tangents of the angles by which end sections lean along x_dir and y_dir."""
    return tilts / (COARSEST_TILTS << scale)


def axis_keys(
    ends: NDArray[np.int64], bends: NDArray[np.int64], step: float
) -> NDArray[np.float64]:
    """Return the (K, 3) keys of an axis, mm."""
    count = len(bends)
    first, chord = ends[0] * step, ends[1] * step
    frame = chord_frame(chord)
    straight = np.linspace(0.0, 1.0, count)[:, np.newaxis] * chord + first
    offsets = ordered_product(refinement(key_depth(count)), bends * bend_steps(step))
    return np.asarray(straight + ordered_product(offsets, frame), dtype=np.float64)


def bend_steps(step: float) -> NDArray[np.float64]:
    """Return the (3,) steps of an axis's bends, mm: along the chord and twice across it."""
    return np.array([math.ldexp(step, _ALONG_STEPS), step, step])


def chord_frame(chord: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rows along a (3,) chord, across it, and along their cross product."""
    length = math.sqrt((chord * chord).sum())
    if not length > 0.0:
        raise ValueError("the two ends of the axis must be apart, above 0 mm")
    along = chord / length
    # Across lies by the axis of space that the chord has least of; of equal ones by the first.
    unit = np.eye(3)[int(np.abs(chord).argmin())]
    across = unit - (unit * along).sum() * along
    across = across / math.sqrt((across * across).sum())
    return np.asarray(np.stack([along, across, np.cross(along, across)]), dtype=np.float64)


def axis_and_frames(
    keys: NDArray[np.float64],
    pieces: int,
    start_axis: int,
    roll: int,
    leans: NDArray[np.float64],
    turn: int = 0,
    *,
    left_handed: bool,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (N + 1, 3) points of an axis at equal arc length, mm, and frames (N + 1, 3, 3)."""
    # Columns of a frame are x_dir, y_dir and the section's normal. Roll, leans and turn are as in
    # `OrganCode`; N is the number of pieces.
    points, tangents = even_axis(np.asarray(keys, dtype=np.float64), pieces)
    unit = np.eye(3)[start_axis]
    across = unit - (unit * tangents[0]).sum() * tangents[0]
    across = across / max(math.sqrt((across * across).sum()), np.finfo(np.float64).tiny)
    side = np.cross(tangents[0], across)
    quarter, rest = divmod(roll, ROLLS // 4)
    # Quarter turns are exact, so that frames along the axes of space stay exact.
    cosine, sine = math.cos(2.0 * math.pi * rest / ROLLS), math.sin(2.0 * math.pi * rest / ROLLS)
    for _ in range(quarter):
        cosine, sine = -sine, cosine
    x_dirs = least_turning(points, tangents, cosine * across + sine * side)
    sign = -1.0 if left_handed else 1.0
    y_dirs = np.cross(tangents, x_dirs) * sign
    normals = tangents
    if leans.any():
        # The first and the last section lie as their images do, those between turn out of that.
        along = np.linspace(0.0, 1.0, pieces + 1) / TILTED_FRACTION
        for end, along_from in ((0, along), (1, along[::-1])):
            x_lean, y_lean = leans[end]
            # The lean fades out with a smooth step, 1 at the end and 0 a quarter of the way in.
            rest = np.clip(1.0 - along_from, 0.0, 1.0)
            mantissa = (rest * rest * (3.0 - 2.0 * rest))[:, np.newaxis]
            normals = normals + mantissa * (x_lean * x_dirs + y_lean * y_dirs)
        normals = normals / np.sqrt((normals * normals).sum(axis=1, keepdims=True))
        x_dirs = x_dirs - (x_dirs * normals).sum(axis=1, keepdims=True) * normals
        x_dirs = x_dirs / np.sqrt((x_dirs * x_dirs).sum(axis=1, keepdims=True))
        y_dirs = np.cross(normals, x_dirs) * sign
    if turn:
        cosine, sine = math.cos(turn * math.pi / TURNS), math.sin(turn * math.pi / TURNS)
        x_dirs, y_dirs = cosine * x_dirs + sine * y_dirs, cosine * y_dirs - sine * x_dirs
    return points, np.stack([x_dirs, y_dirs, normals], axis=2)
