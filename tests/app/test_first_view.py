"""*First view* by mouse, wheel and keys alone, as docs/tutorials/first-view.md says it."""

import numpy as np
import pytest
from trainee import Floats, Trainee

from app.anatomy import anatomy_named
from app.simulation import Replay, exercise_at

LATERAL, UP, TO_VIEWER, OFF_THE_LIVER = (
    (0.2, 0.7, 0.65), (0.0, 0.0, 1.0), (0.0, -0.5, 0.8), (-0.68, -0.6, -0.42),
)  # fmt: skip
ACROSS = np.array([0.0, 1.0, 0.0])
"""In the picture from side to side: along it jaws part between duct and common duct."""
BELOW = np.array([0.0, 0.0, -2.0])


def beside_the_duct(trainee: Trainee) -> list[Floats]:
    """Return places along the cystic duct, on the common duct's side, from the neck down."""
    out: list[Floats] = []
    for station in (20.0, 16.0, 12.0, 9.0):
        along = trainee.at("cystic", station + 1.0) - trainee.at("cystic", station)
        side = np.array([along[1], -along[0], 0.0]) / np.hypot(along[0], along[1])
        out.append(trainee.at("cystic", station) + 2.8 * side + BELOW)
    return out


def between_gallbladder_and_liver(trainee: Trainee, station: float) -> None:
    """Part the plate beside the gallbladder, so far from its neck."""
    tube = trainee.session.spatial.tubes.network.tubes["gallbladder"]
    radius = float(np.interp(station, tube.stations, tube.radius))
    here = trainee.at("gallbladder", station)
    along = trainee.at("gallbladder", station + 2.0) - here
    towards_liver = np.array([0.75, 0.2, 0.3]) / np.linalg.norm([0.75, 0.2, 0.3])
    place = here + 1.3 * (radius + 1.5) * towards_liver
    trainee.spread(place, along / np.linalg.norm(along))


@pytest.mark.long  # four minutes of hands
def test_the_first_view_is_reached_by_mouse_and_keys_alone() -> None:
    """Three of six points in under five minutes with nothing torn, as the tutorial does it."""
    exercise = exercise_at(anatomy_named("normal"), "first_view")
    assert exercise is not None
    trainee = Trainee("normal", exercise)
    session = trainee.session
    # Draw the neck aside.
    trainee.hold(8.0)
    trainee.pull(LATERAL, 3.0)
    # Part the triangle.
    trainee.spread(np.array([43.0, 8.0, -2.0]), ACROSS)
    trainee.sweep(beside_the_duct(trainee))
    trainee.spread(np.array([44.0, 12.0, -3.0]), ACROSS)
    # Lift the neck, and go beside the duct again while nothing is taut.
    trainee.pull(UP, 8.0)
    trainee.pull(TO_VIEWER, 8.0)
    trainee.lead.choose(0)
    trainee.use()
    trainee.sweep(beside_the_duct(trainee))
    low = trainee.at("cystic", 8.0) - trainee.at("common", 34.0)
    trainee.spread(trainee.between("cystic", 8.0, "common", 34.0), low / np.linalg.norm(low))
    # Draw the gallbladder off the liver, and part what still holds it.
    trainee.hold(18.0)
    trainee.pull(OFF_THE_LIVER, 8.0)
    for station in (8.0, 3.0, 14.0):
        between_gallbladder_and_liver(trainee, station)
    trainee.pull(OFF_THE_LIVER, 6.0)
    for station in (12.0, 20.0):
        trainee.hold(station)
        trainee.pull(OFF_THE_LIVER, 8.0)
    for station in (18.0, 6.0):
        between_gallbladder_and_liver(trainee, station)
    trainee.hold(8.0)
    trainee.pull(UP, 8.0)
    trainee.pull(TO_VIEWER, 8.0)
    outcome = session.run.outcome
    assert outcome is not None
    assert outcome.passed, outcome.reason
    assert trainee.points() == (0, 1, 2)
    metrics = session.metrics()
    assert metrics["time_s"] < 300.0
    assert metrics["peak_stress_ratio"] < 0.9
    assert session.spatial.events == []
    kept = session.run_file()
    replay = Replay(kept.log, session.tissue.dissection.organ, tore=False)
    assert replay.run_file() == kept
