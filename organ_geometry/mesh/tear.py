"""A torn organ: two closed pieces with a ragged rim, and how far their rims have opened.

Where it tears and when is the beam's to say. The rim's raggedness, how far it gapes and how far a
piece draws back from it are drawn, not computed: beam theory ends where the duct does.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kernel_cache import njit
from organ_geometry.mesh.skin import Skin, ring_angles, sides_of, tube_skin
from organ_geometry.organ import Organ

# Largest distance of the rim from its mean station, in mean radii.
RAGGEDNESS = 0.24
# Tags of tissue that stand out of a rim.
TONGUES = 5
REACH = 1.0
"""Along how much of the axis the rings adapt to the ragged rim, in mean radii."""
# Least length of a piece, in mean radii: a duct that tears at a clamp leaves a stump in it.
SHORTEST_STUMP = 0.8
# How far a rim draws back along the axis once it is free, in mean radii.
GAPE = 0.55
# By what part more, or less, the side that tore first, or last, draws back: what has been free the
# longest has drawn back the most, and the lumen is seen.
GAPE_SPREAD = 0.45
# How far a free rim turns outwards, in mean radii, on average and from wave to wave.
FLARE, FLARE_WAVES = 0.09, 0.10
# Part of its thickness that the stretched wall has lost at a rim.
THINNED = 0.6
# Along how much of the axis a rim is flared and thinned, in mean radii.
CURL = 0.9
SAG = 0.30
"""How far a free end hangs down, in mean radii."""
# Length of the axis over which a rim's drawing back fades out, in mean radii.
DRAWN_BACK = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class TornPiece:
    """One piece of a torn organ, at rest, closed at its clamp and at its torn rim."""

    # The piece's skin; both pieces' rims have the same shape, so that a tear that has not opened
    # cannot be seen.
    skin: Skin
    # (V,) place of each vertex across the section: 0 on the side that tears first, 1 opposite.
    height: NDArray[np.float64]
    # (V, 3) displacement of each vertex once the tear has passed it by a section's height, mm.
    retreat: NDArray[np.float64]

    def __post_init__(self) -> None:
        for array in (self.height, self.retreat):
            array.setflags(write=False)

    def open(self, front: float, vertices: NDArray[np.float32]) -> NDArray[np.float32]:
        """Move (V, 3) vertices, mm, in place: none has parted at `front` 0, all are back at 2."""
        _draw_back(vertices, self.height, self.retreat, front)
        return vertices


def torn_pieces(
    organ: Organ,
    station: float,
    tension_side: NDArray[np.float64],
    *,
    edge_length: float,
    down: NDArray[np.float64] | None = None,
    seed: int = 1,
) -> tuple[TornPiece, TornPiece]:
    """Return the two pieces of an organ torn at a station.

    Parameters
    ----------
    organ, station
        Arc length at which it tears, mm; moved inwards as far as a stump needs.
    tension_side, down
        (3,) directions: from the axis to the side that tears first, and in which a free end hangs,
        by itself away from that side.
    edge_length
        Wanted length of the triangles' edges, mm.
    seed
        Chooses the rim's raggedness.

    Returns
    -------
    tuple[TornPiece, TornPiece]
        The piece at the organ's first end and the one at its last.

    Raises
    ------
    ValueError
        If the station is not on the organ.
    """
    if not 0.0 <= station <= organ.length:
        raise ValueError(
            f"station of a tear must lie from 0 to {organ.length:g} mm, got {station:g} mm"
        )
    radius = organ.mean_radius
    sag = SAG * radius * (-tension_side if down is None else down)
    shortest = min(SHORTEST_STUMP * radius, 0.25 * organ.length)
    middle = float(np.clip(station, shortest, organ.length - shortest))
    raggedness = min(RAGGEDNESS * radius, 0.6 * shortest)
    angles = ring_angles(sides_of(organ, edge_length))
    rim = middle + raggedness * _ragged(angles, seed)
    reach = min(REACH * radius, middle, organ.length - middle)

    ends = np.zeros(1), np.full(1, organ.length)
    skins = (
        tube_skin(organ, ends[0], rim, edge_length=edge_length, reach=reach),
        tube_skin(organ, rim, ends[1], edge_length=edge_length, reach=reach),
    )
    section = np.full(angles.size, middle)
    across = (organ.surface(section, angles) - organ.axis_at(section)) @ tension_side
    neighbours = organ.axis_at(np.array([middle - 0.5 * shortest, middle + 0.5 * shortest]))
    onwards = (neighbours[1] - neighbours[0]) / np.linalg.norm(neighbours[1] - neighbours[0])

    def piece(skin: Skin, length: float, away: NDArray[np.float64]) -> TornPiece:
        offsets = (skin.vertices - organ.axis_at(skin.stations)) @ tension_side
        height = np.clip((across.max() - offsets) / np.ptp(across), 0.0, 1.0)
        behind = np.maximum(np.abs(skin.stations - middle) - raggedness, 0.0)
        fade = min(DRAWN_BACK * radius, length - raggedness)
        near = np.clip(1.0 - behind / fade, 0.0, 1.0) ** 2
        gape = min(GAPE * radius, 0.3 * length) * (1.0 + GAPE_SPREAD * (1.0 - 2.0 * height))
        curled = np.clip(1.0 - behind / min(CURL * radius, fade), 0.0, 1.0) ** 2
        outwards = _turned_out(organ, skin, angles.size, radius, seed)
        retreat = gape[:, None] * away + sag
        return TornPiece(skin, height, near[:, None] * retreat + curled[:, None] * outwards)

    return piece(skins[0], middle, -onwards), piece(skins[1], organ.length - middle, onwards)


def _turned_out(
    organ: Organ, skin: Skin, sides: int, radius: float, seed: int
) -> NDArray[np.float64]:
    """Return how far each vertex would turn out at a free rim, (V, 3) mm."""
    offsets = skin.vertices - organ.axis_at(skin.stations)
    distances = np.linalg.norm(offsets, axis=1, keepdims=True)
    directions = offsets / np.maximum(distances, 1e-9)
    waves = _ragged(ring_angles(sides), seed + 1)
    outwards = np.zeros(len(offsets))
    count = len(offsets) // sides * sides  # a solid organ's two end points stay on the axis
    outwards[:count] = radius * np.tile(FLARE + FLARE_WAVES * waves, count // sides)
    if organ.hollow:
        outer, lumen = np.split(distances[:, 0], 2)
        outwards[outer.size :] += THINNED * (outer - lumen)
    return outwards[:, None] * directions


def _ragged(angles: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
    """Return a rough number for each of a ring's angles, of zero mean and from -1 to 1."""
    random = np.random.default_rng(seed)
    orders = np.arange(2, 18)
    phases = random.uniform(0.0, 2.0 * np.pi, orders.size)
    sizes = random.uniform(0.4, 1.0, orders.size) / np.sqrt(orders)
    waves = np.cos(np.outer(angles, orders) + phases) @ sizes
    for middle, width in zip(
        random.uniform(0.0, 2.0 * np.pi, TONGUES), random.uniform(0.12, 0.3, TONGUES), strict=True
    ):
        apart = np.angle(np.exp(1j * (angles - middle)))
        waves += random.choice([-0.9, 1.3]) * np.exp(-((apart / width) ** 2))
    waves -= waves.mean()
    return waves / np.abs(waves).max()


@njit(cache=True)
def _draw_back(
    vertices: NDArray[np.float32],
    height: NDArray[np.float64],
    retreat: NDArray[np.float64],
    front: float,
) -> None:
    for v in range(vertices.shape[0]):
        opened = min(max(front - height[v], 0.0), 1.0)
        for i in range(3):
            vertices[v, i] += opened * retreat[v, i]
