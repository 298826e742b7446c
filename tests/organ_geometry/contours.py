"""Section contours of tubes whose every measure is known."""

import numpy as np

from organ_geometry.contours.contour import SectionContour

RADIUS = 2.5
LENGTH = 60.0


def circle(radius: float, count: int = 120) -> np.ndarray:
    turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)


def cylinder(
    *, sections: int = 33, lumen: float | None = None, noise: float = 0.0, radius: float = RADIUS
) -> list[SectionContour]:
    """A straight tube along x, seen in frames like those of a stack without directions."""
    rng = np.random.default_rng(5)
    x_dir, y_dir = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, -1.0])

    def placed(size: float, x: float) -> np.ndarray:
        ring = circle(size) * (1.0 + rng.normal(0.0, noise, 120) / size)[:, np.newaxis]
        return np.array([x, 3.0, -7.0]) + ring[:, :1] * x_dir + ring[:, 1:] * y_dir

    return [
        SectionContour(
            index,
            placed(radius, x),
            None if lumen is None else placed(lumen * radius, x),
            np.array([1.0, 0.0, 0.0]),
            x_dir,
        )
        for index, x in enumerate(np.linspace(0.0, LENGTH, sections))
    ]


def bent_tube(
    *, sections: int = 65, bend: float = 40.0, lumen: float | None = None, radius: float = RADIUS
) -> list[SectionContour]:
    """A tube around a quarter of a circle, cut across its axis."""
    contours = []
    for index, angle in enumerate(np.linspace(0.0, 0.5 * np.pi, sections)):
        outwards = np.array([np.cos(angle), np.sin(angle), 0.0])
        normal = np.array([-np.sin(angle), np.cos(angle), 0.0])
        up = np.array([0.0, 0.0, 1.0])
        rings = [
            bend * outwards + ring[:, :1] * outwards + ring[:, 1:] * up
            for ring in (circle(radius), circle(radius * (lumen or 1.0)))
        ]
        contours.append(
            SectionContour(index, rings[0], rings[1] if lumen else None, normal, outwards)
        )
    return contours
