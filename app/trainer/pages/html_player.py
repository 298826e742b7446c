"""Pages that play a motion of an organ by themselves, without a server."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import viser
from numpy.typing import NDArray
from viser import transforms

from app.export.motion import Motion
from app.export.organ_export import OrganExport
from app.export.recorded_run import RecordedRun
from app.simulation import PIECES, Dissection, Phase, Reading
from app.trainer.stage.appearance import appearance_of, drawn_radius
from app.trainer.stage.camera import viewpoint
from app.trainer.stage.contact import Contact, HookPlace, sink
from app.trainer.stage.hook import LIFT_AFTER_TEAR
from app.trainer.stage.lighting import fill_air
from app.trainer.stage.stage import Stage
from app.trainer.stage.strands import NUMBERS, PARTED, DrawnStrands, film_pairs
from app.trainer.stage.tissue import Tissue, send_finish
from app.trainer.viser_bridge.recording import recording_page, unseen_server, write_caption
from organ_geometry import Organ
from organ_geometry.mesh import BoundSkin, TornPiece, organ_skin

VERTICES = 2400
"""Vertices of a page's skin, about; every one is written at every key."""
MOST_VERTICES = 12_000
"""Most vertices of a page's skin: with more, a hundred keys are too large to open or to send."""
# Most vertices times keys: a page of thirty megabytes before compression.
MOST_PLACES = 2_500_000
UNITS = "Forces in N, lengths in mm."
DRAWN_NOT_COMPUTED = "How a tear gapes and swings back is drawn, not computed."
GRID = 1.0 / 256.0
"""Vertices, mm, and shades are rounded to multiples of this: invisible, and half the file."""
REST_SECONDS, END_SECONDS = 0.6, 1.2
"""s of rest before and after the motion."""
ASPECT = 16.0 / 9.0


@dataclass(frozen=True, slots=True, eq=False)
class _Body:
    """A moving surface, the whole organ or a piece, and how it is drawn."""

    bound: BoundSkin
    piece: TornPiece | None
    contact: Contact
    tissue: Tissue
    vertices: NDArray[np.float32]

    def show(
        self,
        pose: NDArray[np.float64],
        front: float,
        hook: HookPlace | None = None,
        *,
        visible: bool = True,
    ) -> None:
        self.bound.deform(pose, self.vertices)
        if self.piece is not None:
            self.piece.open(front, self.vertices)
        self.contact.mark(self.vertices, hook)
        self.tissue.show(_rounded(self.contact.vertices), _rounded(self.contact.shade))
        self.tissue.set_visible(visible)


def page_edge_length(organ: Organ, vertices: int = VERTICES) -> float:
    """Return the edge length, mm, that gives an organ about this number of vertices."""
    walls = 2 if organ.hollow else 1
    area = walls * 2.0 * math.pi * organ.mean_radius * organ.length
    return min(math.sqrt(area / vertices), 0.4 * organ.mean_radius)


def export_page(export: OrganExport, *, edge_length: float) -> str:
    """Return a page that plays an export's motion."""
    dissection, motion = export.dissection, export.page_motion()
    notes = [
        f"{dissection.beam.span:.1f} mm between the clamps{export.note}",
        f"Solved as {export.specimen.section}.",
    ]
    pieces = None if motion.whole.all() else export.pieces(edge_length)
    return player_page(dissection, motion, notes, edge_length=edge_length, pieces=pieces)


def run_page(run: RecordedRun, *, edge_length: float) -> str:
    """Return a page that plays a recorded run."""
    dissection, motion = run.dissection, run.motion
    ended = "."
    if run.torn:
        tearing = (each.force for each in motion.readings if each.phase is Phase.TEARING)
        ended = f"; it tore at {max(tearing):.3g} N."
    divided = motion.bed is not None and motion.bed.divided
    where = "of a duct divided at its end" if divided else "between the clamps"
    notes = [
        f"A recorded run of {run.seconds:.1f} s on {dissection.beam.span:.1f} mm {where}{ended}"
    ]
    pieces = run.pieces(edge_length=edge_length)
    return player_page(dissection, motion, notes, edge_length=edge_length, pieces=pieces)


def player_page(
    dissection: Dissection,
    motion: Motion,
    notes: Sequence[str],
    *,
    edge_length: float,
    pieces: tuple[TornPiece, TornPiece] | None = None,
) -> str:
    """Return a page that plays a motion of an organ, with notes beside the picture."""
    skin = organ_skin(dissection.organ, edge_length=edge_length)
    if len(skin.vertices) > MOST_VERTICES:
        raise ValueError(
            f"edge_length of {edge_length:g} mm gives {len(skin.vertices):,} vertices and a page "
            f"holds at most {MOST_VERTICES:,}, each written at every key; take a larger one"
        )
    keys = len(motion.times)
    if len(skin.vertices) * keys > MOST_PLACES:
        raise ValueError(
            f"{keys:,} keys of {len(skin.vertices):,} vertices are too many: a page holds at most "
            f"{MOST_PLACES // len(skin.vertices):,} such keys; take fewer frames or longer edges"
        )
    bound = skin.bound_to(dissection.driving)
    drawn = "" if pieces is None else f" {DRAWN_NOT_COMPUTED}"
    with unseen_server() as server:
        return _recorded(server, dissection, motion, bound, pieces, [*notes, f"{UNITS}{drawn}"])


def _recorded(
    server: viser.ViserServer,
    dissection: Dissection,
    motion: Motion,
    bound: BoundSkin,
    pieces: tuple[TornPiece, TornPiece] | None,
    notes: Sequence[str],
) -> str:
    """Return the page of a server's scene, recorded key by key."""
    scene = server.scene
    first, last = dissection.organ.axis_at(np.array(dissection.clamps))
    hooks = np.array([reading.hook for reading in motion.readings])
    look = appearance_of(dissection.preset)
    stage = Stage(
        scene,
        span=float(np.linalg.norm(last - first)),
        radius=drawn_radius(dissection),
        appearance=look,
        # A page would unpack the environment map again at each loop of the motion.
        look="plain",
    )
    lift = float(hooks[:, 2].max()) + 1.5 * stage.radius
    view = viewpoint(stage.span, stage.radius, ASPECT, lift=lift)
    fill_air(scene, distance=view.distance)
    camera = server.initial_camera
    camera.position, camera.look_at, camera.up = view.position, view.look_at, view.up
    camera.fov, camera.near, camera.far = view.fov, 1.0, 20.0 * view.distance
    turn = transforms.SO3.from_matrix(dissection.frame.T)
    scene.add_frame("/organ", show_axes=False, wxyz=turn.wxyz, position=turn.apply(-first))
    scene.add_frame("/finish", show_axes=False, position=(0.5 * stage.span, 0.0, 0.0))
    send_finish(scene, look, stage.radius)
    divided = motion.bed is not None and motion.bed.divided
    stage.show_second_clamp(not divided)

    def add(name: str, bound: BoundSkin, piece: TornPiece | None = None) -> _Body:
        """Add a surface; a piece is added as it is before the tear opens."""
        contact = Contact.of(dissection, bound.skin, divided=divided)
        tissue = Tissue.of(scene, name, contact, dissection, divided=divided)
        body = _Body(bound, piece, contact, tissue, bound.skin.vertices.copy())
        body.show(dissection.rest_transforms(), 0.0)
        return body

    whole = add("organ", bound)
    torn = [
        add(name, piece.skin.bound_to(dissection.driving), piece)
        for name, piece in zip(PIECES, pieces or (), strict=False)
    ]
    strands = None if motion.bed is None else _PageStrands(scene, stage, motion, dissection)
    written = ""

    # At these keys the hidden surfaces are sent as they are at the key where they appear next.
    comes_apart = int(motion.whole.sum())
    turns = {0: comes_apart, comes_apart: 0} if torn else {}

    def show(key: int) -> None:
        nonlocal written
        is_whole = bool(motion.whole[key])
        center = hooks[key]
        place: HookPlace | None = None
        if is_whole:
            used = 1.0 - motion.readings[key].check.distance_to_break
            center = np.add(center, (0.0, 0.0, sink(used, stage.radius)))
            if motion.bed is None or motion.readings[key].held:
                middle = first + dissection.frame @ center
                place = HookPlace(middle, dissection.frame, stage.radius)
        elif motion.fronts[key] >= 1.0:
            center = np.add(center, (0.0, 0.0, LIFT_AFTER_TEAR * stage.radius))
        stage.place_hook(center)
        # Sent ahead while hidden: a page takes a moment to read a surface.
        shown, hidden = ([whole], torn) if is_whole else (torn, [whole])
        if key in turns:
            at = turns[key]
            for number, body in enumerate(hidden):
                pose = motion.of_piece(number).transforms[at]
                body.show(pose, float(motion.fronts[at]), visible=False)
        for number, body in enumerate(shown):
            pose = motion.of_piece(number).transforms[key]
            body.show(pose, float(motion.fronts[key]), place)
        if strands is not None:
            strands.show(key)
        freed = None if motion.bed is None else float(motion.bed.freed[key])
        words = _caption(motion.readings[key], freed)
        if written != words:
            written = words
            write_caption(server, written)

    # At a loop the page keeps whatever the recording does not set again. So the recording starts by
    # going to the end and back to the start, which sets all that differs between them.
    times = motion.times.tolist()
    if torn:
        show(comes_apart)
    show(len(times) - 1)
    record = server.get_scene_serializer()
    show(0)
    record.insert_sleep(REST_SECONDS)
    for key in range(1, len(times)):
        record.insert_sleep(times[key] - times[key - 1])
        show(key)
    record.insert_sleep(END_SECONDS)
    html = record.as_html(dark_mode=True)
    label = dissection.preset.label
    return recording_page(html, label, notes, distance=view.distance, aspect=ASPECT)


class _PageStrands:
    """A bed's strands in a page, drawn by the trainer's own script."""

    def __init__(self, scene: viser.SceneApi, stage: Stage, run: Motion, duct: Dissection) -> None:
        assert run.bed is not None  # noqa: S101 (the caller has looked)
        self._run, self._duct, surface = run, duct, run.bed.surface
        self._first = duct.axis_point(0.0)
        self._strands = strands = surface.strands
        self._drawn = DrawnStrands(
            scene,
            self._numbers(0),
            feet=(run.bed.feet[:, 0] - self._first) @ duct.frame,
            toughness=strands.stiffness * strands.yield_elongation * strands.failure_elongation,
            pairs=film_pairs(strands.stations, surface.strand_angles()),
            rods=0,
            stage=stage,
            fibres=1,
        )

    def show(self, key: int) -> None:
        """Draw them as they are at a key."""
        self._drawn.send(self._numbers(key))

    def _numbers(self, key: int) -> NDArray[np.float32]:
        now = self._run.strands_at(key, self._duct.driving)
        assert now is not None  # noqa: S101 (it is on a bed)
        strands, reach = self._strands, now.ends[:, 0] - now.feet[:, 0]
        elongation = np.sqrt((reach**2).sum(axis=1)) - strands.length
        out = np.zeros((len(reach), NUMBERS), np.float32)
        out[:, :3] = (now.ends[:, 0] - self._first) @ self._duct.frame
        failure = strands.failure_elongation
        out[:, 3] = elongation / np.where(elongation > 0.0, failure, strands.length)
        out[now.parted, 3] = PARTED
        return _rounded(out).ravel()


def _rounded(numbers: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.rint(numbers / np.float32(GRID)) * np.float32(GRID)


def _caption(reading: Reading, freed: float | None) -> str:
    """Return the caption over the organ, on a bed with the length that is freed, mm."""
    if reading.phase is Phase.TEARING:
        return f"F {reading.force:.3g} N   it tears"
    if reading.phase is Phase.TORN:
        return f"F {reading.force:.3g} N   torn in two"
    left = 100.0 * max(0.0, reading.check.distance_to_break)
    done = f"lifted {reading.deflection:.1f}" if freed is None else f"freed {freed:.1f}"
    return f"F {reading.force:.3g} N   {done} mm   distance to break {left:.0f} %"
