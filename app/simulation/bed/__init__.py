"""A duct in its bed of tissue: beds, their sources, and a duct dissected from one by two hands.

Scenes of any beam on a bed are here too (docs/peel.md).
"""

from app.simulation.bed.bedded_duct import (
    ELEMENTS,
    HANDS,
    JAW_RADIUS,
    MOST_OPENING,
    SWAB_RADIUS,
    TOWARDS_HAND,
    BeddedDuct,
    BedReading,
    Rod,
    Touch,
)
from app.simulation.bed.bedded_surface import BeddedSurface
from app.simulation.bed.exercise_limits import rehearsed
from app.simulation.bed.hand import Hand
from app.simulation.bed.measures import DissectionMeasures
from app.simulation.bed.scene import PeelScene, read_scene
from app.simulation.bed.scripted_hands import MANNERS, BedManner, script
from app.simulation.bed.session import BedSession, replay_of
from app.simulation.bed_preset import BedPreset, bed_named, bed_presets

__all__ = [
    "ELEMENTS",
    "HANDS",
    "JAW_RADIUS",
    "MANNERS",
    "MOST_OPENING",
    "SWAB_RADIUS",
    "TOWARDS_HAND",
    "BedManner",
    "BedPreset",
    "BedReading",
    "BedSession",
    "BeddedDuct",
    "BeddedSurface",
    "DissectionMeasures",
    "Hand",
    "PeelScene",
    "Rod",
    "Touch",
    "bed_named",
    "bed_presets",
    "read_scene",
    "rehearsed",
    "replay_of",
    "script",
]
