"""A duct between two clamps that is pulled, measured, torn and replayed; no viewer in it.

What is listed here is the package's public face; other packages import from it and not by path.
`app.simulation.bed` has the duct in its bed of tissue.
"""

from app.simulation.clock import TICK_SECONDS, TICKS_PER_SECOND, Clock
from app.simulation.comparison import Ghost, GhostReading, SwingingChain
from app.simulation.dissection import PIECES, Dissection, default_preset, fits, organ_beam
from app.simulation.drawn_duct import Stresses, SurfaceStress
from app.simulation.duct import Duct, Reading
from app.simulation.exercise import (
    TITLES,
    ApproachBreak,
    BedExercise,
    Exercise,
    ExerciseInputs,
    Feedback,
    GentleDissection,
    HoldStretch,
    Outcome,
)
from app.simulation.grasped_beam import BeamModel, GraspedBeam
from app.simulation.grasper import Grasper, Load
from app.simulation.inputs import HOLDING, INSTRUMENTS, Input, Instrument, TheoryChoice
from app.simulation.measures import Measures
from app.simulation.metrics import DISTANCE_TO_BREAK, METRICS, Metric, Metrics, metrics_of
from app.simulation.older_runs import read_run, renamed_exercise, renamed_metrics
from app.simulation.preset import (
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
from app.simulation.replay import AFTER_TEAR, FEW, Replay, Series, loading_rates
from app.simulation.run import Run
from app.simulation.run_file import (
    MOST_BYTES,
    OrganIdentity,
    RunFile,
    RunFileError,
    RunLog,
    run_json,
)
from app.simulation.scripted_hand import CAREFUL, do_exercise
from app.simulation.session import VERTICES, Session
from app.simulation.specimen import Specimen
from app.simulation.tear import FRONT_SECONDS, SETTLED_SECONDS, Phase, tear_front, tear_swing

__all__ = [
    "AFTER_TEAR",
    "ASSUMED_PRESET",
    "CAREFUL",
    "DISTANCE_TO_BREAK",
    "FEW",
    "FRONT_SECONDS",
    "HOLDING",
    "INSTRUMENTS",
    "LIMITS",
    "METRICS",
    "MOST_BYTES",
    "PIECES",
    "SETTLED_SECONDS",
    "THESIS_PRESET",
    "TICKS_PER_SECOND",
    "TICK_SECONDS",
    "TITLES",
    "VERTICES",
    "ApproachBreak",
    "BeamModel",
    "BedExercise",
    "Clock",
    "Dissection",
    "Duct",
    "Exercise",
    "ExerciseInputs",
    "Feedback",
    "GentleDissection",
    "Ghost",
    "GhostReading",
    "GraspedBeam",
    "Grasper",
    "HoldStretch",
    "Input",
    "Instrument",
    "Load",
    "Measures",
    "Metric",
    "Metrics",
    "OrganBeam",
    "OrganIdentity",
    "Outcome",
    "Phase",
    "Preset",
    "Reading",
    "Replay",
    "RoundBeam",
    "Run",
    "RunFile",
    "RunFileError",
    "RunLog",
    "Series",
    "Session",
    "Specimen",
    "Spread",
    "Stresses",
    "SurfaceStress",
    "SwingingChain",
    "TheoryChoice",
    "chosen_preset",
    "default_preset",
    "do_exercise",
    "fits",
    "loading_rates",
    "metrics_of",
    "organ_beam",
    "preset_named",
    "preset_toml",
    "presets",
    "read_preset",
    "read_run",
    "renamed_exercise",
    "renamed_metrics",
    "run_json",
    "tear_front",
    "tear_swing",
]
