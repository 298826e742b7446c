"""A tear part of the way through a tube's wall, and what it leaves of the beam there.

It is the tear of `physics.tear_growth`: a straight front at a depth s of the section's height h,
beyond which a ligament bears, as compliant over the length l(s) as a crack. Here its compliance is
spread over `LENGTH` h, the longest that l gets, half of it to each side as far as there is tube: an
element of which a part p lies in there has the compliance, at small strains,

    S = (1 - r) S_whole + r S_ligament,   r = p l(s) / (LENGTH h),

S_ligament about the tube's axis, from which the ligament's centroid lies off by e: in axial strain
and bending that opens the tear [1/A' + e^2/I', e/I'; e/I', 1/I'] / E. What has this S is again a
section whose centroid lies off the axis, of which `kernels` know. The elements' frames are turned
so that up is the side that is torn. In a section that is not round the product of inertia in that
frame is left out, and as much taken off both second moments: a tear never makes energy.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physics.ligament_section import LigamentSection, ligament
from physics.section import Ring
from physics.tear_growth import weak_length

Floats = NDArray[np.float64]

LENGTH = 4.0 - 2.0 * math.sqrt(3.0)
"""Longest that `weak_length` gets, in heights of the section."""


@dataclass(frozen=True, slots=True)
class Weak:
    """An element's section where a tear weakens it: in the frame whose up is the torn side."""

    stiffness: Floats  # (6,) as of `SpaceBeam`, about its own centroid
    off: float  # of its centroid from the axis, away from the torn side, mm
    reaches: tuple[float, float]  # factors of distances of fibres where it bends up and across


@dataclass(frozen=True, slots=True)
class Nick:
    """A tear part of the way through a tube's wall."""

    tube: str
    station: float  # mm from the tube's first end
    side: tuple[float, float]  # unit vector, up and along y of the tube: where it began
    depth: float  # of the height
    height: float  # of the section, mm
    section: Ring  # that stands for the whole section

    @classmethod
    def of(
        cls, tube: str, station: float, side: tuple[float, float], depth: float, whole: Floats,
        modulus: float,
    ) -> "Nick":  # fmt: skip
        """Return a tear of a section of (6,) stiffnesses."""
        bending = _turned(float(whole[4]), float(whole[5]), side)[0]
        ring = Ring(float(whole[0]) / modulus, bending / modulus)
        return cls(tube, station, side, depth, ring.height, ring)

    @property
    def left(self) -> LigamentSection:
        """What bears."""
        return ligament(self.section, self.depth)

    @property
    def reach(self) -> float:
        """How far to each side it weakens the tube, mm."""
        return 0.5 * LENGTH * self.height

    def weak(self, whole: Floats, first: float, last: float) -> Weak | None:
        """Return the section of an element from one station to another, of (6,) stiffnesses."""
        low, high = max(first, self.station - self.reach), min(last, self.station + self.reach)
        if low >= high:
            return None
        left, ring = self.left, self.section
        fraction = (high - low) / (last - first)
        fraction *= weak_length(self.height, self.depth) / (2.0 * self.reach)
        area, up = left.area / ring.area, left.second_moment / ring.second_moment
        across = left.across / ring.second_moment
        e, shift = float(whole[0]), left.shift
        opening, sideways = _turned(float(whole[4]), float(whole[5]), self.side)
        shears = _turned(float(whole[2]), float(whole[1]), self.side)
        # Of axial strain and opening, with the ligament about the axis.
        both = fraction * shift / (up * opening)
        bent = (1.0 - fraction) / opening + fraction / (up * opening)
        axial = (1.0 - fraction) / e + fraction / (area * e) + shift * both
        stiff = np.array(
            [
                1.0 / (axial - both * both / bent),
                _softer(shears[1], area, fraction),
                _softer(shears[0], area, fraction),
                _softer(float(whole[3]), 0.5 * (up + across), fraction),
                1.0 / bent,
                _softer(sideways, across, fraction),
            ]
        )
        reaches = [
            math.sqrt(float(stiff[bend] / stiff[0]) * e / float(whole[bend])) for bend in (4, 5)
        ]
        return Weak(stiff, both / bent, (reaches[0], reaches[1]))

    def turned(self, across: float, up: float) -> tuple[float, float]:
        """Return a vector of the tube's section in the tear's frame."""
        cos, sin = self.side
        return cos * across - sin * up, sin * across + cos * up

    def whole(self, up: float, across: float) -> tuple[float, float]:
        """Return two section moduli of the whole section in the tear's frame."""
        cos, sin = self.side
        return cos * cos * up + sin * sin * across, sin * sin * up + cos * cos * across

    def back(self, opening: Floats, sideways: Floats) -> tuple[Floats, Floats]:
        """Return what bends up and across, of what opens a tear and what bends it sideways."""
        cos, sin = self.side
        return cos * opening + sin * sideways, cos * sideways - sin * opening

    @property
    def spin(self) -> Floats:
        """(4,) the quaternion from the tube's frame to the tear's own."""
        cos, sin = self.side
        half = math.sqrt(0.5 * (1.0 + abs(cos)))
        other = 0.5 * sin / half
        a, b = (half, other) if cos >= 0.0 else (abs(other), math.copysign(half, sin))
        return np.array([a, -b, 0.0, 0.0])


def _softer(whole: float, stiffness_left: float, fraction: float) -> float:
    """Return a stiffness of which so much is left in a part of the length."""
    return whole / (1.0 - fraction + fraction / stiffness_left)


def _turned(up: float, across: float, side: tuple[float, float]) -> tuple[float, float]:
    """Return two principal stiffnesses in a frame whose up is a side, less what couples both."""
    cos, sin = side
    lost = abs(sin * cos * (up - across))
    return cos * cos * up + sin * sin * across - lost, sin * sin * up + cos * cos * across - lost
