"""How instruments deform the skin where they touch it. Drawn, not computed: a beam has no wall.

The clamps flatten the section between their jaws, with a displacement that is computed once. At
each frame the hook's wire presses a groove into the wall, as deep as the wire has sunk in, with the
wall raised a little on both sides. Both darken the skin beside them. The displacements are smooth
functions, chosen by eye, of the place in the frame of the clamps or of the hook.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from app.simulation import Dissection
from app.trainer.stage.appearance import appearance_of, drawn_radius
from app.trainer.stage.clamps import STUB
from app.trainer.stage.hook import TIP_ANGLE, bend_radius, wire_radius
from kernel_cache import njit
from organ_geometry.mesh import Skin
from physics.bed import kernels

BITE = 0.62
"""Height of a duct's section between the jaws over that at rest."""
# Relative growth of the section's width there.
SPREAD = 0.13
JAW_REACH = 0.4
"""Length of the axis between the jaws, in radii."""
# Length of the axis over which the flattening fades, in radii.
JAW_FADE = 0.85
# Depth of the wire in the wall, in radii.
SINK_AT_REST, SINK_AT_BREAK = 0.02, 0.20
# Light that is left on the wall in the angle below a jaw.
JAW_SHADE = 0.62
# Half the width of a tear that begins, and how much wider it gets as it goes through, in radii.
GAP, GAPES = 0.25, 0.5
RAW = 0.85
"""Light on the face of a tear."""
# Largest gap between a clamp and the wall's end that a stub bridges, in radii.
STUB_SLACK = 0.3
# Orders of waves around a ring over which the smoothing fades them out.
SMOOTHED_ORDERS = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class HookPlace:
    """Where the hook holds the duct, in the organ's coordinates."""

    center: NDArray[np.float64]  # (3,) centre of the wire's bend, mm
    # (3, 3) orthonormal columns: along the duct, lateral, along the pull
    frame: NDArray[np.float64]
    radius: float  # of the duct that the bend is made for, mm


def sink(ratio: float, radius: float) -> float:
    """Return the depth of the wire in the wall, mm, at a stress of `ratio` thresholds."""
    return radius * (SINK_AT_REST + (SINK_AT_BREAK - SINK_AT_REST) * min(max(ratio, 0.0), 1.0))


class Contact:
    """A skin as it is drawn: smooth, of the solved thickness, and deformed by clamps and hook.

    Parameters
    ----------
    skin, axis
        The skin, and (V, 3) point of the axis at each vertex's station, mm.
    frame
        (3, 3) orthonormal columns: along the duct, lateral, along the pull.
    clamps, radius
        Stations of the two clamps and radius of the duct that is drawn, mm.
    thickness, bite
        Its thickness over the skin's; height of its section between the jaws over that at rest.
    """

    def __init__(
        self,
        skin: Skin,
        axis: NDArray[np.float64],
        frame: NDArray[np.float64],
        clamps: tuple[float, float],
        radius: float,
        *,
        thickness: float = 1.0,
        bite: float = BITE,
    ) -> None:
        self.skin, self.frame, self._radius = skin, frame, radius
        self._smoothing = _ring_smoothing(skin.sides, thickness)
        self.vertices = skin.vertices.copy()  # (V, 3) mm; overwritten by each `mark`
        # (V,) light past the instruments, 0 to 1; below zero where the wall is torn
        self.shade = np.ones(len(skin.vertices), np.float32)
        self._smooth(skin.vertices)

        inside = np.minimum(skin.stations - clamps[0], clamps[1] - skin.stations)
        held = np.maximum(inside - JAW_REACH * radius, 0.0) / (JAW_FADE * radius)
        bitten = np.exp(-(held**2))
        offsets = self.vertices - axis
        lateral, up = frame[:, 1], frame[:, 2]
        height = offsets @ up
        self._up, self._aside = skin.grid(height), skin.grid(offsets @ lateral)
        self._places = skin.grid(skin.stations).mean(axis=1) - clamps[0]
        # Each half of each ring relative to its own height, so that it lies against its jaw.
        top, bottom = _ring_reach(height, skin)
        own = np.maximum(np.where(height > 0.0, top, bottom), 1e-9)
        fraction = np.clip(np.abs(height) / own, 0.0, 1.0)
        flat = np.sign(height) * bite * radius * (1.0 - (1.0 - fraction) ** 3.5)
        squeezed = (bitten * (flat - height))[:, None] * up
        wide = (
            SPREAD * (1.0 - bite) / (1.0 - BITE) * (bitten * (offsets @ lateral))[:, None] * lateral
        )
        self._pinch = (squeezed + wide).astype(np.float32)
        covered = np.exp(-((np.maximum(inside - 0.45 * radius, 0.0) / (0.7 * radius)) ** 2))
        self._jaw_shade = (1.0 - (1.0 - JAW_SHADE) * covered).astype(np.float32)
        self.stub_shade = JAW_SHADE  # light that reaches the stubs, 0 to 1
        self.mark(skin.vertices)
        stations = skin.grid(skin.stations)
        # (S, sides, 3) rings, mm, that carry the outer wall on into the first and into the last
        # clamp, in the order of stations; none where the wall does not end at the clamp
        self.stubs = (
            self._stub(0, 1, clamps[0] - float(stations[0].mean())),
            self._stub(-1, -2, float(stations[-1].mean()) - clamps[1])[::-1],
        )

    @classmethod
    def of(cls, dissection: Dissection, skin: Skin, *, divided: bool = False) -> "Contact":
        """Return a dissection's skin as it is drawn; no clamp holds the end of a divided one."""
        first, last = dissection.clamps
        radius = drawn_radius(dissection)
        return cls(
            skin,
            dissection.organ.axis_at(skin.stations),
            dissection.frame,
            (first, math.inf if divided else last),
            radius,
            thickness=radius / dissection.organ.mean_radius,
            bite=appearance_of(dissection.preset).bite,
        )

    def _stub(self, end: int, inner: int, beyond: float) -> NDArray[np.float32]:
        """Return the rings of the tissue in a clamp, from its far end to the wall."""
        rings = self.skin.grid(self.vertices)
        if abs(beyond) > STUB_SLACK * self._radius:
            return np.empty((0, self.skin.sides, 3), np.float32)
        middle = rings[end].mean(axis=0)
        away = middle - rings[inner].mean(axis=0)
        away /= np.linalg.norm(away)
        offsets = rings[end] - middle
        lateral, up = self.frame[:, 1], self.frame[:, 2]
        stub = [
            middle
            + reach * self._radius * away
            + (wide * (offsets @ lateral))[:, None] * lateral
            + (high * (offsets @ up))[:, None] * up
            for reach, wide, high in STUB[::-1]
        ]
        return np.array(stub, np.float32)

    def _smooth(self, vertices: NDArray[np.float32]) -> None:
        """Write `vertices` as a smooth version of a deformed skin's."""
        count = self.skin.wall_size * (2 if self.skin.hollow else 1)
        rings = vertices[:count].reshape(-1, self.skin.sides, 3)
        np.matmul(self._smoothing, rings, out=self.vertices[:count].reshape(rings.shape))
        self.vertices[count:] = vertices[count:]

    def mark(self, vertices: NDArray[np.float32], *hooks: HookPlace | None) -> None:
        """Write `vertices` and `shade` for a deformed skin, with the hooks that hold the duct."""
        self._smooth(vertices)
        self.vertices += self._pinch
        self.shade[:] = self._jaw_shade
        for hook in hooks:
            if hook is not None:
                _press(
                    self.vertices,
                    self.shade,
                    hook.center,
                    hook.frame,
                    bend_radius(hook.radius),
                    wire_radius(hook.radius),
                )

    def open_nick(self, station: float, side: tuple[float, float], depth: float) -> None:
        """Open marked vertices where the wall is torn part of the way (`NickReading`).

        The wall goes down to the tear's front and has no skin there: its `shade` is below zero.
        """
        wide = self._radius * (GAP + GAPES * depth)
        apart = np.abs(self._places - station)
        near = (apart < wide) | (apart == apart.min())
        across = side[0] * self._up[near] + side[1] * self._aside[near]
        top = across.max(axis=1, keepdims=True)
        beyond = across - (1.0 - 2.0 * depth) * top
        # As wide at the skin as it is open there, and closed at its front.
        closes = 1.0 - (apart[near, None] / wide) ** 2
        torn = np.clip(np.minimum(beyond, closes * beyond), 0.0, None)
        rings, shades = self.skin.grid(self.vertices), self.skin.grid(self.shade)
        placed = rings[near]
        out = placed[np.arange(len(placed)), across.argmax(axis=1)] - placed.mean(axis=1)
        out /= np.linalg.norm(out, axis=1, keepdims=True)
        rings[near] = placed - torn[..., None] * out[:, None]
        shades[near] = np.where(torn > 0.0, -RAW * np.abs(shades[near]), shades[near])

    def press_rods(self, rods: NDArray[np.float64], origin: NDArray[np.float64]) -> None:
        """Press marked vertices in by rods, as `physics.bed` has them, in the frame of `origin`."""
        _press_rods(self.vertices, self.shade, rods, origin, self.frame)


@lru_cache(maxsize=16)
def _ring_smoothing(sides: int, thickness: float) -> NDArray[np.float32]:
    """Return the (sides, sides) matrix that smooths a ring's points and scales its thickness."""
    # A section is stored as two half-curves, which meet at a corner that tissue does not have. A
    # low-pass filter over the ring, written as a circulant matrix, rounds it: waves of up to two
    # periods around the ring are kept, shorter ones fade out. All but the mean are scaled by the
    # thickness.
    orders = np.minimum(np.arange(sides), sides - np.arange(sides))
    kept = thickness * np.exp(-((np.maximum(orders - 2, 0) / SMOOTHED_ORDERS) ** 2))
    kept[0] = 1.0
    row = np.fft.ifft(kept).real
    steps = np.arange(sides)
    return row[(steps[:, None] - steps) % sides].astype(np.float32)


def _ring_reach(
    height: NDArray[np.float64], skin: Skin
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how far the outer wall's ring at each vertex reaches up and down, mm."""
    rings = skin.grid(height)
    repeats = 2 if skin.hollow else 1
    rest = len(height) - repeats * skin.wall_size  # a solid skin's two end points

    def spread(reach: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.concatenate([np.tile(np.repeat(reach, skin.sides), repeats), np.ones(rest)])

    return spread(rings.max(axis=1)), spread(-rings.min(axis=1))


@njit(cache=True, nogil=True)
def _press(
    vertices: NDArray[np.float32],
    shade: NDArray[np.float32],
    center: NDArray[np.float64],
    frame: NDArray[np.float64],
    bend: float,
    wire: float,
) -> None:
    reach = 5.0 * wire
    for v in range(vertices.shape[0]):
        dx = vertices[v, 0] - center[0]
        dy = vertices[v, 1] - center[1]
        dz = vertices[v, 2] - center[2]
        x = dx * frame[0, 0] + dy * frame[1, 0] + dz * frame[2, 0]
        if abs(x) > reach:
            continue
        y = dx * frame[0, 1] + dy * frame[1, 1] + dz * frame[2, 1]
        z = dx * frame[0, 2] + dy * frame[1, 2] + dz * frame[2, 2]
        radius = np.sqrt(y * y + z * z)
        if radius < 1e-6:
            continue
        # Angle around the duct as the wire runs: from the viewer's side, below, to the far side.
        # Beyond the wire's ends `along_wire` fades the groove out.
        angle = np.arctan2(-z, -y)
        if angle < -0.5 * np.pi:
            angle += 2.0 * np.pi
        along_wire = min(
            1.0, max(0.0, (angle - TIP_ANGLE + 0.1) / 0.35), max(0.0, (np.pi + 0.45 - angle) / 0.45)
        )
        if along_wire <= 0.0:
            continue
        groove = bend - wire + x * x / (3.2 * wire)
        # The wall goes no farther out than the groove: a smooth minimum of both radii, as wide as
        # half a wire's radius, and then a bulge on each side, higher the deeper the wire.
        soft = 0.5 * wire
        mixed = max(soft - abs(radius - groove), 0.0) / soft
        pressed = min(radius, groove) - 0.25 * soft * mixed * mixed
        depth = max(radius - (bend - wire), 0.0)
        beside = (abs(x) - 2.3 * wire) / wire
        pressed += 0.16 * depth * np.exp(-beside * beside)
        fraction = 1.0 + along_wire * (pressed / radius - 1.0)
        moved_y, moved_z = (fraction - 1.0) * y, (fraction - 1.0) * z
        for i in range(3):
            vertices[v, i] += moved_y * frame[i, 1] + moved_z * frame[i, 2]
        apart = radius * fraction - bend
        gap = max(np.sqrt(x * x + apart * apart) - wire, 0.0) / (1.25 * wire)
        shade[v] *= 1.0 - 0.62 * along_wire * np.exp(-gap * gap)


@njit(cache=True, nogil=True)
def _press_rods(
    vertices: NDArray[np.float32],
    shade: NDArray[np.float32],
    rods: NDArray[np.float64],
    origin: NDArray[np.float64],
    frame: NDArray[np.float64],
) -> None:
    tip, shaft, place, out = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for m in range(rods.shape[0]):
        if rods[m, kernels.IN_USE] == 0.0:
            continue
        radius = rods[m, kernels.RADIUS]
        for i in range(3):
            tip[i], shaft[i] = origin[i], 0.0
            for j in range(3):
                tip[i] += frame[i, j] * rods[m, kernels.TIP + j]
                shaft[i] += frame[i, j] * rods[m, kernels.SHAFT + j]
        for v in range(vertices.shape[0]):
            along = 0.0
            for i in range(3):
                place[i] = vertices[v, i] - tip[i]
                along += place[i] * shaft[i]
            along = max(along, 0.0)
            square = 0.0
            for i in range(3):
                out[i] = place[i] - along * shaft[i]
                square += out[i] * out[i]
            if square > 9.0 * radius * radius or square < 1e-9:
                continue
            apart = np.sqrt(square)
            if apart < radius:
                for i in range(3):
                    vertices[v, i] += out[i] * (radius / apart - 1.0)
            gap = max(apart - radius, 0.0) / (0.8 * radius)
            shade[v] *= 1.0 - 0.55 * np.exp(-gap * gap)
