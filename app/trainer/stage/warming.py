"""The first drawing's compilation, done before a client waits for it."""

import numpy as np

from app.simulation.session import Session
from app.trainer.stage.contact import Contact, HookPlace
from app.trainer.stage.heat_map import heat_colors
from app.trainer.stage.tissue import raise_wall
from app.trainer.stage.underlay import sink_wall
from app.trainer.stage.vessels import Vessels, pose_vessels
from app.trainer.stage.wall import Wall, wall_normals

__all__ = ["warm_drawing"]


def warm_drawing(session: Session) -> None:
    """Compile or load what a client's drawing needs.

    Parameters
    ----------
    session
        A session with a whole duct; it is not changed.
    """
    dissection, skin = session.dissection, session.surfaces[0].skin
    organ, radius = dissection.organ, dissection.organ.mean_radius
    contact = Contact(
        skin, organ.axis_at(skin.stations), dissection.frame, dissection.clamps, radius
    )
    middle = dissection.axis_point(0.5 * dissection.beam.span)
    contact.mark(session.surfaces[0].vertices, HookPlace(middle, dissection.frame, radius))
    wall, vessels = Wall.of(skin), Vessels.of(Wall.of(skin), organ.length, radius)
    normals, raised, colors = np.empty((3, wall.count, 3), np.float32)
    wall_normals(contact.vertices, wall.rings, wall.sides, wall.right_handed, normals)
    raise_wall(contact.vertices, normals, np.zeros(wall.count, np.float32), raised)
    sink_wall(raised, normals, colors)
    count = len(vessels.ring)
    pose_vessels(
        raised, normals, contact.shade, wall.sides, vessels.ring, vessels.side, vessels.between,
        vessels.lift, np.empty((count, 3), np.float32), np.empty(count, np.float32),
    )  # fmt: skip
    heat_colors(np.zeros(wall.count), normals, dissection.frame[:, 2].copy(), colors)
