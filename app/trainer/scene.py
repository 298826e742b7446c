"""The scene: the duct of one client between its clamps, and the hook that pulls it."""

from dataclasses import dataclass

import numpy as np
import viser
from numpy.typing import NDArray
from viser import transforms

from app.simulation.session import Phase, Reading, Session, Surface
from app.trainer.stage.lighting import Look
from app.trainer.stage.stage import Stage

__all__ = ["Scene"]

TISSUE = (192, 124, 80)
INSIDE = (138, 48, 40)
"""sRGB colours of the outer wall, and of the lumen and torn tissue."""
SAME_STAGE = 0.01
"""Change of the span that the eye does not see: a megabyte need not be sent anew for it."""
LIFT_AFTER_TEAR = 2.5
"""How far the hook is lifted from where a torn duct lay, in radii."""


@dataclass(frozen=True, slots=True, eq=False)
class _Drawn:
    """A mesh in the browser and the surface's vertices that it shows."""

    mesh: viser.MeshHandle
    surface: Surface
    used: NDArray[np.int32]


class Scene:
    """One client's picture of its session.

    Parameters
    ----------
    client
        The client.
    session
        Its session.
    look
        "plain" for slow machines.
    """

    def __init__(self, client: viser.ClientHandle, session: Session, look: Look) -> None:
        self._client, self._session = client, session
        self._look: Look = look
        self._stage: Stage | None = None
        self._drawn: list[_Drawn] = []
        self._shape = -1
        self._clamps: tuple[float, float] | None = None
        self._arch = 0.0
        self.draw(session.reading())

    def draw(self, reading: Reading) -> None:
        """Draw the session as it is now.

        Parameters
        ----------
        reading
            The session's reading.
        """
        with self._client.atomic():
            stage = self._set_stage()
            stage.set_lift(self._lift(stage, reading), self._client)
            if self._session.shape != self._shape:
                self._rebuild()
            for drawn in self._drawn:
                drawn.mesh.vertices = drawn.surface.vertices[drawn.used]
            lift = LIFT_AFTER_TEAR * stage.radius if reading.phase is Phase.TORN else 0.0
            stage.place_hook(np.add(reading.hook, (0.0, 0.0, lift)), (0.0, 0.0, 1.0))

    def frame_camera(self) -> None:
        """Keep both clamps in the client's picture."""
        self._set_stage().frame_camera(self._client)

    def _lift(self, stage: Stage, reading: Reading) -> float:
        """Return how high the picture must show the duct: its arch at rest and the break above."""
        event = reading.breaks_at
        pulled = max(reading.deepest, 0.0 if event is None else event.deflection)
        tenth = 0.1 * stage.span
        # In steps, so that the camera moves with the choice of a duct, not with every figure.
        return max(3.0, np.ceil((self._arch + 1.1 * pulled) / tenth)) * tenth

    def _set_stage(self) -> Stage:
        """Return the stage for the session's clamps, setting it anew when they have moved."""
        dissection = self._session.dissection
        if self._stage is not None and self._clamps == dissection.clamps:
            return self._stage
        self._clamps = dissection.clamps
        first, last = dissection.organ.axis_at(np.array(dissection.clamps))
        span = float(np.linalg.norm(last - first))
        axis = dissection.organ.axis_at(np.linspace(*dissection.clamps, 41)) - first
        self._arch = max(0.0, float((axis @ dissection.frame[:, 2]).max()))
        if self._stage is not None and abs(span / self._stage.span - 1.0) > SAME_STAGE:
            self._stage.remove()
            self._stage = None
        if self._stage is None:
            self._stage = Stage(
                self._client.scene,
                span=span,
                radius=dissection.organ.mean_radius,
                look=self._look,
                tissue=TISSUE,
            )
            self._stage.frame_camera(self._client)
        # The organ stands where its images stand; the stage has its first clamp at the origin.
        turn = transforms.SO3.from_matrix(dissection.frame.T)
        self._client.scene.add_frame(
            "/organ", show_axes=False, wxyz=turn.wxyz, position=turn.apply(-first)
        )
        return self._stage

    def _rebuild(self) -> None:
        """Show the session's surfaces instead of those shown so far."""
        self._shape = self._session.shape
        for drawn in self._drawn:
            drawn.mesh.remove()
        self._drawn = []
        for surface in self._session.surfaces:
            outer = surface.skin.outer_faces
            faces = surface.skin.faces
            self._draw_faces(surface, surface.name, faces[:outer], TISSUE)
            # A mesh of its own: another colour, and a sharp edge along the torn rim.
            self._draw_faces(surface, f"{surface.name}_inside", faces[outer:], INSIDE)

    def _draw_faces(
        self,
        surface: Surface,
        name: str,
        faces: NDArray[np.int32],
        color: tuple[int, int, int],
    ) -> None:
        used, renumbered = np.unique(faces, return_inverse=True)
        mesh = self._client.scene.add_mesh_simple(
            f"/organ/{name}",
            surface.vertices[used],
            renumbered.reshape(faces.shape).astype(np.uint32),
            color=color,
            side="double",
            # viser's shadow camera is made for metres: in mm its bias darkens what it lights.
            cast_shadow=False,
            receive_shadow=False,
        )
        self._drawn.append(_Drawn(mesh, surface, used))
