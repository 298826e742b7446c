"""Where a bleeding tube is clipped, and what is asked for of the clip applier there."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.anatomy import tube_title
from app.simulation.exercises.next_step import (
    ALONG_BAR,
    CLIP_IN,
    CLIP_NOW,
    CLIPS_TOO,
    STAYS_STOPPED,
    NextStep,
)
from app.simulation.inputs.trocar import TROCARS
from app.simulation.tissue.jaw_steps import RIGHT, TURNED, three, turn_off
from app.simulation.tissue.reached_tube import nearest_wall
from app.simulation.tissue.spatial_tissue import CLIP_OPENING, LEAST_FLOW, SpatialTissue

Floats = NDArray[np.float64]
PAST_MM = 1.5
"""How far jaws are led past a tube that they close."""
SITES_MM = (2.0, 3.0, 4.0, 5.0, 6.0, 7.0)
"""From a tear: of these sites that is asked for which is clearest of other tubes."""
LEAST_MM, MOST_MM = 0.5, 10.0
"""From a tear, within which a clip before it is well placed."""


class Bleeding(NamedTuple):
    """A hole that bleeds, or is about to."""

    tube: str
    station: float  # mm
    up: float  # -1 or 1, along the tube to where the blood comes from

    @classmethod
    def of(cls, tissue: SpatialTissue) -> "Bleeding | None":
        """Return what bleeds most; None if nothing bleeds, nor will with the first touch."""
        holes = tissue.fluids["blood"].holes
        if not holes:  # what opens torn tears in its middle then
            if (tube := tissue.opens_torn) is None:
                return None
            return cls(tube, 0.5 * tissue.tubes.network.tubes[tube].span, -1.0)
        hole = max(holes, key=lambda each: each.flow)
        if hole.flow <= LEAST_FLOW:
            return None
        # The tear's other end lies further from where the blood comes.
        ends = [each.station for each in holes if each.tube == hole.tube]
        return cls(hole.tube, hole.station, -1.0 if max(ends) > hole.station else 1.0)

    def is_closed_by(self, between: dict[str, float]) -> bool:
        """Return whether a clip on these tubes, at stations in mm, is well placed before it."""
        at = between.get(self.tube, self.station)
        return LEAST_MM <= self.up * (at - self.station) <= MOST_MM


class ClipSite(NamedTuple):
    """Where a clip may be put on a tube, and how the clip applier comes."""

    station: float  # mm
    shaft: Floats  # (3,) direction from the tip back
    across: Floats  # (3,) in which its jaws open
    tip: Floats  # (3,) mm
    between: dict[str, float]  # tubes that would be between its jaws there, and stations, mm

    @classmethod
    def at(cls, tissue: SpatialTissue, tube: str, station: float, jaws: float) -> "ClipSite":
        """Return the site at a station, mm from a tube's first end, of jaws so far open, mm."""
        rest = tissue.tubes.network.tubes[tube]
        at = min(max(station, 0.0), rest.span)
        line = tissue.beam.places_at(np.array([at - 0.5, at, at + 0.5]), tube)
        shaft = TROCARS[RIGHT].shaft(line[1])
        across = np.cross(shaft, line[2] - line[0])
        across /= np.sqrt((across * across).sum())
        tip = line[1] - (float(rest.radius.max()) + PAST_MM) * shaft
        names = tissue.tubes.names
        between = {names[i]: there for i, there in tissue.between_jaws(tip, shaft, jaws)}
        return cls(station, shaft, across, tip, between)

    @classmethod
    def clearest(
        cls, tissue: SpatialTissue, bleeding: Bleeding, from_tear: tuple[float, ...], jaws: float
    ) -> "ClipSite":
        """Return the clearest site at one of so many mm before a hole."""
        sites = [
            cls.at(tissue, bleeding.tube, bleeding.station + bleeding.up * each, jaws)
            for each in from_tear
        ]

        def clear(site: ClipSite) -> float:
            """Return how far jaws are from the nearest other tube, mm."""
            return min(
                nearest_wall(
                    tissue.beam, site.tip + aside * site.across + back * site.shaft, other
                )[0]
                for aside in (-0.5 * jaws, 0.5 * jaws)
                for back in (0.0, 4.0, 8.0)
                for other in tissue.tubes.names
                if other != bleeding.tube
            )

        # A tube that turns back may pass between the jaws elsewhere.
        return max(sites, key=lambda each: (bleeding.is_closed_by(each.between), clear(each)))


class ClipSteps:
    """How far somebody has come with a bleeding."""

    def __init__(self, tissue: SpatialTissue) -> None:
        self._tissue = tissue
        self._tube, self._station = "", 0.0  # of the site that is asked for, mm

    def next_step(self) -> NextStep | None:
        """Return what to do next; None where nothing has bled."""
        tissue, none = self._tissue, np.zeros(0, dtype=np.int64)
        bleeding = Bleeding.of(tissue)
        if bleeding is None:
            return NextStep(STAYS_STOPPED, none) if tissue.fluids["blood"].holes else None
        hand = tissue.hands[RIGHT]
        jaws = hand.opening if hand.instrument == "clip applier" else CLIP_OPENING
        # A site that is good stays: which is the clearest changes as jaws come near.
        site = ClipSite.at(tissue, bleeding.tube, self._station, jaws)
        if self._tube != bleeding.tube or not bleeding.is_closed_by(site.between):
            site = ClipSite.clearest(tissue, bleeding, SITES_MM, jaws)
            self._tube, self._station = bleeding.tube, site.station
        title = tube_title(bleeding.tube)
        found = tissue.between_jaws(hand.place, np.array(hand.aim), jaws)
        between = {tissue.tubes.names[tube]: at for tube, at in found}
        others = [each for each in between if each != bleeding.tube]
        if not bleeding.is_closed_by(between):
            off = turn_off(RIGHT, hand, site.across)
            words = CLIP_IN.format(title, ALONG_BAR * (off is not None and abs(off) > TURNED))
        else:
            words = CLIPS_TOO.format(tube_title(others[0])) if others else CLIP_NOW.format(title)
        return NextStep(
            words, none, along=three(site.across), place=three(site.tip), hand=RIGHT,
            tool="clip applier",
        )  # fmt: skip
