"""The stage: everything static around the duct, on one client's scene."""

import math
import time
from typing import Literal

import numpy as np
import viser
from numpy.typing import ArrayLike

from app.trainer.stage.appearance import Appearance
from app.trainer.stage.bench import bench_glb
from app.trainer.stage.camera import ELEVATION, OVERVIEW, Viewpoint, viewpoint
from app.trainer.stage.clamps import clamp_glb
from app.trainer.stage.drawn import add_model
from app.trainer.stage.hook import hook_glb
from app.trainer.stage.lighting import Look, clear_light, fill_air, lamp_position, light_stage
from app.trainer.stage.neighbours import neighbours_glb
from app.trainer.stage.refined_surface import light_surfaces
from app.trainer.stage.spill import spill_glb
from app.trainer.stage.tissue_bed import COLUMNS, PLAIN_COLUMNS, REFERENCE_SPAN, tissue_bed_glb
from app.trainer.stage.wall_texture import mean_color
from app.trainer.viser_bridge.fast_transport import place_node
from app.trainer.viser_bridge.page import keep_in_sight

_SETTLING_TIME = 3.0  # s after a framing has arrived, in which a camera elsewhere is framed again
_HOMING_TIME = 0.3  # s of the same once the page has settled: nobody has looked elsewhere so soon
_ASPECT_CHANGE = 0.02  # relative change of width by height that counts as another shape
_POSE_TOLERANCE = 0.01  # of the distance, within which a camera is where it was put
_RESET_TOLERANCE = 1e-4  # of the same for one that viser has reset: no hand is so exact
_LIFT_ROOM = 3.0  # mm between the duct and the bed, at the reference span or less
# Distance beside the duct that the camera may look at, in spans.
_SIGHT = 0.1
# Smallest distance of the camera to its target, and smallest height, in radii.
_NEAREST, _LOWEST = 6.0, 2.0


def stage_files(*, radius: float, look: Look, appearance: Appearance) -> dict[str, bytes]:
    """Return the static GLB files by their name on the stage; made once for all clients."""
    full = look == "full"
    detail = 1.0 if full else 0.5
    bite, tissue, surroundings = appearance.bite, mean_color(appearance), appearance.surroundings

    def clamp(end: Literal["first", "second"]) -> bytes:
        return clamp_glb(end, radius=radius, bite=bite, tissue=tissue, detail=detail)

    if surroundings == "bench":
        around = {"tissue_bed": bench_glb()}
    else:
        plain = {"rows": 28, "columns": PLAIN_COLUMNS, "pixels": 384}
        around = {"tissue_bed": tissue_bed_glb(**({} if full else plain))}
    if surroundings == "liver":
        around["neighbours"] = neighbours_glb() if full else neighbours_glb(corners=16, pixels=96)
    return {
        **around,
        "clamps/first": clamp("first"),
        "clamps/second": clamp("second"),
        "hook": hook_glb(radius, detail=detail),
    }


class Stage:
    """Lights, tissue bed, clamps and hook under `/stage` of one client's scene.

    Parameters
    ----------
    scene, span, radius
        Of one client; between the clamps and of the duct, mm. The axis runs from (0, 0, 0) to
        (span, 0, 0).
    look
        "plain" for slow machines: no environment map or normal map, fewer triangles.
    appearance
        Of the duct: what is pinched in the clamps and how flat, what it lies in, what it spills.
    elevation
        Of the camera when it is framed, rad.
    hook
        Whether the hook is the stage's own; otherwise only its light and shadow are.

    Raises
    ------
    ValueError
        If span or radius is not positive.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        *,
        span: float,
        radius: float,
        appearance: Appearance,
        look: Look = "full",
        elevation: float = ELEVATION,
        hook: bool = True,
    ) -> None:
        if not all(np.isfinite(number) and number > 0.0 for number in (span, radius)):
            raise ValueError(f"span and radius must be positive, got {span} mm and {radius} mm")
        self.span, self.radius, self.look = float(span), float(radius), look
        self.appearance = appearance
        self._scene, self._elevation = scene, elevation
        self._removed = False
        self._framed_aspect = 0.0
        self._lift: float | None = None
        self._framed_at = 0.0
        self._arrived = False
        self._settling_time = _SETTLING_TIME
        self._looked_around = False
        full = look == "full"
        files = stage_files(radius=self.radius, look=look, appearance=appearance)
        self.scale = scale = self.span / REFERENCE_SPAN  # of what is below and around the duct
        self._spilt = False
        floor = (0.5 * self.span, 0.0, -self.radius - _LIFT_ROOM * max(scale, 1.0))
        self.floor = floor  # where that is, mm
        # Points in a row of the bed; a bench does not give way.
        soft = COLUMNS if full else PLAIN_COLUMNS
        self.bed_columns = 0 if appearance.surroundings == "bench" else soft

        light_stage(scene, span=self.span, look=look)
        for name in sorted(files.keys() & {"tissue_bed", "neighbours"}):
            add_model(
                scene,
                f"/stage/{name}",
                files[name],
                scale=scale,
                position=floor,
                receive_shadow=True,
            )
        self._clamps = [
            add_model(scene, f"/stage/clamps/{end}", files[f"clamps/{end}"], position=(x, 0.0, 0.0))
            for end, x in (("first", 0.0), ("second", self.span))
        ]
        if full:
            light_surfaces(
                scene,
                lamp=lamp_position(self.span),
                aim=np.array([0.5 * self.span, 0.0, 0.0]),
                floor=np.array(floor),
                radius=self.radius,
            )
        self._hook = scene.add_frame("/stage/hook", show_axes=False)
        if hook:
            add_model(scene, "/stage/hook/instrument", files["hook"])
        self.place_hook((0.5 * self.span, 0.0, 0.0))

    def place_hook(self, point: ArrayLike) -> None:
        """Put the hook around the duct, whose axis it meets at a point, (3,) mm."""
        place = np.array(point, np.float64)
        if place.shape != (3,) or not all(map(math.isfinite, place.tolist())):
            raise ValueError(f"point must be 3 finite numbers, mm, got {point}")
        place_node(self._hook, *place.tolist())

    def spill(self, x: float) -> None:
        """Show what has run out of a torn duct; nothing in the plain look."""
        if self.look == "plain" or self._spilt:
            return
        scale = self.scale
        radius, place = round(self.radius / scale, 2), round(x / scale - 25.4, 1)
        if file := spill_glb(self.appearance, radius, place):
            add_model(self._scene, "/stage/spill", file, scale=scale, position=self.floor)
            self._spilt = True

    def wipe(self) -> None:
        """Remove what has run out."""
        if self._spilt:
            self._spilt = False
            self._scene.remove_by_name("/stage/spill")

    def set_lift(self, lift: float | None, client: viser.ClientHandle) -> None:
        """Keep a duct in the picture that is lifted this high, mm; None for the usual height."""
        if lift != self._lift:
            self._lift = lift
            self.frame_camera(client)

    def show_second_clamp(self, shown: bool) -> None:
        """Show the second clamp, or not where the duct is divided."""
        if self._clamps[1].visible != shown:
            self._clamps[1].visible = shown

    def frame_camera(self, client: viser.ClientHandle) -> None:
        """Set the client's camera so that both clamps are in its picture."""
        settled = self._arrived and time.monotonic() - self._framed_at >= self._settling_time
        self._settling_time = _HOMING_TIME if settled else _SETTLING_TIME
        self._looked_around = False
        self._frame(client, client.camera.aspect)

    def view(self, client: viser.ClientHandle) -> list[float] | None:
        """Return direction to and place of a client's camera; None while nobody has moved it."""
        if not self._looked_around:
            return None
        camera = client.camera
        return [*(camera.position - camera.look_at).tolist(), *camera.position.tolist()]

    def camera_moved(self, client: viser.ClientHandle) -> None:
        """Keep both clamps in the client's picture when its camera or its shape has changed.

        A browser that is still laying out its page reports a size that changes a moment later, and
        resets the camera once after it connects. So the camera is framed again when the picture's
        shape changes, when it has been reset, and whenever it is not where it was put, until
        `_SETTLING_TIME` after the page, which may be slow, first had it there, or `_HOMING_TIME`
        when it is framed once more. Once the user has looked around after that, the camera is left
        alone.
        """
        camera = client.camera
        reset = _stands(camera, OVERVIEW, _RESET_TOLERANCE)
        if self._removed or (self._looked_around and not reset):
            return
        aspect = camera.aspect
        reshaped = abs(aspect / self._framed_aspect - 1.0) > _ASPECT_CHANGE
        away = not _stands(camera, self._viewpoint(self._framed_aspect), _POSE_TOLERANCE)
        if not (away or self._arrived):
            self._arrived, self._framed_at = True, time.monotonic()
        settling = not self._arrived or time.monotonic() - self._framed_at < self._settling_time
        if reshaped or (away and (settling or reset)):
            self._looked_around = False
            self._frame(client, aspect, settles=reshaped)
        elif away:
            self._looked_around = True

    def remove(self) -> None:
        """Remove everything from the scene, so that another stage can be built."""
        if self._removed:
            return
        self._removed = True
        self._scene.remove_by_name("/stage")
        clear_light(self._scene)

    def _frame(self, client: viser.ClientHandle, aspect: float, *, settles: bool = True) -> None:
        view = self._viewpoint(aspect)
        self._framed_aspect = aspect
        if settles:
            self._arrived, self._framed_at = False, time.monotonic()
        with client.atomic():
            camera = client.camera
            camera.fov = view.fov
            camera.up_direction = view.up
            camera.position = view.position
            camera.look_at = view.look_at
            camera.near = 1.0
            camera.far = 20.0 * view.distance
            camera.max_orbit_distance = 2.0 * view.distance
            fill_air(self._scene, distance=view.distance)
            self._keep_in_sight(client, view)

    def _viewpoint(self, aspect: float) -> Viewpoint:
        return viewpoint(self.span, self.radius, aspect, lift=self._lift, elevation=self._elevation)

    def _keep_in_sight(self, client: viser.ClientHandle, view: Viewpoint) -> None:
        """Limit the camera to looking at the duct, from above the bed."""
        beside, target = _SIGHT * self.span, view.look_at
        low = np.minimum(target, (-beside, -beside, -self.radius))
        high = np.maximum(target, (self.span + beside, beside, 0.5 * self.span))
        keep_in_sight(
            client,
            place=view.position,
            target=target,
            low=low,
            high=high,
            nearest=_NEAREST * self.radius,
            lowest=_LOWEST * self.radius,
        )


def _stands(camera: viser.CameraHandle, view: Viewpoint, tolerance: float) -> bool:
    """Return whether a camera is at a viewpoint, to a part of its distance."""
    near = tolerance * view.distance
    return bool(
        np.linalg.norm(camera.position - view.position) < near
        and np.linalg.norm(camera.look_at - view.look_at) < near
    )
