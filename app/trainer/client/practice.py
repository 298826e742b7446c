"""One trainee's ducts, in its bed and without one, and which of them is shown."""

from threading import Lock

from app.simulation import Preset, Session, free_specimen, specimen_in_bed
from app.trainer.client.client_state import Mode
from organ_geometry import Organ

__all__ = ["Practice"]


class Practice:
    """A trainee's two sessions, each made when it is first asked for; `mode` is shown."""

    def __init__(self, organ: Organ, preset: Preset | None, mode: Mode | None = None) -> None:
        self._organ, self._preset = organ, preset
        self.mode: Mode | None = mode  # None until a page has opened
        self._lock = Lock()
        self._pull: Session | None = None
        self._dissect: Session | None = None

    @property
    def pull(self) -> Session:
        """The session without a bed."""
        with self._lock:
            if self._pull is None:
                self._pull = Session(free_specimen(self._organ, self._preset))
            return self._pull

    @property
    def dissect(self) -> Session:
        """The session in a bed, of the organ that was chosen last."""
        with self._lock:
            if self._pull is not None:
                chosen = self._pull.tissue.dissection
                if chosen.organ is not self._organ:
                    self._organ, self._preset = chosen.organ, chosen.preset
                    self._dissect = None
            if self._dissect is None:
                self._dissect = Session(specimen_in_bed(self._organ, self._preset))
            return self._dissect

    def renew(self, organ: Organ, preset: Preset | None) -> None:
        """Begin with other ducts."""
        with self._lock:
            self._organ, self._preset = organ, preset
            self._pull = self._dissect = None
