"""The surface of an anatomy's tube: of its `.organ`, or round."""

import base64
import binascii
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.anatomy.anatomy_geometry import TubeLine
from app.anatomy.tables import Anatomy, TableError, TubeTable
from organ_geometry import Organ, organ_from_bytes, read_organ, round_organ

Floats = NDArray[np.float64]

ORGAN_SUFFIX = ".organ"
"""Of a file's name; base64 has no full stop, so that no content ends so."""
# How far an organ's axis may be from its tube's, in its largest radius, and mm: tubes are round
# beams through points that are 2 radii apart.
_APART_RADII, _APART_MM = 1.0, 3.0
_LOOKED_AT = 9  # places along an axis


def organ_text(content: bytes) -> str:
    """Return an organ file's content as a tube's `organ`."""
    return base64.b64encode(content).decode("ascii")


def organ_content(tube: TubeTable) -> bytes | None:
    """Return the content of a tube's organ file; None if it has none, or the file's name alone."""
    if tube.organ is None or tube.organ.endswith(ORGAN_SUFFIX):
        return None
    return base64.b64decode(tube.organ, validate=True)


def with_organs(anatomy: Anatomy, folder: Path) -> Anatomy:
    """Return an anatomy with the contents of its organ files in place of their names."""
    tubes: list[TubeTable] = []
    for number, tube in enumerate(anatomy.tube):
        if tube.organ is not None and tube.organ.endswith(ORGAN_SUFFIX):
            try:
                content = organ_text(read_organ(folder / tube.organ).encoded)
            except ValueError as error:
                raise TableError(f"tube {tube.name!r}: {error}", "tube", number, "organ") from None
            tube = msgspec.structs.replace(tube, organ=content)
        tubes.append(tube)
    return msgspec.structs.replace(anatomy, tube=tubes)


def place_of(anatomy: Anatomy) -> tuple[Floats, Floats]:
    """Return (3, 3) rows and (3,) origin, mm: LPS = place @ rows + origin; the frame's if none."""
    if anatomy.place is None:
        return np.eye(3), np.zeros(3)
    rows = np.array(anatomy.place.rows_LPS, dtype=np.float64)
    return rows, np.array(anatomy.place.origin_LPS_mm, dtype=np.float64)


def tube_organ(anatomy: Anatomy, tube: TubeTable, line: TubeLine) -> Organ:
    """Return a tube's surface, in LPS where the anatomy has a place: its organ, or a round one."""
    content = organ_content(tube)
    if content is not None:
        return organ_from_bytes(content, tube.name)
    rows, origin = place_of(anatomy)
    return round_organ(line.places @ rows + origin, line.radius, tube.name)


def check_organs(anatomy: Anatomy, lines: dict[str, TubeLine]) -> None:
    """Raise a `TableError` at a tube whose organ cannot be read, or lies elsewhere."""
    rows, origin = place_of(anatomy)
    fraction = np.linspace(0.0, 1.0, _LOOKED_AT)
    for number, tube in enumerate(anatomy.tube):
        try:
            content = organ_content(tube)
            organ = None if content is None else organ_from_bytes(content, tube.name)
        except (binascii.Error, ValueError) as error:
            raise TableError(
                f"tube {tube.name!r}: its organ is neither a file's name, *{ORGAN_SUFFIX}, nor the "
                f"content of such a file in base64: {error}",
                "tube", number, "organ",
            ) from None  # fmt: skip
        if organ is None:
            continue
        line = lines[tube.name]
        own = (organ.axis_at(fraction * organ.length) - origin) @ rows.T
        along = np.stack([line.at(at) for at in fraction * line.length])
        apart = float(np.linalg.norm(own - along, axis=1).max())
        most = _APART_RADII * organ.largest_radius + _APART_MM
        if apart > most:
            raise TableError(
                f"tube {tube.name!r}: its organ's axis is {apart:.3g} mm from points_mm, and may "
                f"be {most:.3g} mm: it is another tube's, or [place] is another case's",
                "tube", number, "organ",
            )  # fmt: skip
