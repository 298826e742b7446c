"""Record careful hands in *Critical view*, which take a minute to compute: *Show me* plays them.

python examples/careful_run.py assets/runs/critical_view.json.xz
"""

import sys
from pathlib import Path

from app.anatomy import anatomy_named
from app.simulation import (
    CarefulRun,
    Session,
    Specimen,
    exercises_offered,
    performed,
    read_script,
)
from assets import SCRIPTS
from organ_geometry import write_atomic


def recorded() -> CarefulRun:
    """Return the run of both scripts one after the other; nothing slips out of their grasper."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=300)
    session.start_exercise(
        next(each for each in exercises_offered(session) if each.name == "critical_view")
    )
    for script in ("careful", "clip-and-divide"):
        performed(read_script(SCRIPTS / f"{script}.toml"), session)
    return CarefulRun(session.run_file(), session.run.incidents())


if __name__ == "__main__":
    made = recorded()
    write_atomic(Path(sys.argv[1]), made.packed())
    print(made.run.outcome, made.run.metrics["time_s"], "s,", len(made.incidents), "errors")
