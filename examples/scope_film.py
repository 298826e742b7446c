"""Film scripted hands at an anatomy through the laparoscope, by a headless Chromium.

python examples/scope_film.py docs/images/scope-view.webp careful [folder of kept runs]

`bluntdissect perform -o careful.json` keeps a run, which saves its time here.

It needs pip install 'bluntdissect[film]', and a Chromium.
"""

import sys
from pathlib import Path

from app.anatomy import anatomy_named
from app.simulation import Replay, Session, Specimen, performed, read_run, read_script
from app.trainer.pages.scope_film import write_film

ROOT = Path(__file__).parents[1]
SIDE = 400


def run_of(script: str, kept: Path | None = None) -> Replay:
    """Return a replay of a script at the usual anatomy; of the run that is kept, where one is."""
    session = Session(Specimen.of_anatomy(anatomy_named("normal")), vertices=300)
    organ = session.tissue.dissection.organ
    if kept is not None and (path := kept / f"{script}.json").exists():
        return Replay(read_run(path.read_bytes()).log, organ)
    performed(read_script(ROOT / "assets" / "scripts" / f"{script}.toml"), session)
    return Replay(session.run_file().log, organ)


if __name__ == "__main__":
    output, script, *kept = sys.argv[1:]
    replay = run_of(script, *map(Path, kept))
    print(write_film(replay, Path(output), side=SIDE), "pictures")
