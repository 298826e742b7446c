"""Take four stills through the laparoscope, drawn by a headless Chromium.

python examples/scope_stills.py docs/images [folder of kept runs] [names of stills]

It needs pip install 'bluntdissect[film]', and a Chromium.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import cv2
from scope_film import run_of

from app.anatomy import anatomy_named, anatomy_network
from app.trainer.pages.scope_film import filmed
from app.trainer.pages.scope_player import follow
from app.trainer.scope.held_scope import HeldScope

SIZE = 1280, 800
QUALITY = 85


class Still(NamedTuple):
    """A moment of a script, s, and how much deeper the scope is held than by its assistant, mm."""

    name: str
    script: str
    seconds: float
    deeper: float = 0.0


STILLS = (
    Still("scope-covered", "careful", 6.0),
    Still("scope-webs", "careful", 300.0, 22.0),
    Still("scope-window", "careful", 525.0, 8.0),
    Still("scope-bleeding", "hasty", 5.0),
)


def take(still: Still, folder: Path, kept: Path | None) -> None:
    """Take one still."""
    replay, held = run_of(still.script, kept), HeldScope(anatomy_network(anatomy_named("normal")))
    with filmed(replay, held, SIZE) as picture:
        at = 0.0
        # On the way blood runs and the sheet gives way, as in a run that is watched.
        for seconds in (*range(1, int(still.seconds)), still.seconds):
            replay.seek(seconds)
            follow(held, replay.session, round(30 * (seconds - at)))
            at = seconds
            if still.seconds - at < 3.5:
                picture()
        held.move(depth=still.deeper)
        for _ in range(2):  # the camera's head brightens it step by step
            picture()
        shot = picture()
    cv2.imwrite(str(folder / f"{still.name}.webp"), shot, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])


if __name__ == "__main__":
    kept = Path(sys.argv[2]) if len(sys.argv) > 2 else None
    only = sys.argv[3:] or [each.name for each in STILLS]
    for each in STILLS:
        if each.name in only:
            take(each, Path(sys.argv[1]), kept)
            print(each.name)
