"""A duct between two clamps that is pulled, measured, torn and replayed; no viewer in it.

What is listed here is the package's public face; other packages import from it and not by path.
`app.simulation` has the duct in its bed of tissue.
"""

from app.bed_preset import BedPreset, bed_named, bed_presets
from app.simulation.exercises.critical_view import (
    MOST_POINTS,
    ONE_POINT,
    TWO_POINTS,
    CriticalView,
    Tenting,
)
from app.simulation.exercises.errors import (
    CONSEQUENCES,
    ERROR_CLASSES,
    MODES,
    Conditions,
    ErrorClass,
    Incident,
    cause_of,
    read_incidents,
)
from app.simulation.exercises.exercise import (
    Exercise,
    ExerciseInputs,
    Feedback,
    Limit,
    Opening,
    Outcome,
)
from app.simulation.exercises.exercise_table import EXERCISES
from app.simulation.exercises.goals import FreeLength, Stay
from app.simulation.exercises.metrics import DISTANCE_TO_BREAK, METRIC_OF, METRICS, Metric, Metrics
from app.simulation.exercises.next_step import FIRM, NextStep
from app.simulation.exercises.older_exercises import renamed_exercise, renamed_goal, renamed_numbers
from app.simulation.inputs.clock import TICK_SECONDS, TICKS_PER_SECOND, Clock
from app.simulation.inputs.grasper import HAND_SPEED, Grasper, Load
from app.simulation.inputs.hand import GRIP_N, Hand
from app.simulation.inputs.inputs import (
    ALL_INSTRUMENTS,
    HOLDING,
    INSTRUMENTS,
    STRUCTURES,
    Input,
    Instrument,
    Structure,
    TheoryChoice,
)
from app.simulation.inputs.trocar import TROCARS, Trocar
from app.simulation.replay import AFTER_TEAR, FEW, Replay, Series, loading_rates
from app.simulation.runs.older_runs import read_run, renamed_metrics
from app.simulation.runs.run import Run
from app.simulation.runs.run_file import (
    ELEMENTS,
    HANDS,
    MOST_BYTES,
    OrganIdentity,
    RunFile,
    RunFileError,
    RunLog,
    anatomy_or_name,
    run_json,
)
from app.simulation.scripts.exercise_limits import (
    AT_ANATOMY,
    exercise_at,
    exercises_offered,
    not_offered,
)
from app.simulation.scripts.performance import Performance, Script, Step, performed, read_script
from app.simulation.scripts.recorded_hands import CarefulRun, careful_run, has_careful_run
from app.simulation.scripts.scripted_hands import CAREFUL, MANNERS, Technique, perform
from app.simulation.seen import Seen, Sights
from app.simulation.session.session import VERTICES, Session, free_specimen, specimen_in_bed
from app.simulation.specimen.comparison import Ghost, GhostReading, SwingingChain
from app.simulation.specimen.dissection import PIECES, Dissection, default_preset, fits, organ_beam
from app.simulation.specimen.drawn_duct import Stresses, SurfaceStress
from app.simulation.specimen.grasped_beam import BeamModel, GraspedBeam
from app.simulation.specimen.preset import (
    ASSUMED_PRESET,
    LIMITS,
    THESIS_PRESET,
    OrganBeam,
    Preset,
    RoundBeam,
    Spread,
    chosen_preset,
    preset_named,
    preset_toml,
    presets,
    read_preset,
)
from app.simulation.specimen.specimen import Specimen
from app.simulation.specimen.surface_mapping import SurfaceMapping
from app.simulation.specimen.tear import (
    FRONT_SECONDS,
    SETTLED_SECONDS,
    Phase,
    tear_front,
    tear_swing,
)
from app.simulation.specimen.tubes import Tubes
from app.simulation.tissue.guidance import Guidance
from app.simulation.tissue.held_pull import pull_and_hold
from app.simulation.tissue.instruments import (
    CLIP_OPENING,
    COMES_OPEN,
    FIRST_INSTRUMENTS,
    JAW_RADIUS,
    MOST_OPENING,
    SWAB_RADIUS,
    TOWARDS_HAND,
    HandContact,
    Rod,
)
from app.simulation.tissue.jaw_steps import GRIPS_AT, IN_RING_MM, TURNED, turn_off
from app.simulation.tissue.planar_tissue import PlanarTissue
from app.simulation.tissue.reached_tube import (
    REACH,
    near_place,
    pointed_at,
    seen_beside,
    wall_gap,
)
from app.simulation.tissue.reading import FluidReading, NickReading, Reading, Vector
from app.simulation.tissue.safety import Safety
from app.simulation.tissue.sight import FIELD_OF_VIEW, TOWARDS_VIEWER
from app.simulation.tissue.spatial_tissue import Event, EventKind, SpatialTissue
from app.simulation.tissue.suction import MOST_SUCTION
from app.simulation.tissue.tissue import Tissue

__all__ = [
    "AFTER_TEAR",
    "ALL_INSTRUMENTS",
    "ASSUMED_PRESET",
    "AT_ANATOMY",
    "CAREFUL",
    "CLIP_OPENING",
    "COMES_OPEN",
    "CONSEQUENCES",
    "DISTANCE_TO_BREAK",
    "ELEMENTS",
    "ERROR_CLASSES",
    "EXERCISES",
    "FEW",
    "FIELD_OF_VIEW",
    "FIRM",
    "FIRST_INSTRUMENTS",
    "FRONT_SECONDS",
    "GRIPS_AT",
    "GRIP_N",
    "HANDS",
    "HAND_SPEED",
    "HOLDING",
    "INSTRUMENTS",
    "IN_RING_MM",
    "JAW_RADIUS",
    "LIMITS",
    "MANNERS",
    "METRICS",
    "METRIC_OF",
    "MODES",
    "MOST_BYTES",
    "MOST_OPENING",
    "MOST_POINTS",
    "MOST_SUCTION",
    "ONE_POINT",
    "PIECES",
    "REACH",
    "SETTLED_SECONDS",
    "STRUCTURES",
    "SWAB_RADIUS",
    "THESIS_PRESET",
    "TICKS_PER_SECOND",
    "TICK_SECONDS",
    "TOWARDS_HAND",
    "TOWARDS_VIEWER",
    "TROCARS",
    "TURNED",
    "TWO_POINTS",
    "VERTICES",
    "BeamModel",
    "BedPreset",
    "CarefulRun",
    "Clock",
    "Conditions",
    "CriticalView",
    "Dissection",
    "ErrorClass",
    "Event",
    "EventKind",
    "Exercise",
    "ExerciseInputs",
    "Feedback",
    "FluidReading",
    "FreeLength",
    "Ghost",
    "GhostReading",
    "GraspedBeam",
    "Grasper",
    "Guidance",
    "Hand",
    "HandContact",
    "Incident",
    "Input",
    "Instrument",
    "Limit",
    "Load",
    "Metric",
    "Metrics",
    "NextStep",
    "NickReading",
    "Opening",
    "OrganBeam",
    "OrganIdentity",
    "Outcome",
    "Performance",
    "Phase",
    "PlanarTissue",
    "Preset",
    "Reading",
    "Replay",
    "Rod",
    "RoundBeam",
    "Run",
    "RunFile",
    "RunFileError",
    "RunLog",
    "Safety",
    "Script",
    "Seen",
    "Series",
    "Session",
    "Sights",
    "SpatialTissue",
    "Specimen",
    "Spread",
    "Stay",
    "Step",
    "Stresses",
    "Structure",
    "SurfaceMapping",
    "SurfaceStress",
    "SwingingChain",
    "Technique",
    "Tenting",
    "TheoryChoice",
    "Tissue",
    "Trocar",
    "Tubes",
    "Vector",
    "anatomy_or_name",
    "bed_named",
    "bed_presets",
    "careful_run",
    "cause_of",
    "chosen_preset",
    "default_preset",
    "exercise_at",
    "exercises_offered",
    "fits",
    "free_specimen",
    "has_careful_run",
    "loading_rates",
    "near_place",
    "not_offered",
    "organ_beam",
    "perform",
    "performed",
    "pointed_at",
    "preset_named",
    "preset_toml",
    "presets",
    "pull_and_hold",
    "read_incidents",
    "read_preset",
    "read_run",
    "read_script",
    "renamed_exercise",
    "renamed_goal",
    "renamed_metrics",
    "renamed_numbers",
    "run_json",
    "seen_beside",
    "specimen_in_bed",
    "tear_front",
    "tear_swing",
    "turn_off",
    "wall_gap",
]
