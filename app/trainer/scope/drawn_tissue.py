"""What a picture through the scope gets of a tissue: instruments, wounds, clips, and the pose."""

import math
from typing import get_args

import numpy as np
import viser

from app.anatomy import AnatomyNetwork
from app.simulation import HOLDING, TROCARS, EventKind, Hand, Instrument, SpatialTissue, Trocar
from app.trainer.scope.held_scope import HeldScope
from app.trainer.scope.packing import DrawnHand, Frame, Well
from app.trainer.scope.picture import ScopePicture
from app.trainer.scope.pose import Laparoscope, cross

INSTRUMENTS: tuple[Instrument, ...] = get_args(Instrument)
HOLDS_APART, READY_APART = 1.0, 5.0
"""mm between the ends of a grasper's jaws that hold a wall, and of those that hold nothing."""
CLOSED_S, OPENS_S = 0.2, 0.2
"""How long blades and jaws that have cut or clipped are drawn closed, and then take to open."""


def picture_of(
    scene: viser.SceneApi,
    made: AnatomyNetwork,
    tissue: SpatialTissue,
    scope: Laparoscope,
    *,
    plain: bool = False,
) -> ScopePicture:
    """Return the picture of an anatomy's tissue through a scope."""
    dissections = tissue.tubes.dissections
    return ScopePicture(
        scene, made, tissue.beam, dissections, scope=scope, trocars=TROCARS,
        instruments=INSTRUMENTS, plain=plain,
    )  # fmt: skip


def draw_tissue(picture: ScopePicture, tissue: SpatialTissue, held: HeldScope) -> bool:
    """Send a tissue as it is now, seen through a scope as that is held; return if it differs."""
    torn = [(tube, each) for tube, each in enumerate(tissue.torn_elements) if each >= 0]
    torn += [(tube, math.floor(at)) for tube, at in _at_events(tissue, "division")]
    frame = Frame(
        held.pose,
        hands=[_hand(tissue, number) for number in range(len(tissue.hands))],
        wells=_wells(tissue),
        clips=_at_events(tissue, "clip"),
        torn=torn,
        pools=(1e3 * tissue.suction.pooled_ml("blood"), 1e3 * tissue.suction.pooled_ml("bile")),
        nicks=[
            (
                each.tube,
                _in_elements(tissue, each.tube, each.station),
                math.atan2(-each.side[1], each.side[0]),
                each.depth,
            )
            for each in tissue.nicks()
        ],
        soil=tissue.lens.soil,
    )
    return picture.send(tissue.beam, frame, held.scope.angle)


def _hand(tissue: SpatialTissue, number: int) -> DrawnHand:
    hand = tissue.hands[number]
    holds = hand.node is not None
    x, y, z = (float(each) for each in hand.tip)
    opened = min(max((tissue.since_closed(number) - CLOSED_S) / OPENS_S, 0.0), 1.0)
    opening = opened * hand.opening
    if holds or tissue.suction.on(number):
        opening = HOLDS_APART
    elif hand.instrument in HOLDING:
        opening = READY_APART
    roll = _roll(TROCARS[number], hand)
    return DrawnHand(INSTRUMENTS.index(hand.instrument), (x, y, z), opening, roll, holds)


def _wells(tissue: SpatialTissue) -> list[Well]:
    """Return where blood and bile flow out, the quickest last."""
    out: list[Well] = []
    for fluid, flow in tissue.fluids.items():
        for hole in flow.holes:
            x, y, z = (float(each) for each in tissue.beam.places[hole.node])
            out.append(Well((x, y, z), hole.flow, fluid == "bile"))
    return sorted(out, key=lambda well: well.rate)


def _at_events(tissue: SpatialTissue, kind: EventKind) -> list[tuple[int, float]]:
    """Return tubes' numbers and places along them, in elements, where something was done."""
    out: list[tuple[int, float]] = []
    for event in tissue.events:
        if event.kind == kind:
            number = tissue.tubes.names.index(event.tube)
            out.append((number, _in_elements(tissue, number, event.station)))
    return out


def _in_elements(tissue: SpatialTissue, tube: int, station: float) -> float:
    """Return a place along a tube, mm from its first end, in elements."""
    at = station * tissue.tubes.surfaces[tube].scale
    stations = tissue.beam.stations_of(tissue.tubes.names[tube])
    return float(np.interp(at, stations, np.arange(stations.size)))


def _roll(trocar: Trocar, hand: Hand) -> float:
    """Return an instrument's turn about its shaft, rad: as its jaws part or its tip bends."""
    back = trocar.shaft(hand.place)
    level = np.array([-back[1], back[0], 0.0])  # across it and across what is up
    level = level / math.sqrt(float((level * level).sum()))
    over = cross(back, level)
    if hand.instrument == "right angle":  # it bends along level cos(roll) + over sin(roll)
        bent = -np.array(hand.aim)
        return math.atan2(float((bent * over).sum()), float((bent * level).sum()))
    # Jaws part along over cos(roll) - level sin(roll): along x where nothing else is said.
    apart = np.array(hand.spread if any(hand.spread) else (1.0, 0.0, 0.0))
    return math.atan2(-float((apart * level).sum()), float((apart * over).sum()))
