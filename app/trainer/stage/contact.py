"""What instruments do to the skin where they touch it. Drawn, not computed: the beam has no wall.

The clamps flatten the section between their jaws. The hook's wire lies in a groove that is as deep
as the wire has sunk in, with the wall raised a little on both sides.
"""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from app.trainer.stage.hook import TIP_ANGLE, bend_radius, wire_radius
from organ_geometry.mesh.skin import Skin

__all__ = ["BITE", "Contact", "HookPlace"]

BITE = 0.62
"""Height of the section between the jaws, in parts of its height at rest."""
SPREAD = 0.13
"""How much wider the section gets there."""
JAW_FADE = 0.85
"""Over how much of the axis the flattening fades, in radii."""
SINK_AT_REST, SINK_AT_BREAK = 0.02, 0.20
"""How far the wire sinks into the wall, in radii."""
JAW_SHADE = 0.62
"""How dark the wall is in the angle below a jaw."""


@dataclass(frozen=True, slots=True, eq=False)
class HookPlace:
    """Where the hook holds the duct, in the organ's coordinates.

    Attributes
    ----------
    center
        (3,) centre of the wire's bend, mm.
    frame
        (3, 3) orthonormal columns: along the duct, lateral, along the pull.
    radius
        The duct's, that the bend is made for, mm.
    """

    center: NDArray[np.float64]
    frame: NDArray[np.float64]
    radius: float


def sink(share: float, radius: float) -> float:
    """Return how far the hook's wire sinks into the wall.

    Parameters
    ----------
    share
        Highest stress by the threshold; taken as 1 above that.
    radius
        Of the duct, mm.

    Returns
    -------
    float
        The distance, mm.
    """
    return radius * (SINK_AT_REST + (SINK_AT_BREAK - SINK_AT_REST) * min(max(share, 0.0), 1.0))


class Contact:
    """The marks of clamps and hook on one skin.

    Parameters
    ----------
    skin
        The skin.
    axis
        (V, 3) point of the axis at each vertex's station, mm.
    frame
        (3, 3) orthonormal columns: along the duct, lateral, along the pull.
    clamps
        Stations of the two clamps, mm.
    radius
        Of the duct, mm.

    Attributes
    ----------
    vertices
        (V, 3) the marked vertices, mm; overwritten by each `mark`.
    shade
        (V,) how much light reaches each vertex past the instruments, 0 to 1.
    """

    def __init__(
        self,
        skin: Skin,
        axis: NDArray[np.float64],
        frame: NDArray[np.float64],
        clamps: tuple[float, float],
        radius: float,
    ) -> None:
        inside = np.minimum(skin.stations - clamps[0], clamps[1] - skin.stations)
        bitten = np.exp(-((np.maximum(inside, 0.0) / (JAW_FADE * radius)) ** 2))
        offsets = skin.vertices - axis
        lateral, up = frame[:, 1], frame[:, 2]
        flat = (BITE - 1.0) * (bitten * (offsets @ up))[:, None] * up
        wide = SPREAD * (bitten * (offsets @ lateral))[:, None] * lateral
        self._pinch = (flat + wide).astype(np.float32)
        covered = np.exp(-((np.maximum(inside - 0.45 * radius, 0.0) / (0.7 * radius)) ** 2))
        self._jaw_shade = (1.0 - (1.0 - JAW_SHADE) * covered).astype(np.float32)
        self.vertices = skin.vertices.copy()
        self.shade = np.ones(len(skin.vertices), np.float32)

    def mark(self, vertices: NDArray[np.float32], hook: HookPlace | None) -> None:
        """Write `vertices` and `shade` for a deformed skin.

        Parameters
        ----------
        vertices
            (V, 3) the deformed skin's, mm.
        hook
            Where the hook holds it; None where it does not.
        """
        np.add(vertices, self._pinch, out=self.vertices)
        self.shade[:] = self._jaw_shade
        if hook is not None:
            _press(
                self.vertices,
                self.shade,
                hook.center,
                hook.frame,
                bend_radius(hook.radius),
                wire_radius(hook.radius),
            )


@numba.njit(cache=True)
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
        # From the viewer's side around below to the far side, as the wire runs.
        angle = np.arctan2(-z, -y)
        if angle < -0.5 * np.pi:
            angle += 2.0 * np.pi
        along_wire = min(
            1.0, max(0.0, (angle - TIP_ANGLE + 0.1) / 0.35), max(0.0, (np.pi + 0.45 - angle) / 0.45)
        )
        if along_wire <= 0.0:
            continue
        groove = bend - wire + x * x / (3.2 * wire)
        # The smaller of the two radii, without an edge where they meet.
        soft = 0.5 * wire
        mixed = max(soft - abs(radius - groove), 0.0) / soft
        pressed = min(radius, groove) - 0.25 * soft * mixed * mixed
        depth = max(radius - (bend - wire), 0.0)
        beside = (abs(x) - 2.3 * wire) / wire
        pressed += 0.16 * depth * np.exp(-beside * beside)
        part = 1.0 + along_wire * (pressed / radius - 1.0)
        moved_y, moved_z = (part - 1.0) * y, (part - 1.0) * z
        for i in range(3):
            vertices[v, i] += moved_y * frame[i, 1] + moved_z * frame[i, 2]
        apart = radius * part - bend
        gap = max(np.sqrt(x * x + apart * apart) - wire, 0.0) / (1.25 * wire)
        shade[v] *= 1.0 - 0.62 * along_wire * np.exp(-gap * gap)
