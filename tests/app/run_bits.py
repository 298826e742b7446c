"""Run as a program: digests of organs and runs, which may not depend on the processor."""

import hashlib
import sys
from pathlib import Path

import numpy as np
from any_code import any_code
from msgspec.structs import replace
from rl_bits import alone
from simulated import bed_session, phantom
from tubes import tube

from app.anatomy import anatomy_named, anatomy_toml, drawn_anatomy
from app.simulation import (
    FEW,
    Replay,
    Session,
    Specimen,
    performed,
    preset_named,
    read_run,
    read_script,
    run_json,
)
from assets import SCRIPTS
from physics.bed.space_beam import axis_line

RUNS = Path(__file__).parent / "runs"


def _bytes(*arrays: np.ndarray | None) -> bytes:
    return b"".join(each.tobytes() for each in arrays if each is not None)


def digests() -> list[str]:
    """Of organs, a pull, dissections of a duct and of tubes, drawn cases, what policies see."""
    found: list[bytes] = []
    organs = [any_code(seed, hollow=True).organ() for seed in range(8)]
    found += [_bytes(organ.axis, organ.frames, organ.outer, organ.lumen) for organ in organs]
    wall = (bent := tube(wall=0.7, sag=4.0)).section_properties(
        np.linspace(0.0, 50.0, 60), direction=np.array([0.1, 0.2, 1.0])
    )
    found.append(_bytes(wall.area, wall.second_moment, bent.up_at(bent.stations)))
    pull = read_run((RUNS / "version_1_hold.json").read_bytes())
    found.append(run_json(Replay(pull.log, phantom(), vertices=300).run_file()))
    torn = read_run((RUNS / "version_3_torn.json").read_bytes())
    found.append(run_json(Replay(torn.log, phantom(), vertices=300).run_file()))
    duct = preset_named("porcine-bile-duct")
    for preset in (duct, replace(duct, law="exponential", stiffening=6.0)):
        session = bed_session(phantom(), preset, bed_seed=3, vertices=300)
        start = session.grab(0, 20.0)
        assert start is not None
        for tick in range(12):
            session.move_hand(0, start + np.array([0.0, 0.3 * tick, 0.4 * tick]))
            session.advance()
        found.append(run_json(session.run_file()))
    for name in ("hasty", "tented"):
        session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=FEW)
        performed(read_script(SCRIPTS / f"{name}.toml"), session)
        found.append(_bytes(session.spatial.beam.places))
        run = session.run_file()
        again = Replay(run.log, session.tissue.dissection.organ)
        found += [run_json(run), run_json(again.run_file()), again.series().csv().encode()]
    found += [anatomy_toml(drawn_anatomy(seed)).encode() for seed in range(20)]
    offset = np.linspace(0.0, 50.0, 101)
    line = np.stack([offset, 3.0 * np.sin(offset / 9.0), 2.0 * np.cos(offset / 7.0)], axis=1)
    found.append(_bytes(*axis_line(line)))
    found += [each.encode() for each in alone([1, 2], 6, observation="both")]
    return [hashlib.sha256(each).hexdigest() for each in found]


if __name__ == "__main__":
    sys.stdout.write("\n".join(digests()))
