"""The model drawn over the tissue: key points, the sections kept and driving points."""

import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.stage.drawn import Drawn
from organ_geometry import DrivingPoints, Organ
from organ_geometry.mesh import BoundSkin, Skin, ring_angles

KEY_COLOR, DRIVING_COLOR, RING_COLOR = (64, 224, 240), (255, 178, 32), (200, 245, 250)
SECTION_SIDES = 40
KEY_POINTS_OF_A_SECTION = 8
CLEAR = 0.35
"""mm of points and rings off the wall, so that its relief does not hide them."""
# Radii of points, mm.
KEY_SIZE, DRIVING_SIZE = 0.32, 0.24


class Overlay(Drawn):
    """Key points, the sections that are kept, and driving points, which follow the duct.

    Hidden until it is made visible.
    """

    def __init__(self, scene: viser.SceneApi, organ: Organ, driving: DrivingPoints) -> None:
        stations = organ.key_stations
        angles = ring_angles(SECTION_SIDES)
        sections = np.repeat(stations, SECTION_SIDES)
        rings = organ.surface(sections, np.tile(angles, stations.size))
        axis = organ.axis_at(sections)
        outwards = (rings - axis) / np.linalg.norm(rings - axis, axis=1, keepdims=True)
        # The rings are a skin of their own that follows the driving points as the duct's does.
        self._skin = Skin(
            (rings + CLEAR * outwards).astype(np.float32),
            np.zeros((0, 3), np.int32),
            sections,
            rings=stations.size,
            sides=SECTION_SIDES,
            hollow=False,
            right_handed=True,
        )
        self._bound: BoundSkin = self._skin.bound_to(driving)
        self._rings = self._skin.vertices.copy()
        self._shape = (stations.size, SECTION_SIDES)
        self._driving = driving.positions
        # Driving points lie on the axis, inside the duct; they are drawn on the wall above it.
        step = SECTION_SIDES // KEY_POINTS_OF_A_SECTION
        self._key_index = np.arange(0, stations.size * SECTION_SIDES, step)
        super().__init__(
            scene.add_point_cloud(
                "/organ/overlay/key_points",
                self._rings[self._key_index],
                KEY_COLOR,
                point_size=KEY_SIZE,
                point_shape="circle",
                precision="float32",
                visible=False,
            ),
            scene.add_line_segments(
                "/organ/overlay/sections",
                self._segments(),
                RING_COLOR,
                thickness=1.6,
                thickness_units="screen",
                visible=False,
            ),
            scene.add_point_cloud(
                "/organ/overlay/driving_points",
                self._driving.astype(np.float32),
                DRIVING_COLOR,
                point_size=DRIVING_SIZE,
                point_shape="circle",
                precision="float32",
                visible=False,
            ),
        )
        self._lift = organ.mean_radius + CLEAR
        self.show(np.zeros((driving.stations.size, 3, 4)), np.array([0.0, 0.0, 1.0]))

    def show(self, transforms: NDArray[np.float64], pull: NDArray[np.float64]) -> None:
        """Draw the points and sections as the driving points' transforms move them."""
        points, lines, driving = self._handles
        self._bound.deform(transforms, self._rings)
        points.points = self._rings[self._key_index]
        lines.points = self._segments()
        on_wall = self._driving + self._lift * pull
        moved = np.einsum("dij,dj->di", transforms[:, :, :3], on_wall) + transforms[:, :, 3]
        driving.points = (on_wall + moved).astype(np.float32)

    def _segments(self) -> NDArray[np.float32]:
        """Return the rings as (N, 2, 3) line segments."""
        rings = self._rings.reshape(*self._shape, 3)
        return np.stack([rings, np.roll(rings, -1, axis=1)], axis=2).reshape(-1, 2, 3)
