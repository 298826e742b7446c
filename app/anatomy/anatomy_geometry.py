"""Where an anatomy's tubes run: their axes, whether they meet where they join, and where not."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from app.anatomy.tables import Anatomy, JoinTable, TableError, TubeTable
from physics.bed.space_beam import axis_line, beyond

Floats = NDArray[np.float64]

MEETS_MM = 0.5
"""How far a joined end may be from the axis that it joins: a builder moves it there."""
CLEAR_MM = 0.05
"""By how much two walls may overlap: what is written is rounded."""
_STEP_MM = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class TubeLine:
    """A tube's axis, (N,) stations, mm, (N, 3) places, mm, and (N,) outer radii, mm."""

    stations: Floats
    places: Floats
    radius: Floats

    @property
    def length(self) -> float:
        """Length of the axis, mm."""
        return float(self.stations[-1])

    def at(self, station: float) -> Floats:
        """Return the (3,) place at a station, mm."""
        return _columns_at(np.array([station]), self.stations, self.places)[0]

    def radius_at(self, station: float) -> float:
        """Return the outer radius at a station, mm."""
        return float(np.interp(station, self.stations, self.radius))

    def nearest(self, place: Floats) -> float:
        """Return the station of the axis that is nearest to a place, mm."""
        steps = np.diff(self.places, axis=0)
        along = ((place - self.places[:-1]) * steps).sum(axis=1) / (steps**2).sum(axis=1)
        along = np.clip(along, 0.0, 1.0)
        feet = self.places[:-1] + along[:, np.newaxis] * steps
        piece = int(((feet - place) ** 2).sum(axis=1).argmin())
        return float(
            self.stations[piece] + along[piece] * (self.stations[piece + 1] - self.stations[piece])
        )


def tube_lines(anatomy: Anatomy) -> dict[str, TubeLine]:
    """Return each tube's axis by name, the tubes being joined and clear of each other.

    Parameters
    ----------
    anatomy
        Of an anatomy file.

    Returns
    -------
    dict[str, TubeLine]
        In the order of the file.

    Raises
    ------
    TableError
        If a joined end is not at the axis that it joins, a place or a face is beyond an axis, or
        the walls of two tubes cross away from where they join and no [[touch]] names the two.
    """
    lines: dict[str, TubeLine] = {}
    for number, tube in enumerate(anatomy.tube):
        try:
            lines[tube.name] = tube_line(tube)
        except ValueError as error:
            message = f"tube {tube.name!r}: {error}"
            raise TableError(message, "tube", number, "points_mm") from None
    check_lines(anatomy, lines)
    return lines


def check_lines(anatomy: Anatomy, lines: dict[str, TubeLine]) -> None:
    """Raise a `TableError` unless tubes of these axes are joined and clear of each other."""
    nodes = joined_places(anatomy, lines)
    for number, join in enumerate(anatomy.join):
        length = lines[join.tube].length
        if join.face_mm >= length:
            raise TableError(
                f"join of {join.tube!r}: face_mm must be below that tube's length of {length:.4g} "
                f"mm, got {join.face_mm:g}",
                "join", number, "face_mm",
            )  # fmt: skip
    for number, layer in enumerate(anatomy.layer):
        length = lines[layer.tube].length
        upto = length if layer.to_mm is None else layer.to_mm
        if not layer.from_mm < upto or beyond(upto, length):
            raise TableError(
                f"layer of {layer.tube!r} to {layer.to!r}: it runs from {layer.from_mm:g} to "
                f"{upto:g} mm of a tube that is {length:.4g} mm long",
                "layer", number, "from_mm" if layer.from_mm >= length else "to_mm",
            )  # fmt: skip
    _check_clear(anatomy, lines, nodes)


def tube_line(tube: TubeTable) -> TubeLine:
    """Return a tube's axis: the spline that the beam takes, at about equal steps."""
    lengths, places, _ = axis_line(np.array(tube.points_mm, dtype=np.float64))
    count = max(2, math.ceil(float(lengths[-1]) / _STEP_MM) + 1)
    stations: Floats = np.linspace(0.0, float(lengths[-1]), count)
    even = _columns_at(stations, lengths, places)
    radii: Floats = np.array(tube.radius_mm, dtype=np.float64).reshape(-1)
    spread: Floats = np.linspace(0.0, 1.0, len(radii)) if len(radii) > 1 else np.zeros(1)
    return TubeLine(
        stations, even, _columns_at(stations / stations[-1], spread, radii[:, None])[:, 0]
    )


def _columns_at(at: Floats, stations: Floats, table: Floats) -> Floats:
    """Return (N, C) rows of a table at (N,) stations, linear between those given."""
    columns: list[Floats] = [np.interp(at, stations, column) for column in table.T.copy()]
    return np.stack(columns, axis=1)


def joined_station(join: JoinTable, to: TubeLine) -> float:
    """Return the station at which a tube is joined, mm."""
    if join.at_mm == "begin":
        return 0.0
    return to.length if join.at_mm == "end" else min(float(join.at_mm), to.length)


def joined_places(anatomy: Anatomy, lines: dict[str, TubeLine]) -> dict[str, list[Floats]]:
    """Return the places at which each tube is joined, by name."""
    nodes: dict[str, list[Floats]] = {name: [] for name in lines}
    for number, join in enumerate(anatomy.join):
        to = lines[join.to]
        at = join.at_mm
        if not isinstance(at, str) and (not at >= 0.0 or beyond(at, to.length)):
            raise TableError(
                f"tube {join.tube!r} joins {join.to!r} at {join.at_mm:g} mm, which is not on its "
                f"{to.length:.4g} mm",
                "join", number, "at_mm",
            )  # fmt: skip
        place = to.at(joined_station(join, to))
        end = lines[join.tube].places[-join.end]
        gap = float(np.linalg.norm(end - place))
        if gap > MEETS_MM:
            raise TableError(
                f"tube {join.tube!r} does not meet {join.to!r}: end {join.end} is {gap:.3g} mm "
                f"from its axis there, and may be {MEETS_MM:g} mm",
                "join", number, "at_mm",
            )  # fmt: skip
        nodes[join.tube].append(place)
        nodes[join.to].append(place)
    return nodes


def length_in_wall(join: JoinTable, lines: dict[str, TubeLine]) -> float:
    """Return from how far along itself a tube is clear of the wall that it joins, mm."""
    tube = lines[join.tube]
    along = tube.length - tube.stations if join.end else tube.stations
    return float(along[_overlap(tube, lines[join.to]) > CLEAR_MM].max(initial=0.0))


def crossings(
    anatomy: Anatomy, lines: dict[str, TubeLine], nodes: dict[str, list[Floats]]
) -> Iterator[tuple[int, str, str, "Crossing"]]:
    """Yield number and name of each tube whose wall crosses another's, and that one's name."""
    touching = {frozenset((touch.tube, touch.to)) for touch in anatomy.touch}
    names = list(lines)
    for number, name in enumerate(names):
        for other in names[:number]:
            if frozenset((name, other)) in touching:
                continue
            found = _crossing(lines[name], lines[other], nodes[name], nodes[other])
            if found.depth > CLEAR_MM:
                yield number, name, other, found


@dataclass(frozen=True, slots=True)
class Crossing:
    """By how much two walls overlap away from where they are joined, where and how far, mm."""

    depth: float
    station: float
    length: float


def _check_clear(
    anatomy: Anatomy, lines: dict[str, TubeLine], nodes: dict[str, list[Floats]]
) -> None:
    for number, name, other, found in crossings(anatomy, lines, nodes):
        raise TableError(
            f"tube {name!r} crosses {other!r} by {found.depth:.2g} mm at {found.station:.3g} mm of "
            f"its length: move one, or add a [[touch]] if they lie against each other",
            "tube", number, "points_mm",
        )  # fmt: skip


@lru_cache(maxsize=64)  # a drawn case asks for the same pairs at each course that it tries
def _overlap(one: TubeLine, other: TubeLine) -> Floats:
    """Return by how much one's wall overlaps the other's at each of its (N,) stations, mm."""
    apart = np.linalg.norm(one.places[:, np.newaxis] - other.places, axis=2)
    overlap: Floats = (one.radius[:, np.newaxis] + other.radius - apart).max(axis=1)
    return overlap


def _crossing(
    one: TubeLine, other: TubeLine, nodes: list[Floats], others: list[Floats]
) -> Crossing:
    overlap = _overlap(one, other)
    # Joined tubes leave one another's wall some way from the place where their axes meet, and so do
    # two that join a third near each other: a stretch that begins there is no crossing.
    reach = float(one.radius.max() + other.radius.max())
    allowed = [
        node
        for node in nodes
        if any(float(np.linalg.norm(node - place)) < reach for place in others)
    ]
    over = overlap > CLEAR_MM
    edges = np.flatnonzero(np.diff(np.concatenate([[False], over, [False]]).astype(np.int8)))
    worst, where, length = 0.0, 0.0, 0.0
    for first, last in edges.reshape(-1, 2):
        stretch = one.places[first:last]
        if any(np.linalg.norm(stretch - node, axis=1).min() < reach for node in allowed):
            continue
        length += float(one.stations[last - 1] - one.stations[first])
        place = first + int(overlap[first:last].argmax())
        if overlap[place] > worst:
            worst, where = float(overlap[place]), float(one.stations[place])
    return Crossing(worst, where, length)
