"""The scene of an anatomy: its picture through a scope, and what mouse and fingers do there."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import viser
from numpy.typing import NDArray

from app.anatomy import anatomy_network, tube_title
from app.simulation import Reading, Session
from app.trainer.client.scope_lead import ScopeLead
from app.trainer.scope.drawn_tissue import draw_tissue, picture_of
from app.trainer.scope.held_scope import HeldScope
from app.trainer.scope.picture import ScopePicture
from app.trainer.scope.surroundings import working_place
from app.trainer.stage.lighting import Look
from app.trainer.viser_bridge.page import keep_in_sight, run_function
from app.trainer.viser_bridge.private_api import page_number

Floats = NDArray[np.float64]

WARNED_FROM, WARNED_EACH = 0.8, 0.05
"""Of its break, from where on a wall is warned of, and in what steps."""
SCOPE, POINTS = -1, -2
"""In the place of a hand: the pointer leads the scope, or marks what it points at."""

FREE_MM, FREE_NEAREST_MM = 60.0, 15.0
"""From the triangle, within which what a free camera turns about stays; and how near it comes."""

_NO_MARKS: tuple[tuple[int, ...], tuple[float, ...] | None] = (), None

MOST = 1e6
"""Largest number that a page's pointer or gamepad sends: mm, notches or rad."""


class ScopeScene:
    """One client's picture of its session's anatomy through a scope.

    The look is "plain" for slow machines. What the pointer does goes to `led`.
    """

    def __init__(
        self, client: viser.ClientHandle, session: Session, look: Look, led: ScopeLead
    ) -> None:
        self._client, self._session, self._look = client, session, look
        self._own, self._led = led.held, led
        self._held = self._own  # the scope through which the session is seen
        client.scene.set_up_direction("+z")
        self._picture: ScopePicture | None = None
        # as the page has it: a hand or what else is led, by which end, where the cross is
        self._leads: tuple[int, tuple[float, float] | None] | None = None
        self._warning = ""
        self._lit: int | None = None  # the hand that is lit, as the page has it
        self._free = False  # whether the page has its own camera
        # The strands that are to be marked and the ring, as they are and as the page has them.
        self._asked = self._marks = _NO_MARKS
        self._frame = client.scene.add_frame("/scope", show_axes=False)
        self._pointer: viser.GuiTextHandle | None = None
        self._photograph: viser.GuiTextHandle | None = None
        self.draw(session.reading())

    def watch(self, session: Session) -> None:
        """Show another session, at an anatomy, from the next `draw` on.

        A replay, and another's session, have a scope of their own: one's own stays as it is held.
        """
        anatomy = session.specimen.anatomy
        if session is self._session or anatomy is None:
            return
        own = session is self._led.session
        held = self._own if own else HeldScope(anatomy_network(anatomy))
        if anatomy != self._held.made.anatomy:
            self._clear()
        held.show(session.spatial.pose)
        self._session, self._held, self._led.held = session, held, held

    def set_look(self, look: Look) -> None:
        """Use another look from the next `draw` on."""
        if look != self._look:
            self._look = look
            self._clear()

    def advance(self, ticks: int) -> bool:
        """Lead the hands, and let the assistant follow; return whether the picture is another."""
        self._led.advance(ticks)
        self._asked = self._led.asked.to_part, self._led.asked.ring
        tissue = self._session.spatial
        held = self._held
        freed = self._free != self._led.free_camera
        before = held.pose, held.oblique
        if self._session is not self._led.session and held.show(tissue.pose):
            return freed or before != (held.pose, held.oblique)
        tips = [hand.place for hand in tissue.hands]
        moved = [held.advance(tips) for _ in range(ticks)]
        # What is asked for next changes while all stands still, too.
        return freed or any(moved) or self._marks != self._asked

    def draw(
        self,
        reading: Reading,
        colours: object = "tissue",
        *,
        figures: bool = True,
        overlay: bool = False,
        lit: int | None = None,
    ) -> None:
        """Draw the session as it is now, as the camera sees it; `figures` warn of a break.

        A hand that is `lit` has made an error.
        """
        draw_tissue(self._set_picture(), self._session.spatial, self._held)
        warning = self._near_break(reading) if figures else ""
        if warning != self._warning:
            self._warning = warning
            run_function(self._client.scene, "bluntdissectScope.warn", warning)
        if lit != self._lit:
            self._lit = lit
            run_function(self._client.scene, "bluntdissectScope.light", lit)
        led = self._led
        if led.free_camera != self._free:
            self._free = led.free_camera
            if self._free:
                self._frame_free_camera()
            run_function(self._client.scene, "bluntdissectScope.setFree", self._free)
        (marked, ring), self._marks = self._marks, self._asked
        if marked != self._marks[0]:
            run_function(self._client.scene, "bluntdissectScope.mark", self._marks[0])
        if ring != self._marks[1]:
            run_function(self._client.scene, "bluntdissectScope.ring", self._marks[1])
        cross = led.pointer.cross
        hand = POINTS if cross is not None else SCOPE if led.leads_scope else led.hand
        leads = hand, cross
        # It is of what the scope sees.
        if self._photograph is not None and not self._free and led.photographer.take_request():
            number = page_number(self._photograph)
            run_function(self._client.scene, "bluntdissectScope.photograph", number)
        if self._pointer is not None and leads != self._leads:
            self._leads = leads
            number = page_number(self._pointer)
            run_function(self._client.scene, "bluntdissectScope.lead", number, *leads)

    def _near_break(self, reading: Reading) -> str:
        """Return which wall is near its break and how near; nothing of torn ones."""
        steps = int(reading.stress_ratio / WARNED_EACH)
        if not WARNED_FROM <= steps * WARNED_EACH <= 1.0:
            return ""
        wall = tube_title(self._session.spatial.most_stressed)
        return f"{wall}: over {100.0 * steps * WARNED_EACH:.0f} % of its break"

    @property
    def view(self) -> Sequence[float]:
        """Whence the tissue is seen."""
        return self._held.view

    def say_standing(self, *, figures: bool) -> None:
        """Nothing is written into the picture of a camera."""

    def lead_into_picture(self, into: bool) -> None:
        """Leave it to the wheel, which leads along the shaft; drags never do."""

    def let_drag(self, grabbed: object, moved: object, released: object) -> None:
        """Let mouse and fingers in the picture lead what `led` does."""
        # What the page tells of the pointer; nobody sees it.
        self._pointer = message = self._client.gui.add_text("Pointer", "", visible=False)
        self._leads = None

        @message.on_update
        async def _(_: object) -> None:  # pyright: ignore[reportUnusedFunction]
            self.take(message.value)

        self._photograph = picture = self._client.gui.add_text("Photograph", "", visible=False)

        @picture.on_update
        async def _(_: object) -> None:  # pyright: ignore[reportUnusedFunction]
            self._led.photographer.keep(picture.value)

    def frame_camera(self) -> None:
        """Give the scope back to the assistant, who looks at the triangle."""
        self._held.home()

    def _frame_free_camera(self) -> None:
        """Let the free camera begin where the scope's is, and turn about what that looks at."""
        camera, middle = self._held.camera, working_place(self._held.made)
        back = camera.axes[:, 2]
        keep_in_sight(
            self._client,
            place=camera.tip,
            target=camera.tip - back * float((camera.tip - middle) @ back),
            low=middle - FREE_MM,
            high=middle + FREE_MM,
            nearest=FREE_NEAREST_MM,
            lowest=float(middle[2]),
        )

    def remove(self) -> None:
        """Remove everything from the scene."""
        self._clear()
        self._frame.remove()

    def take(self, message: str) -> None:
        """Take what the page tells of pointer and gamepad; what is malformed is ignored."""
        led, (kind, numbers) = self._led, _read(message)
        acts: Mapping[str, tuple[int, Callable[..., object]]] = {
            "press": (6, led.press), "drag": (6, led.drag), "stop": (0, led.stop),
            "back": (0, led.take_back), "rest": (0, led.rest),
            "wheel": (1, led.wheel), "nudge": (3, led.nudge),
            "turn": (1, led.turn), "open": (1, led.open_more), "act": (0, led.use_instrument),
            "hand": (0, led.choose_next), "view": (0, led.choose_scope),
            "instrument": (0, led.choose_next_instrument), "ring": (0, led.seek_ring),
            "scope": (5, led.move_scope),
            "point": (3, lambda *place: led.pointer.mark(np.array(place))),
        }  # fmt: skip
        count, act = acts.get(kind, (-1, None))
        if act is not None and len(numbers) == count:
            act(*numbers)

    def _set_picture(self) -> ScopePicture:
        """Return the picture, made anew for another anatomy or look."""
        if self._picture is None:
            self._picture = picture_of(
                self._client.scene,
                self._held.made,
                self._session.spatial,
                self._held.scope,
                plain=self._look == "plain",
            )
            self._leads, self._warning, self._marks, self._lit = None, "", _NO_MARKS, None
            self._free = False
        return self._picture

    def _clear(self) -> None:
        if self._picture is not None:
            self._picture.remove()
            self._picture = None


def _read(message: str) -> tuple[str, list[float]]:
    """Return the kind and the numbers of what a page tells; no kind where it is malformed."""
    fields = message.split(" ", 7)[1:]  # the first counts, so that no two are alike
    try:
        numbers = [float(each) for each in fields[1:]]
    except ValueError:
        return "", []
    if not fields or not all(abs(each) <= MOST for each in numbers):  # which no NaN is
        return "", []
    return fields[0], numbers
