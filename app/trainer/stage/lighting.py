"""Light, air and background of the stage."""

from typing import Literal

import numpy as np
import viser
from numpy.typing import NDArray

from app.trainer.stage.tissue_bed import REFERENCE_SPAN

Look = Literal["full", "plain"]
"""'plain' has no environment map and no normal map, for slow machines."""
LookChoice = Literal["full", "plain", "auto"]
"""'auto' is the full look until a page reports that it draws too slowly."""

_BACKGROUND = (10, 3, 4)
_FOG = (2, 0, 0)  # the client takes fog colours for linear light: this is _BACKGROUND in sRGB


def lamp_position(span: float) -> NDArray[np.float64]:
    """Return the lamp's position, (3,) mm in stage coordinates."""
    return np.array([0.5 * span, 0.0, 0.0]) + np.array([-32.0, -30.0, 86.0]) * (
        span / REFERENCE_SPAN
    )


def light_stage(scene: viser.SceneApi, *, span: float, look: Look) -> None:
    """Add lights, environment map and background to a scene."""
    # viser's server sends the environment map from its own files: nothing is fetched from
    # elsewhere. These lights cast no shadows: viser 1.1.1 fixes the shadow camera's near plane and
    # bias for scenes of about a metre, and in mm everything beyond 100 mm from the lamp turns dark.
    # `refined_surface.light_surfaces` adds the shadows of the full look.
    full = look == "full"
    scene.set_up_direction("+z")
    scene.configure_environment_map("studio" if full else None, environment_intensity=0.29)
    scene.set_background_image(np.full((8, 8, 3), _BACKGROUND, np.uint8), format="png")

    scale = span / REFERENCE_SPAN
    center = np.array([0.5 * span, 0.0, 0.0])
    lamp = lamp_position(span)
    aim = (center - lamp) / np.linalg.norm(center - lamp)
    scene.add_light_spot(
        "/stage/light/lamp",
        color=(255, 244, 232),
        intensity=2.5 if full else 2.7,
        decay=0.0,
        angle=0.56,
        penumbra=1.0,
        position=_triple(lamp),
        direction=_triple(aim),
    )
    scene.add_light_point(
        "/stage/light/rim",
        color=(255, 196, 170),
        intensity=0.7,
        decay=0.0,
        position=_triple(center + np.array([42.0, 44.0, 46.0]) * scale),
    )
    scene.add_light_ambient(
        "/stage/light/ambient", color=(255, 225, 215), intensity=0.12 if full else 1.3
    )


def fill_air(scene: viser.SceneApi, *, distance: float) -> None:
    """Let what is far behind the duct fade into the dark."""
    scene.configure_fog(0.95 * distance, 2.3 * distance, color=_FOG)


def clear_light(scene: viser.SceneApi) -> None:
    """Take fog, background and environment map away."""
    scene.configure_fog(1.0, 2.0, enabled=False)
    scene.set_background_image(None)
    scene.configure_environment_map(None)


def _triple(vector: np.ndarray) -> tuple[float, float, float]:
    """Return a vector as the plain tuple viser asks for."""
    x, y, z = (float(number) for number in vector)
    return x, y, z
