"""One client's panel at an anatomy: what to reach, the hands, the scope, and what is in hand."""

import asyncio
import html
import math
from collections.abc import Callable, Mapping
from typing import Literal

import viser

from app.anatomy import (
    Anatomy,
    CaseWorkbench,
    anatomy_named,
    drawn_anatomy,
    shipped_anatomies,
    tube_title,
)
from app.simulation import (
    GRIP_N,
    HOLDING,
    ONE_POINT,
    TURNED,
    TWO_POINTS,
    Instrument,
    Reading,
    seen_beside,
)
from app.trainer.client.page_state import PageState
from app.trainer.client.practice import SceneName
from app.trainer.client.scope_lead import HOLDS_MM_S, NOTCH_MM, QUICK_TURNS, ScopeLead
from app.trainer.panel.case_tab import CaseTab
from app.trainer.panel.controls import (
    Choice,
    figure,
    note,
    number,
    on_click,
    on_input,
    on_work,
    rows_html,
    set_if_changed,
)
from app.trainer.panel.dialog import dialog
from app.trainer.panel.exercise_tab import ExerciseTab
from app.trainer.panel.frame import BUILD, LEARN, REPLAY, add_disclaimer
from app.trainer.panel.help import DEVICE_KEY, Key, first_minute
from app.trainer.panel.keys import add_keys
from app.trainer.panel.model_tab import SIMPLE_PICTURE
from app.trainer.panel.pointing import Pointing
from app.trainer.panel.readout import HANDS
from app.trainer.panel.replay_tab import ReplayTab
from app.trainer.panel.scenes import add_scenes
from app.trainer.viser_bridge.page import announce, bring_in, open_tab, take_arrows

GOAL = (
    "Clear the triangle of fat and loose tissue, until two tubes alone run into the gallbladder. "
    "Tear nothing. Learn leads you there step by step."
)
LOOKS = (
    "Choose a structure below, and press it in the picture. Where none can safely be told, choose "
    "<i>Not yet safe</i>. You may move the scope (Y)."
)
Leads = Literal["left", "right", "scope"]
LEADS: dict[Leads, tuple[str, str]] = {
    "left": ("Left hand", "Mouse and keys lead the left hand (X)"),
    "right": ("Right hand", "Mouse and keys lead the right hand (X)"),
    "scope": ("Scope", "Mouse and keys turn and slide the scope (Y)"),
}
LedBy = Literal["tip", "handle"]
LED_BY: dict[LedBy, tuple[str, str]] = {
    "tip": ("Tip", "The tip goes where the pointer goes (T)"),
    "handle": ("Handle", "Your hand is at the handle: the tip goes the other way (T)"),
}
Turn = Literal["left", "right", ""]
TURNS: Mapping[Turn, tuple[str, str]] = {
    "left": ("Left", "Turn jaws, a bent tip or the scope's cable left (J)"),
    "right": ("Right", "Turn jaws, a bent tip or the scope's cable right (L)"),
}
ROLLS: Mapping[Turn, tuple[str, str]] = {
    "left": ("Left", "Turn the scope's camera head left (Shift+J)"),
    "right": ("Right", "Turn the scope's camera head right (Shift+L)"),
}
ScopeChoice = Literal["straight", "oblique"]
SCOPES: dict[ScopeChoice, tuple[str, str]] = {
    "straight": ("0°", "A scope that looks straight ahead (Z)"),
    "oblique": ("30°", "A scope that looks aside, from above where its cable hangs down (Z)"),
}
DRAWN = "drawn"
MOST_SEED = 10**6
STEP = 0.5
"""mm that a key moves a tip by: towards a ring several times as far."""
TURN = 0.15
"""rad that a key turns jaws, the scope's cable or its camera's head by."""
TO_RING = "To the ring (I)"
COMING, OUT_FIRST = "on its way", "out of the tissue first (wheel back)"
LEAST_MM, FAR_OUT_MM, DRAWS_ASIDE_MM = 0.75, 6.0, 6.0
"""mm off a ring that are worth a move; behind it, from which on one comes out before one goes
aside; and to the side, that in tissue would draw that along."""
MARKS = "Mark what is next"
MARKED = "In exercises: a sentence, a ring where to, and a dot on each strand"
PLAIN = "Without webs and with fewer dots, for a machine without a graphics card"
ASSISTED = "The assistant holds the scope."
ASSISTED_STILL = "The assistant holds it until you move it."
YOU_HOLD = "You hold the scope. V gives it back."
FREE_CAMERA = "A free camera: drag to turn it. Shift+V looks through the scope again."
HOW_SCOPE = (
    "Drag in the picture to look aside; the wheel takes it in and out. J and L turn its cable, "
    "with Shift its camera's head and so the horizon. Y leads the hand again."
)
HOW_PX = 84
"""Height of four lines, pixels."""
SPREAD = "Lead the closed tip into the loose tissue, then part the jaws with the right button or G."
HOW: Mapping[Instrument, str] = {
    "hook": "Bring it to a tube, take hold with the right button or G, and pull gently.",
    "grasper": "Take hold with the right button or G, and drag. It stays where it is left.",
    "dissector": f"{SPREAD} Close them, and again deeper. J and L turn them about the shaft.",
    "right angle": f"{SPREAD} Its tip, bent by 90°, passes behind a tube: J and L turn it.",
    "swab": "Wipe along a tube: strands part before its soft tip.",
    "clip applier": "Bring the open jaws past a freed tube on either side, then the right button "
    "or G. J and L turn them.",
    "scissors": "The right button or G cuts what lies across between the blades: strands, and a "
    "tube that you have freed and clipped. J and L turn them; cut no wall in part.",
    "suction": "The right button or G starts it, and stops it. It takes up blood and bile.",
}
KEYS = (
    Key("Left", "arrowleft", "Move left", "the tip in the picture, or the scope's view"),
    Key("Right", "arrowright", "Move right", "the tip in the picture, or the scope's view"),
    Key("Up", "arrowup", "Move up", "the tip in the picture, or the scope's view"),
    Key("Down", "arrowdown", "Move down", "the tip in the picture, or the scope's view"),
    Key("Shift+Up", "arrowup", "In", "the instrument along its shaft, or the scope", "shift"),
    Key("Shift+Down", "arrowdown", "Out", "the instrument along its shaft, or the scope", "shift"),
    Key("G", "G", "Use the instrument", "take hold or let go; part or close; clip; cut; suck"),
    Key("O", "O", "Open the jaws", "by a millimetre"),
    Key("C", "C", "Close the jaws", "by a millimetre"),
    Key("I", "I", "Into the ring", "in an exercise: the tip goes into the ring by itself"),
    Key("K", "K", "Point", "in Critical view and Who is who: at the next structure, or no more"),
    Key("H", "H", "Photograph", "for the record: the front of the triangle, then the back"),
    Key("U", "U", "Not yet safe", "to tell structures apart, where an exercise asks"),
    Key("X", "X", "Other hand", "mouse and keys lead it"),
    Key("Y", "Y", "Scope", "mouse and keys lead it, or the hand again"),
    Key("T", "T", "Tip or handle", "which end of an instrument is led"),
    Key("N", "N", "Next instrument", "for the hand that is led"),
    Key("Z", "Z", "Other scope", "straight or oblique"),
    Key(
        "Shift+V",
        "V",
        "Free camera",
        "from all sides, or the scope again; not in an exercise",
        "shift",
    ),
    Key("B", "B", "Wipe the lens", "when blood has jetted at it, or it has touched tissue"),
    Key("J", "J", "Turn left", "the jaws about their shaft, or the scope's cable"),
    Key("L", "L", "Turn right", "the jaws about their shaft, or the scope's cable"),
    Key("Shift+J", "J", "Roll left", "the scope's camera head, and so the horizon", "shift"),
    Key("Shift+L", "L", "Roll right", "the scope's camera head, and so the horizon", "shift"),
    Key("V", "V", "Assistant", "gives the scope back to the assistant, who shows the triangle"),
    Key("P", "P", "Pause or go on", "time stands still; not in an exercise"),
    Key("R", "R", "Reset", "all whole again"),
)
ALWAYS = ("Z", "V", "Shift+V")
"""Keys that act while a replay is shown, too."""
TEXT = """\
**The mouse.** Press in the picture and the tip goes under the pointer; drag it, or what it holds.
In an exercise press on the **ring**, or the key **I**, and the tip goes there by itself; what it
holds goes there while you press. The **wheel** takes it in along its shaft (roll it away from you)
and out, as **Shift** with the arrows does. The **right button**, or **G**, uses the instrument.
With a **finger** drag; two fingers spread or pinch to take it in and out, on a trackpad too. Led
**by its handle**, as in the theatre, an instrument turns about its trocar: the tip goes the other
way.

**A gamepad.** The left stick moves the tip in the picture, the right one takes it in and out and
turns the jaws. **A** uses the instrument, **B** goes on to the other hand, **X** to the next
instrument and **Y** to the scope, **up** on the cross leads into the ring, **left** and **right**
on it roll the scope's camera head; the shoulder buttons close and open the jaws.

{INSTRUMENTS}

A hand that holds a tube goes at most {HOLDS} mm/s, whatever the mouse does, and stops when you let
go of the mouse: look at the stress while you pull. To clip and divide, free a tube all round first.

**The six points.** The critical view has three parts of up to 2 points each. *Two tubes alone*:
cystic duct and cystic artery, a point each, whose last millimetres before the gallbladder, and its
neck, are free all round ({TWO_POINTS} % of their strands). The *triangle* between them and the
common duct, and the lower third of the *cystic plate*: 1 point from {ONE_POINT} % of the strands
on, 2 from {TWO_POINTS} %. After a tear none counts.

**The stress.** *Highest stress* is of the wall that is strained most: at 100 % of its break it
tears. Where *Distance to break* is written, that is what is left of the 100 %.

**The scope.** An assistant holds it and keeps both tips in view. Choose *Scope*, or **Y**, to
lead it yourself, or drag with the middle button. The cable and the camera's head turn apart: the
cable, by **J** and **L** or **Shift** with the wheel, where an oblique scope looks; the head, by
**Shift+J** and **Shift+L** or **Alt** with the wheel, the horizon. **V** gives it back. A replay
shows what was seen, until you move the scope; **V** goes on with it. Blood that jets, and touch,
soil its lens; the key **B** wipes it.

**The free camera.** **Shift+V** shows the same tissue from all sides: drag in the picture to turn
it, and the wheel comes nearer. The scope stays where it is, and the run keeps what it sees;
**Shift+V** looks through it again. In an exercise there is none; in a replay of one, and for a
teacher who watches one, there is.

**What is computed.** Each tube is a beam in space, each strand a spring that yields, parts and
never heals. A wall tears where normal + bending stress is over its strength. Blood and bile flow
out of what is torn by the tubes' resistance; how they run and pool is drawn. The fat goes as the
strands under it part. The duodenum and the liver are drawn, and nothing meets them.
"""


NAMED_FROM = 0.01
"""Of its break, a stress whose tube is named."""


class ScopePanel:
    """One client's panel: it passes inputs to the session and shows its readings."""

    needs_redraw = False

    def __init__(
        self,
        state: PageState,
        lead: ScopeLead,
        scene: SceneName,
        choose_scene: Callable[[SceneName], None],
        choose_anatomy: Callable[[Anatomy], None],
        own_anatomy: Anatomy | None,
        case: CaseWorkbench | None = None,
    ) -> None:
        self._state, self._lead, self._show_anatomy = state, lead, choose_anatomy
        self._own = {} if own_anatomy is None else {f"{own_anatomy.name}, own": own_anatomy}
        self._announced = self._asked = ""
        self._brought_in: object = None  # the run whose first step was brought into the panel
        self._photographed: object = None  # the run whose view was photographed by itself
        gui = self._gui = state.client.gui
        add_scenes(gui, scene, choose_scene)
        take_arrows(state.client, True)
        self._goal = gui.add_html("")
        self._readout = gui.add_html("")
        self._pointing = Pointing(gui, state, lead)
        add_disclaimer(gui)
        tabs = gui.add_tab_group()
        with tabs.add_tab("Train"):
            self._add_hands()
        learn = tabs.add_tab(LEARN)
        with tabs.add_tab(REPLAY):
            self.replays = ReplayTab(gui, state)
        with learn:
            self.exercises = ExerciseTab(gui, state, self.replays.watch)
        if case is not None:
            with tabs.add_tab(BUILD):
                CaseTab(gui, state, case, choose_anatomy)
            if not case.practised:
                open_tab(state.client, BUILD)
        ask = gui.add_button("Help", icon=viser.Icon.HELP, color="gray")
        on_click(ask, self._show_help)
        self._add_keys()
        if state.in_exercise:  # the page was loaded or made anew
            open_tab(state.client, LEARN)
        self.show(state.shown.reading())

    def _add_hands(self) -> None:
        gui, lead = self._gui, self._lead
        self._leads = Choice(gui, "Led", LEADS, self._choose_led)
        self._led_by = Choice(gui, "By its", LED_BY, self._choose_led_by)
        self._hands = [self._add_hand(hand, name) for hand, name in enumerate(HANDS)]
        self._how = gui.add_html("")
        self._use = gui.add_button("Use", hint="Also the right button in the picture, or G")
        on_click(self._use, lead.use_instrument)
        # Neither stays chosen.
        Choice(gui, "Turn", TURNS, self._turn).show("")
        photograph = gui.add_button("Photograph (H)", icon=viser.Icon.CAMERA, color="gray",
                                    hint="For the record: the front, then the back")  # fmt: skip
        on_click(photograph, lead.photographer.ask)
        self._scope = Choice(gui, "Scope", SCOPES, lambda _: lead.change_scope())
        Choice(gui, "Head", ROLLS, self._roll).show("")
        self._wipe = gui.add_button("Wipe the lens", hint="Of blood and tissue (B)")
        on_click(self._wipe, lead.wipe_lens)
        self._held = gui.add_html("")
        self._add_anatomies()
        self._marks = gui.add_checkbox(MARKS, initial_value=self._state.marks_next, hint=MARKED)
        on_input(self._marks, lambda value: self._state.show(marks_next=value is True))
        self._plain = gui.add_checkbox(SIMPLE_PICTURE, initial_value=self._state.plain, hint=PLAIN)
        on_input(self._plain, lambda value: self._state.show(plain=value is True))
        reset = gui.add_button("Reset", icon=viser.Icon.REFRESH, hint="All whole again (R)")
        on_click(reset, self._reset)

    def show(self, reading: Reading) -> None:
        """Show a reading."""
        state, lead = self._state, self._lead
        leads: Leads = "scope" if lead.leads_scope else ("left", "right")[state.hand]
        self._leads.show(leads)
        self._led_by.show("handle" if lead.by_handle else "tip")
        for choice, hand in zip(self._hands, state.shown.tissue.hands, strict=True):
            set_if_changed(choice, value=hand.instrument)
        holder = state.shown.tissue.hands[state.hand]
        # Rooms of lines are kept, so that nothing below moves while one works.
        how = note(HOW_SCOPE if lead.leads_scope else HOW[holder.instrument], "how")
        set_if_changed(self._how, content=f"<div style='min-height:{HOW_PX}px'>{how}</div>")
        use = "The scope is led" if lead.leads_scope else f"{lead.use} (G)"
        set_if_changed(self._use, label=use, disabled=lead.leads_scope)
        set_if_changed(self._wipe, disabled=state.shown.spatial.lens.soil == 0.0)
        self._scope.show("oblique" if lead.held.oblique else "straight")
        assisted = ASSISTED_STILL if lead.leads_scope else ASSISTED
        held = assisted if lead.held.assisted else YOU_HOLD
        held = FREE_CAMERA if lead.free_camera else held
        set_if_changed(self._held, content=note(held, "scope"))
        self._show_goal()
        set_if_changed(self._readout, content=self._figures(reading))
        set_if_changed(self._plain, value=state.plain)
        set_if_changed(self._marks, value=state.marks_next)
        self._pointing.show()
        self._photograph_view()
        self.exercises.show()
        self.replays.show()
        torn = f"Torn: {', '.join(self._torn)}." if self._torn else "Nothing is torn."
        words = f"{torn} {self._asked}".strip()
        if words != self._announced:
            self._announced = words
            announce(state.client, words)

    def close(self) -> None:
        """Remove nothing: the client uploads nothing here."""

    def _photograph_view(self) -> None:
        """Take a photograph once the view is reached, if there is none."""
        state, run = self._state, self._state.session.run
        exercise = run.exercise
        if exercise is None or not run.going or state.playback is not None:
            return
        reached = bool(exercise.structures) and run.progress >= exercise.points_from > 0.0
        if reached and not state.photographs and run is not self._photographed:
            self._photographed = run
            self._lead.photographer.ask()

    def _show_goal(self) -> None:
        """Show what to reach, or what an exercise asks for next: at its start bring that in."""
        step = self._lead.asked.step
        asked = "" if step is None else step.words
        if step is not None and step.hand not in (None, self._state.hand):
            if "(G)" in asked:  # which is the led hand's
                asked = asked.replace("(G)", "(X, then G)")
            else:
                asked = f"{asked} (X leads it.)"
        elif self._lead.asked.tool is not None:
            asked = f"{asked} (N takes it.)"
        run, self._asked = self._state.session.run, asked
        if asked and run is not self._brought_in:
            self._brought_in = run
            bring_in(self._state.client, "next")
        words = html.escape(asked).replace("Next:", "<b>Next:</b>", 1)
        # The style of the page keeps room for three lines, and has the goal last on a phone.
        looks = run.exercise is not None and run.exercise.looks_only and not run.closed
        goal = note(LOOKS if looks else GOAL, "goal")
        content = note(words, "next") if asked else goal
        set_if_changed(self._goal, content=content)

    def _figures(self, reading: Reading) -> str:
        torn = self._torn
        hidden = not self._state.figures_visible
        stress = f"{100.0 * reading.stress_ratio:.0f} % of break"
        if reading.stress_ratio >= NAMED_FROM:
            stress = f"{tube_title(self._state.shown.spatial.most_stressed)}, {stress}"
        practised = self._state.playback is None
        rows = [] if hidden else [
            ("Highest stress", stress),
            *([("To turn", self._to_turn)] if practised else []),
            ("Strands broken", f"{reading.broken}"),
            *((f"{each.name.capitalize()} lost", f"{figure(each.lost_ml)} ml")
              for each in reading.fluids),
        ]  # fmt: skip
        names = self._state.shown.spatial.tubes.names
        if practised:
            rows = [*self._led, *rows]
        if practised and not hidden and self._state.in_exercise:
            so_far = self._state.session.run.standings[0]
            rows.insert(0, ("So far", html.escape(so_far)))
        if not hidden:
            rows += [("Nicked", each.words(tube_title(names[each.tube]))) for each in reading.nicks]
        if torn:
            rows.append(("<b>Torn</b>", f"<b>{', '.join(torn)}</b>"))
        table = rows_html(
            rows, "padding:1px 10px 1px 0;opacity:.85;white-space:nowrap", "text-align:right"
        )
        return (
            f"<table data-testid='readout' data-broken='{reading.broken}' data-torn='{len(torn)}' "
            f"style='margin:2px 12px 6px;width:calc(100% - 24px);font-size:13px'>{table}</table>"
        )

    @property
    def _led(self) -> list[tuple[str, str]]:
        """What mouse and keys lead, and where its tip is or what it holds: rows of one line."""
        tissue, hand = self._state.shown.spatial, self._state.hand
        holder = tissue.hands[hand]
        if self._lead.leads_scope:
            return [("Led", "the scope"), ("Tip", "-")]
        name, place = "Tip", "-"
        touched = 0 if holder.instrument in HOLDING else tissue.touched(hand)
        step, to_ring = self._lead.asked.step, self._lead.to_ring
        if (asked := self._lead.asked.tool) is not None:
            name, place = TO_RING, f"take the {asked} (N)"
        elif to_ring is not None:
            through = step is not None and step.through
            parts = holder.instrument not in HOLDING
            in_tissue = parts and not through and (touched > 0 or self._lead.meets_wall)
            moves = _moves(to_ring, holds=holder.node is not None, in_tissue=in_tissue)
            if self._lead.asked.in_ring and not (moves and step is not None and step.leads):
                moves = "in it"
            name, place = TO_RING, moves or COMING
        elif step is not None and step.hand is not None and step.hand != hand:
            name, place = TO_RING, f"lead the {HANDS[step.hand].lower()} (X)"
        elif holder.node is not None:
            place = f"holds the {tube_title(tissue.tubes.names[holder.tube])}"
        elif self._state.figures_visible:  # a picture of one eye does not tell how deep a tip is
            far, tube, side = seen_beside(
                tissue.beam, holder.place, self._lead.held.camera.axes, self._only_tube
            )
            wall = tube_title(tissue.tubes.names[tube])
            place = f"{max(far, 0.0):.0f} mm {side} the {wall}"
        led = f"{HANDS[hand].lower()}, {holder.instrument}"
        if touched and self._state.figures_visible:
            led = f"{led}, {touched} strand{'s' * (touched > 1)}"
        grip = tissue.grip_ratio(hand)
        if grip and self._state.figures_visible:
            led = f"{led}, {GRIP_N * grip:.1f} of {GRIP_N:.0f} N"
        return [("Led", led), (name, place)]

    @property
    def _only_tube(self) -> str | None:
        """The tube that the exercise is about, if that is one."""
        exercise = self._state.session.run.exercise if self._state.in_exercise else None
        about = () if exercise is None else exercise.about or ()
        return about[0] if len(about) == 1 else None

    @property
    def _to_turn(self) -> str:
        """How far the led jaws are off what the next step asks for."""
        off = None if self._lead.leads_scope else self._lead.asked.turn
        if off is None:
            return "-"
        if abs(off) < TURNED:
            return "as the bar"
        presses = math.ceil(abs(off) / (QUICK_TURNS * TURN))
        often = f", {presses} times" if presses > 1 else ""
        return f"{math.degrees(abs(off)):.0f}° ({'L' if off > 0.0 else 'J'}{often})"

    @property
    def _torn(self) -> list[str]:
        """Titles of the tubes that are torn."""
        events = self._state.shown.spatial.events
        return [tube_title(each.tube) for each in events if each.kind == "tear"]

    # Choices

    def _choose_led_by(self, end: LedBy) -> None:
        self._lead.by_handle = end == "handle"
        self._state.show()

    def _choose_led(self, leads: Leads) -> None:
        self._lead.choose(None if leads == "scope" else ("left", "right").index(leads))

    def _reset(self) -> None:
        """Make all whole; after pictures of *Who is who*, at the anatomy of before them."""
        if not self._state.leave_pictures():
            self._state.reset()

    def _turn(self, side: Turn) -> None:
        self._lead.turn(-TURN if side == "left" else TURN)

    def _roll(self, side: Turn) -> None:
        self._lead.move_scope(head=-TURN if side == "left" else TURN)

    def _add_hand(self, hand: int, name: str) -> viser.GuiDropdownHandle[Instrument]:
        state = self._state
        chosen = self._gui.add_dropdown(
            name,
            state.instruments,
            initial_value=state.hands[hand].instrument,
            hint="Its instrument (N: the next)",
        )
        on_input(chosen, lambda _: self._lead.choose_instrument(hand, chosen.value))
        return chosen

    def _add_anatomies(self) -> None:
        gui, anatomy = self._gui, self._state.session.specimen.anatomy
        names = list(shipped_anatomies())
        now = anatomy.name if anatomy is not None and anatomy.name in names else DRAWN
        now = next((name for name, own in self._own.items() if own == anatomy), now)
        self._anatomy = gui.add_dropdown(
            "Anatomy",
            [*self._own, *names, DRAWN],
            initial_value=now,
            hint="Your own, shipped, or drawn by frequencies",
        )
        self._seed = gui.add_number(
            "Seed", initial_value=anatomy.seed if now == DRAWN and anatomy is not None else 1,
            min=1, max=MOST_SEED, step=1, visible=now == DRAWN, hint="Of the anatomy that is drawn",
        )  # fmt: skip
        on_work(self._anatomy, lambda _: self._choose_anatomy())
        on_work(self._seed, lambda _: self._choose_anatomy())

    def _choose_anatomy(self) -> None:
        name, seed = self._anatomy.value, number(self._seed.value)

        def choose() -> None:
            self._state.require_no_exercise()
            if name in self._own:
                self._show_anatomy(self._own[name])
                return
            drawn = name not in shipped_anatomies()
            if drawn and not 1 <= seed <= MOST_SEED:
                raise ValueError(f"a seed is a whole number from 1 to {MOST_SEED:,}")
            self._show_anatomy(drawn_anatomy(int(seed)) if drawn else anatomy_named(name))

        self._state.attempt("Making the anatomy.", choose)

    def _show_help(self) -> None:
        with dialog(self._gui, "Help"):
            self._gui.add_html(first_minute(self._state.session))
            self._gui.add_markdown(_text() + _keys_text())

    def _add_keys(self) -> None:
        state, lead = self._state, self._lead
        actions: Mapping[str, Callable[[], object]] = {
            "Left": lambda: lead.step(-STEP, 0, 0),
            "Right": lambda: lead.step(STEP, 0, 0),
            "Up": lambda: lead.step(0, STEP, 0),
            "Down": lambda: lead.step(0, -STEP, 0),
            "Shift+Up": lambda: lead.step(0, 0, STEP),
            "Shift+Down": lambda: lead.step(0, 0, -STEP),
            "G": lead.use_instrument,
            "O": lambda: lead.open_more(1.0),
            "C": lambda: lead.open_more(-1.0),
            "I": lead.seek_ring,
            "K": lead.pointer.choose_next,
            "H": lead.photographer.ask,
            "U": lead.pointer.call_unsafe,
            "X": lead.choose_next,
            "Y": lead.choose_scope,
            "T": lambda: self._choose_led_by("tip" if lead.by_handle else "handle"),
            "N": lead.choose_next_instrument,
            "Z": lead.change_scope,
            "Shift+V": lead.switch_camera,
            "B": lead.wipe_lens,
            "J": lambda: self._turn("left"),
            "L": lambda: self._turn("right"),
            "Shift+J": lambda: self._roll("left"),
            "Shift+L": lambda: self._roll("right"),
            "P": lambda: state.set_paused(not state.paused),
            "R": lambda: asyncio.get_running_loop().run_in_executor(None, self._reset),
            "V": lead.give_scope_back,
        }
        add_keys(state, KEYS, actions, ALWAYS)


def _moves(to_ring: tuple[float, float, float], *, holds: bool, in_tissue: bool) -> str:
    """Return how to move a tip right, up and in, mm, in words: in and out in notches."""
    right, up, into = to_ring
    if in_tissue and math.hypot(right, up) > DRAWS_ASIDE_MM:
        return OUT_FIRST
    names = ("right", "left"), ("up", "down"), ("in", "out")
    numbers = right, up, into / NOTCH_MM
    across, along, notches = (
        f"{abs(far):.0f} {unit} {more if far > 0.0 else less}" if round(abs(far)) > 0 else ""
        for far, unit, (more, less) in zip(numbers, ("mm", "mm", "notches"), names, strict=True)
    )
    aside = ", ".join(filter(None, (across, along)))
    wheel = notches.replace("1 notches", "1 notch") if notches.startswith("1 ") else notches
    if holds:
        return ", then ".join(filter(None, (aside and f"drag {aside}", wheel)))
    # Far out comes first, and in last: one goes aside in front of the tissue.
    if into < -FAR_OUT_MM or math.hypot(right, up) <= LEAST_MM:
        return wheel
    return ", ".join(filter(None, (aside, wheel)))


def _text() -> str:
    each = "\n".join(f"- **{name.capitalize()}**: {how}" for name, how in HOW.items())
    return TEXT.format(
        INSTRUMENTS=each,
        HOLDS=f"{HOLDS_MM_S:g}",
        TWO_POINTS=f"{100.0 * TWO_POINTS:.0f}",
        ONE_POINT=f"{100.0 * ONE_POINT:.0f}",
    )


def _keys_text() -> str:
    listed = "\n".join(f"- **{key.name}** {key.title}: {key.meaning}" for key in KEYS)
    return f"\n**Keys**\n\n{listed}\n- **M** The next scene\n{DEVICE_KEY}\n"
