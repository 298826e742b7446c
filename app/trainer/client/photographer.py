"""Photographs for the record, which a page takes of its picture."""

from app.classroom.photograph import photograph_of
from app.trainer.client.page_state import BRIEF_SECONDS, PageState

BACK_NEXT = (
    "It is of the front, for the record. For one of the back, too, swing the gallbladder over and "
    "press H."
)
BOTH_KEPT = "Front and back go with the result."


class Photographer:
    """Asks a page for photographs, and keeps them with its state."""

    def __init__(self, state: PageState) -> None:
        self._state = state
        self._asked = False

    def ask(self) -> None:
        """Have the page take one with its next picture."""
        if self._state.playback is None:
            self._asked = True
            self._state.show()

    def take_request(self) -> bool:
        """Return whether one was asked for since the last call."""
        asked, self._asked = self._asked, False
        return asked

    def keep(self, url: object) -> None:
        """Keep one that the page has sent: the front first, then the back."""
        state = self._state
        try:
            taken = photograph_of(url)
        except ValueError as error:
            state.refuse(str(error))
            return
        state.photographs = [*state.photographs[-1:], taken]
        words = BACK_NEXT if len(state.photographs) == 1 else BOTH_KEPT
        state.client.add_notification("Photograph kept", words, auto_close_seconds=BRIEF_SECONDS)
        state.show()
