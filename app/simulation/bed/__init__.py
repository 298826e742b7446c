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
from app.simulation.bed.exercise import TITLES, BedExercise
from app.simulation.bed.exercise_limits import rehearsed
from app.simulation.bed.hand import HOLDING, INSTRUMENTS, Hand, Instrument
from app.simulation.bed.measures import DissectionMeasures
from app.simulation.bed.replay import DissectionReplay, DissectionSeries, dissection_csv
from app.simulation.bed.run import DissectionRun
from app.simulation.bed.run_log import DissectionFile, read_any_run
from app.simulation.bed.scene import PeelScene, read_scene
from app.simulation.bed.scripted_hands import MANNERS, BedManner, script
from app.simulation.bed.session import BedSession
from app.simulation.bed_preset import BedPreset, bed_named, bed_presets

__all__ = [
    "ELEMENTS",
    "HANDS",
    "HOLDING",
    "INSTRUMENTS",
    "JAW_RADIUS",
    "MANNERS",
    "MOST_OPENING",
    "SWAB_RADIUS",
    "TITLES",
    "TOWARDS_HAND",
    "BedExercise",
    "BedManner",
    "BedPreset",
    "BedReading",
    "BedSession",
    "BeddedDuct",
    "BeddedSurface",
    "DissectionFile",
    "DissectionMeasures",
    "DissectionReplay",
    "DissectionRun",
    "DissectionSeries",
    "Hand",
    "Instrument",
    "PeelScene",
    "Rod",
    "Touch",
    "bed_named",
    "bed_presets",
    "dissection_csv",
    "read_any_run",
    "read_scene",
    "rehearsed",
    "script",
]
