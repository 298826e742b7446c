"""Which tubes of an anatomy are the structures at its gallbladder, and what parts first of them."""

import numpy as np
from numpy.typing import NDArray

from app.anatomy import Anatomy
from app.simulation.specimen.tubes import Tubes

LOWER_FRACTION = 1.0 / 3.0
"""Of the gallbladder's bed, that a critical view frees."""


def named_structures(anatomy: Anatomy) -> tuple[str, str, str]:
    """Return the names of the gallbladder, the cystic and the common duct."""
    bladder = next((tube.name for tube in anatomy.tube if tube.kind == "organ"), None)
    if bladder is None:
        raise ValueError(f"anatomy {anatomy.name!r} has no gallbladder: no tube of kind organ")
    ducts = {tube.name for tube in anatomy.tube if tube.kind == "duct"}
    pairs = [(join.tube, join.to) for join in anatomy.join]
    pairs += [(b, a) for a, b in pairs]
    for cystic in (b for a, b in pairs if a == bladder and b in ducts):
        for common in (b for a, b in pairs if a == cystic and b in ducts - {cystic}):
            return bladder, cystic, common
    raise ValueError(f"anatomy {anatomy.name!r} has no duct from {bladder!r} to another duct")


def entering_tubes(anatomy: Anatomy, gallbladder: str) -> dict[str, int]:
    """Return each tube that enters the gallbladder, and the end of it that does."""
    here = [(join.tube, join.end) for join in anatomy.join if join.to == gallbladder]
    there = [
        (join.to, 0 if join.at_mm == "begin" else 1)
        for join in anatomy.join
        if join.tube == gallbladder
    ]
    return dict(here + there)


def front_strands(anatomy: Anatomy, tubes: Tubes, fraction: float) -> NDArray[np.bool_]:
    """Return so much of what holds each structure, (S,), what is nearest to the viewer first."""
    gallbladder, _, common = named_structures(anatomy)
    strands, names = tubes.strands, tubes.names
    between = strands.to >= 0
    ends, feet = strands.ends[:, 2], strands.feet[:, 2]
    height = np.where(between, 0.5 * (ends + feet), ends)

    def of(name: str) -> NDArray[np.bool_]:
        number = names.index(name)
        return (strands.tubes == number) | (strands.to == number)

    low = LOWER_FRACTION * tubes.network.tubes[gallbladder].span
    plate = of(gallbladder) & ~between & (strands.stations <= low)
    # Of the common duct the front only: it stays in its bed.
    groups = [(of(common), 0.5 * fraction), (plate, fraction), (between, fraction)]
    groups += [(of(name), fraction) for name in entering_tubes(anatomy, gallbladder)]
    out = np.zeros(strands.count, dtype=np.bool_)
    for which, released in groups:
        own = np.flatnonzero(which)
        order = own[np.argsort(-height[own], kind="stable")]
        out[order[: round(released * own.size)]] = True
    return out
