"""Which holes in sections are an organ's lumen: those that a section nearby shows too."""

from collections.abc import Sequence
from dataclasses import replace

from organ_geometry.contours.traced_organ import TracedSection

# A lumen is one only if another section, at most this many away, shows it too.
LUMEN_REACH = 2


def with_lasting_lumens(
    sections: Sequence[TracedSection],
) -> tuple[tuple[TracedSection, ...], list[int]]:
    """Return sections without the lumens that no section near them shows, and which those are."""
    boxes = [
        None if lumen is None else (lumen.min(axis=0), lumen.max(axis=0))
        for lumen in (section.lumen for section in sections)
    ]
    dropped: list[int] = []
    result: list[TracedSection] = []
    for place, section in enumerate(sections):
        box = boxes[place]
        near = boxes[max(0, place - LUMEN_REACH) : place] + boxes[place + 1 :][:LUMEN_REACH]
        lasting = box is None or any(
            other is not None and bool((box[0] <= other[1]).all() and (other[0] <= box[1]).all())
            for other in near
        )
        if not lasting and len(sections) > 1:
            dropped.append(section.index)
            result.append(replace(section, lumen=None))
        else:
            result.append(section)
    return tuple(result), dropped
