"""What a trainee has in hand: a session of each scene that a page can begin with."""

from collections.abc import Callable
from threading import Lock
from typing import Literal, NamedTuple

from app.anatomy import Anatomy, CaseWorkbench, anatomy_named
from app.simulation import GRIP_N, Preset, Session, Specimen, free_specimen, specimen_in_bed
from app.trainer.client.picture_series import PictureSeries
from organ_geometry import Organ

SceneName = Literal["calot", "bed", "free"]
OLDER_NAMES: dict[str, SceneName] = {"dissect": "bed", "pull": "free", "anatomy": "calot"}
"""What scenes are called in files of exercises and classes."""


class Start(NamedTuple):
    """What a page begins with: words for it, and what makes its specimen of what is in hand."""

    label: str
    hint: str
    specimen: Callable[[Organ, Preset | None, Anatomy], Specimen]


def _anatomy(_: Organ, __: Preset | None, anatomy: Anatomy) -> Specimen:
    return Specimen.of_anatomy(anatomy, relaxation=True)


def _in_bed(organ: Organ, preset: Preset | None, _: Anatomy) -> Specimen:
    return specimen_in_bed(organ, preset, relaxation=True)


def _free(organ: Organ, preset: Preset | None, _: Anatomy) -> Specimen:
    return free_specimen(organ, preset)


SCENES: dict[SceneName, Start] = {
    "calot": Start(
        "Calot's triangle",
        "Dissect between gallbladder, cystic duct and common duct, through the scope (M)",
        _anatomy,
    ),
    "bed": Start(
        "A duct in its bed",
        "Free the duct from its bed, before it tears (M)",
        _in_bed,
    ),
    "free": Start(
        "A free duct",
        "Pull a duct that no bed holds, and compare theories of it (M)",
        _free,
    ),
}


class Practice:
    """A trainee's sessions, each made when it is first asked for; `scene` is shown.

    `own_anatomy` is what the trainer was started with, or None for the usual one; of a `case` that
    is built in the page it is the case as it is now. A page that is left notes the `hand` that was
    led and whether its picture was `plain`, for the one that is loaded in its place. `series`
    is how far *Who is who* has come.
    """

    def __init__(
        self,
        organ: Organ,
        preset: Preset | None,
        scene: SceneName | None = None,
        own_anatomy: Anatomy | None = None,
        case: CaseWorkbench | None = None,
    ) -> None:
        self._organ, self._preset = organ, preset
        self._own_anatomy, self.case = own_anatomy, case
        self.scene: SceneName | None = scene  # None until a page has opened
        self.hand, self.plain = 0, False
        self.series = PictureSeries()
        self._lock = Lock()
        self._sessions: dict[SceneName, Session] = {}

    @property
    def own_anatomy(self) -> Anatomy | None:
        """What the scene of several tubes shows first; the usual one when None."""
        return self._own_anatomy if self.case is None else self.case.case.anatomy

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
                anatomy = self.own_anatomy or anatomy_named("normal")
                specimen = SCENES[scene].specimen(self._organ, self._preset, anatomy)
                self._sessions[scene] = Session(specimen, grip_N=GRIP_N)
            return self._sessions[scene]

    def choose_anatomy(self, anatomy: Anatomy) -> None:
        """Begin with another anatomy."""
        with self._lock:
            self._sessions["calot"] = Session(_anatomy(self._organ, None, anatomy), grip_N=GRIP_N)

    def renew(self, organ: Organ, preset: Preset | None) -> None:
        """Begin with other ducts."""
        with self._lock:
            self._organ, self._preset = organ, preset
            self._sessions = {}
