"""A picture of a dissection from a camera, without a browser, a display or a graphics card.

Duct, strands and instruments are capsules, cut with the ray of each pixel in closed form: only
+ - * / and square roots, so that a picture has the same bits on every processor. A light sits at
the camera. Shapes are those that the physics knows; the duct's own skin is not drawn.
"""

import math

import numpy as np
from numpy.typing import NDArray

from app.simulation import HANDS, TOWARDS_HAND, TOWARDS_VIEWER, SpatialTissue
from kernel_cache import njit

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Pose = tuple[tuple[float, float, float], tuple[float, float, float]]

AWAY_MM, FIELD_DEG = 70.0, 60.0
"""Of the standard camera: how far from the duct's middle it is, and its field of view."""
STRAND_MM, SHAFT_MM, SHAFT_RADIUS = 0.25, 60.0, 1.5
DUCT, STRAND, BED, DARK = (118, 140, 74), (214, 170, 150), (120, 52, 44), (20, 10, 10)
SHAFTS = {
    "hook": (240, 200, 60),
    "grasper": (120, 190, 250),
    "dissector": (190, 230, 150),
    "swab": (245, 245, 245),
    "right angle": (160, 160, 220),
    "clip applier": (230, 150, 210),
    "scissors": (250, 140, 100),
    "suction": (110, 110, 110),
}
"""Colours, red, green and blue; instruments differ in lightness too."""


class Camera:
    """A camera that looks at a duct.

    Parameters
    ----------
    height, width
        Pixels of its pictures.
    span
        Length of the duct, mm: the standard camera looks at its middle.
    pose
        mm, where it is and what it looks at, not straight down; the standard view when None.

    Raises
    ------
    ValueError
        If the camera looks straight down, or is where it looks.
    """

    def __init__(self, height: int, width: int, span: float, pose: Pose | None = None) -> None:
        at = np.array([0.5 * span, 0.0, 0.0] if pose is None else pose[1])
        place = at + AWAY_MM * TOWARDS_VIEWER if pose is None else np.array(pose[0])
        ahead = at - place
        if not float((ahead[:2] ** 2).sum()) > 0.0:
            raise ValueError(f"a camera must look at another place, not straight down: {pose}")
        ahead /= math.sqrt(float((ahead**2).sum()))
        # Up in the picture is away from the bed, as far as that is across the view.
        right = np.array([ahead[1], -ahead[0], 0.0])
        right /= math.sqrt(float((right**2).sum()))
        down = np.array(
            [ahead[i - 2] * right[i - 1] - ahead[i - 1] * right[i - 2] for i in range(3)]
        )
        self._place, self._axes = place, np.stack([right, down, ahead])
        self._focal = 0.5 * min(height, width) / math.tan(math.radians(0.5 * FIELD_DEG))
        self._depth = np.zeros((height, width))

    def take(self, tissue: SpatialTissue, out: Bytes) -> Bytes:
        """Write a picture, (height, width, 3), red, green and blue."""
        shapes, colours = _shapes(tissue)
        seen = np.concatenate([self._seen(shapes[:, :3]), self._seen(shapes[:, 3:6])], axis=1)
        height = -tissue.radius - tissue.gap_mm
        bed = self._seen(np.array([[0.0, 0.0, height]]))[0]
        up = (self._axes * np.array([0.0, 0.0, 1.0])).sum(axis=1)
        out[:] = DARK
        self._depth[:] = np.inf
        _draw_plane(bed, up, np.array(BED), self._focal, self._depth, out)
        _draw(seen, shapes[:, 6], colours, self._focal, self._depth, out)
        return out

    def _seen(self, places: Floats) -> Floats:
        """Return (K, 3) places to the right, down and ahead of the camera, mm."""
        # Not BLAS's product, whose last digits differ between processors.
        return ((places - self._place)[:, None] * self._axes).sum(axis=2)


def _shapes(tissue: SpatialTissue) -> tuple[Floats, Floats]:
    """Return (K, 7) capsules, both ends and radius, mm, and their (K, 3) colours."""
    beam = tissue.beam
    state = beam.state
    # An element that has torn bears nothing.
    i, j = state.ends[state.stiff[:, 0] > 0.0, :2].T
    thick = 0.5 * (state.thick[i, 0] + state.thick[j, 0])
    duct = np.concatenate([state.x[i], state.x[j], thick[:, None]], axis=1)
    whole = np.flatnonzero(beam.damage < 1.0)
    width = np.full((whole.size, 1), STRAND_MM)
    strands = np.concatenate([beam.strand_ends(whole), beam.strand_feet(whole), width], axis=1)
    tools: list[list[float]] = []
    colours = [np.tile(DUCT, (len(duct), 1)), np.tile(STRAND, (len(strands), 1))]
    for hand in range(HANDS):
        instrument = tissue.hands[hand].instrument
        tips = [(rod.tip, rod.radius) for rod in tissue.touch(hand).rods]
        shaft = np.array(TOWARDS_HAND.get(instrument, TOWARDS_HAND["swab"]))
        for tip, radius in tips or [(tissue.hands[hand].place, SHAFT_RADIUS)]:
            tools.append([*tip, *(tip + SHAFT_MM * shaft), radius])
            colours.append(np.array([SHAFTS[instrument]]))
    return np.concatenate([duct, strands, np.array(tools)]), np.concatenate(colours) * 1.0


@njit(cache=True, nogil=True)
def _draw_plane(
    at: Floats, up: Floats, colour: Floats, focal: float, depth: Floats, out: Bytes
) -> None:
    """Draw a plane through a place, across `up`."""
    rows, columns = depth.shape
    over = at[0] * up[0] + at[1] * up[1] + at[2] * up[2]
    for i in range(rows):
        for j in range(columns):
            x, y = (j + 0.5 - 0.5 * columns) / focal, (i + 0.5 - 0.5 * rows) / focal
            size = math.sqrt(x * x + y * y + 1.0)
            down = (x * up[0] + y * up[1] + up[2]) / size
            if down * over > 0.0:
                depth[i, j] = over / down
                for c in range(3):
                    out[i, j, c] = int(colour[c] * (0.2 + 0.8 * abs(down)))


@njit(cache=True, nogil=True)
def _draw(
    ends: Floats, radii: Floats, colours: Floats, focal: float, depth: Floats, out: Bytes
) -> None:
    """Draw (K, 6) capsules that are nearer than what is drawn."""
    rows, columns = depth.shape
    for k in range(ends.shape[0]):
        ax, ay, az, bx, by, bz = ends[k]
        r = radii[k]
        if az <= r or bz <= r:  # behind the camera, or it would be inside
            continue
        pad_a, pad_b = 1.5 * r / (az - r), 1.5 * r / (bz - r)
        left = min(ax / az - pad_a, bx / bz - pad_b) * focal + 0.5 * columns
        right = max(ax / az + pad_a, bx / bz + pad_b) * focal + 0.5 * columns
        top = min(ay / az - pad_a, by / bz - pad_b) * focal + 0.5 * rows
        bottom = max(ay / az + pad_a, by / bz + pad_b) * focal + 0.5 * rows
        dx, dy, dz = bx - ax, by - ay, bz - az
        long = dx * dx + dy * dy + dz * dz
        from_a = -(ax * dx + ay * dy + az * dz)  # of the camera along the axis
        square = ax * ax + ay * ay + az * az
        for i in range(max(0, int(top)), min(rows, int(bottom) + 1)):
            for j in range(max(0, int(left)), min(columns, int(right) + 1)):
                x, y = (j + 0.5 - 0.5 * columns) / focal, (i + 0.5 - 0.5 * rows) / focal
                z = 1.0 / math.sqrt(x * x + y * y + 1.0)
                x, y = x * z, y * z
                along = dx * x + dy * y + dz * z
                near = -(ax * x + ay * y + az * z)
                a = long - along * along
                b = long * near - from_a * along
                h = b * b - a * (long * square - from_a * from_a - r * r * long)
                if h < 0.0 or a <= 1e-12 * long:
                    continue
                t = (-b - math.sqrt(h)) / a
                along_axis = from_a + t * along
                if along_axis <= 0.0 or along_axis >= long:  # a round end
                    ex, ey, ez, along_axis = (
                        (ax, ay, az, 0.0) if along_axis <= 0.0 else (bx, by, bz, long)
                    )
                    b = ex * x + ey * y + ez * z
                    h = b * b - (ex * ex + ey * ey + ez * ez - r * r)
                    if h < 0.0:
                        continue
                    t = b - math.sqrt(h)
                if t >= depth[i, j]:
                    continue
                depth[i, j] = t
                u = along_axis / long if long > 0.0 else 0.0
                nx, ny, nz = t * x - ax - u * dx, t * y - ay - u * dy, t * z - az - u * dz
                light = 0.2 + 0.8 * max(0.0, -(nx * x + ny * y + nz * z) / r)
                for c in range(3):
                    out[i, j, c] = int(colours[k, c] * light)
