"""What a trainee has in hand: a session of each scene that a page can begin with."""

from collections.abc import Callable
from functools import partial
from threading import Lock
from typing import Literal, NamedTuple, get_args

from app.anatomy import Anatomy, anatomy_named
from app.simulation import Preset, Session, Specimen, free_specimen, specimen_in_bed
from organ_geometry import Organ

__all__ = ["OLDER_NAMES", "SCENES", "Practice", "SceneName", "Start"]

SceneName = Literal["calot", "bed", "free"]
SCENE_NAMES: tuple[SceneName, ...] = get_args(SceneName)
OLDER_NAMES: dict[str, SceneName] = {"dissect": "bed", "pull": "free"}
"""What scenes were called before, and are in files of exercises and classes."""


class Start(NamedTuple):
    """What a page begins with: words for it, and what makes its specimen of an organ."""

    label: str
    hint: str
    specimen: Callable[[Organ, Preset | None], Specimen]


def usual_anatomy(_: Organ, __: Preset | None) -> Specimen:
    """Return the usual anatomy of Calot's triangle, whatever duct is in hand."""
    return Specimen.of_anatomy(anatomy_named("normal"))


SCENES: dict[SceneName, Start] = {
    "calot": Start(
        "Calot's triangle",
        "Dissect between gallbladder, cystic duct and common duct, through the scope (M)",
        usual_anatomy,
    ),
    "bed": Start(
        "A duct in its bed",
        "Free the duct from its bed, before it tears (M)",
        partial(specimen_in_bed, relaxation=True),
    ),
    "free": Start(
        "A free duct",
        "Pull a duct that no bed holds, and compare theories of it (M)",
        free_specimen,
    ),
}


class Practice:
    """A trainee's sessions, each made when it is first asked for; `scene` is shown."""

    def __init__(self, organ: Organ, preset: Preset | None, scene: SceneName | None = None) -> None:
        self._organ, self._preset = organ, preset
        self.scene: SceneName | None = scene  # None until a page has opened
        self._lock = Lock()
        self._sessions: dict[SceneName, Session] = {}

    def session(self, scene: SceneName) -> Session:
        """Return the session of a scene, of the organ that was chosen last."""
        with self._lock:
            if self.scene in self._sessions:
                shown = self._sessions[self.scene]
                chosen = shown.tissue.dissection
                if shown.specimen.anatomy is None and chosen.organ is not self._organ:
                    self._organ, self._preset = chosen.organ, chosen.preset
                    self._sessions = {self.scene: shown}
            if scene not in self._sessions:
                specimen = SCENES[scene].specimen(self._organ, self._preset)
                self._sessions[scene] = Session(specimen)
            return self._sessions[scene]

    def choose_anatomy(self, anatomy: Anatomy) -> None:
        """Begin with another anatomy."""
        with self._lock:
            self._sessions["calot"] = Session(Specimen.of_anatomy(anatomy))

    def renew(self, organ: Organ, preset: Preset | None) -> None:
        """Begin with other ducts."""
        with self._lock:
            self._organ, self._preset = organ, preset
            self._sessions = {}
