"""A policy's ghost beside the trainee: outlines of its duct, and its instruments as bars."""

import numpy as np
import viser
from numpy.typing import NDArray

from app.simulation import HANDS, SpatialTissue
from app.trainer.stage.drawn import Drawn
from app.trainer.viser_bridge.fast_transport import stream

# Sky blue and vermillion of Okabe and Ito, which differ for every kind of colour vision.
DUCT_COLOR, HAND_COLORS = (86, 180, 233), ((86, 180, 233), (213, 94, 0))
BAR_MM, BAR_WIDTH, LINE_WIDTH = 45.0, 1.2, 0.5  # mm
FROM_ABOVE = (0.0, -0.3, 0.95)
"""From the tip back along the bar of what has no shaft in the physics: hook and grasper."""
MOST_RODS = 2


class PolicyGhost(Drawn):
    """A ghost's duct as two lines along its wall, and a bar for each rod of its instruments."""

    def __init__(self, scene: viser.SceneApi, tissue: SpatialTissue) -> None:
        self._bars = [
            scene.add_line_segments(
                f"/ghost/hand_{hand}",
                _bars(tissue, hand),
                HAND_COLORS[hand],
                thickness=BAR_WIDTH,
                visible=False,
            )
            for hand in range(HANDS)
        ]
        self._duct = scene.add_line_segments(
            "/ghost/duct", _outline(tissue), DUCT_COLOR, thickness=LINE_WIDTH, visible=False
        )
        super().__init__(self._duct, *self._bars)

    def show(self, tissue: SpatialTissue) -> None:
        """Draw it where it is now."""
        stream(self._duct, "points", _outline(tissue))
        for hand, bars in enumerate(self._bars):
            stream(bars, "points", _bars(tissue, hand))


def _outline(tissue: SpatialTissue) -> NDArray[np.float32]:
    """Return (2 (N - 1), 2, 3) segments over and before the duct's axis, on its wall."""
    sides = [
        tissue.beam.places + tissue.radius * np.array(direction)
        for direction in ((0.0, 0.0, 1.0), (0.0, -1.0, 0.0))
    ]
    return np.concatenate(
        [np.stack([side[:-1], side[1:]], axis=1) for side in sides], dtype=np.float32
    )


def _bars(tissue: SpatialTissue, hand: int) -> NDArray[np.float32]:
    """Return (2, 2, 3) ends of a hand's bars; an instrument of one rod has it twice."""
    touch = tissue.touch(hand)
    ends = [(rod.tip, rod.shaft) for rod in touch.rods] or [(touch.place, FROM_ABOVE)]
    found = [[tip, np.array(tip) + BAR_MM * np.array(shaft)] for tip, shaft in ends]
    return np.array((found * MOST_RODS)[:MOST_RODS], dtype=np.float32)
