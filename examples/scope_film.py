"""Film scripted hands at an anatomy through the laparoscope, by a headless Chromium.

python examples/scope_film.py docs/images/scope.webp [assets/scripts/hasty.toml]

It needs pip install 'bluntdissect[film]', and a Chromium.
"""

import sys
from pathlib import Path

from app.anatomy import anatomy_named
from app.simulation import Replay, Session, Specimen, performed, read_script
from app.trainer.pages.scope_film import write_film

ROOT = Path(__file__).parents[1]
SIDE = 340


def run_of(script: Path) -> Replay:
    """Return a replay of what a script does at the usual anatomy."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=300)
    performed(read_script(script), session)
    return Replay(session.run_file().log, session.tissue.dissection.organ)


if __name__ == "__main__":
    output = Path(sys.argv[1])
    script = Path(sys.argv[2]) if len(sys.argv) > 2 else ROOT / "assets" / "scripts" / "hasty.toml"
    print(write_film(run_of(script), output, side=SIDE), "pictures")
