"""Where the camera stands, for a span and the shape of a browser's window."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.trainer.stage.clamps import JAW_LENGTH

# Vertical, rad.
FIELD_OF_VIEW = 0.62

ELEVATION = 0.6435011
"""Of the camera over the duct, rad."""
TOWARDS_VIEWER = np.array([0.0, -np.cos(ELEVATION), np.sin(ELEVATION)])
"""(3,) from the stage towards the camera when it is framed."""
_MARGIN = 0.93  # part of the picture's half height and half width that may be filled
_NARROW = 0.8  # width by height below which it is a phone held upright
_NARROW_SHIFT = 0.585  # of the half height, that the duct is moved up above a phone's panel
_LIFT = 0.30  # height of the lifted middle, in spans


@dataclass(frozen=True, slots=True, eq=False)
class Viewpoint:
    """A camera pose in stage coordinates."""

    position: NDArray[np.float64]  # (3,) mm
    look_at: NDArray[np.float64]  # (3,) mm
    up: NDArray[np.float64]  # (3,) unit vector
    fov: float = FIELD_OF_VIEW  # vertical, rad

    @property
    def distance(self) -> float:
        """Distance from the camera to the point that it looks at, mm."""
        return float(np.linalg.norm(self.look_at - self.position))


def viewpoint(
    span: float,
    radius: float,
    aspect: float,
    *,
    lift: float | None = None,
    elevation: float = ELEVATION,
) -> Viewpoint:
    """Return the viewpoint that shows the whole duct, both clamps and the room it is lifted into.

    Parameters
    ----------
    span, radius, lift
        Between the clamps, of the duct, and the largest height that its middle is lifted to, mm;
        three tenths of the span when None.
    aspect
        Width by height of the picture. Below 0.8 it is taken for a phone, whose panel covers the
        lower part: the duct then appears in the upper part.
    elevation
        Of the camera over the duct, rad.

    Returns
    -------
    Viewpoint
        Looking along +y and down.

    Raises
    ------
    ValueError
        If a number is not positive.
    """
    if not all(np.isfinite(number) and number > 0.0 for number in (span, radius, aspect)):
        raise ValueError(
            f"span, radius and aspect must be positive, got {span} mm, {radius} mm, {aspect}"
        )
    forward = np.array([0.0, np.cos(elevation), -np.sin(elevation)])
    right = np.array([1.0, 0.0, 0.0])
    above = np.cross(right, forward)
    target = np.array([0.5 * span, 0.0, 0.08 * span])
    reach = 0.62 * JAW_LENGTH * radius
    shown = np.array(
        [
            *[
                [x, y, z]
                for x in (-reach, span + reach)
                for y in (-1.2 * radius, 1.2 * radius)
                for z in (-1.6 * radius, 1.6 * radius)
            ],
            [0.5 * span, 0.0, (_LIFT * span if lift is None else lift) + radius],
            [0.5 * span, 0.0, -3.5 * radius],
        ]
    )
    relative = shown - target
    depth = relative @ forward
    slope = float(np.tan(FIELD_OF_VIEW / 2.0))
    shift = _NARROW_SHIFT if aspect < _NARROW else 0.0
    # A point is in the picture when |right| <= margin * aspect * slope * (distance + depth), and
    # likewise upwards, where the shift takes up part of the height. The smallest distance for which
    # all points are is the largest that one of them asks for.
    distance = max(
        float(np.max(np.abs(relative @ right) / (_MARGIN * aspect * slope) - depth)),
        float(np.max((relative @ above / slope - _MARGIN * depth) / (_MARGIN - shift))),
        float(np.max((-(relative @ above) / slope - _MARGIN * depth) / (_MARGIN + shift))),
    )
    look_at = target - above * (shift * slope * distance)
    return Viewpoint(look_at - forward * distance, look_at, np.array([0.0, 0.0, 1.0]))


OVERVIEW = viewpoint(50.8, 4.445, 1.3)
"""Where a page's camera is before a stage has framed it, and when viser resets it."""
