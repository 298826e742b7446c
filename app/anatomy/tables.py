"""The tables of an anatomy file (docs/anatomy-file.md): tubes, joins, layers of tissue.

An anatomy has one frame: x along the first tube, y to the patient's right, z away from the bed;
`place` says where that frame stands in the patient (LPS).
"""

from typing import Literal, TypeAlias

import msgspec

from physics.bed import End

Number: TypeAlias = int | float
Point: TypeAlias = tuple[Number, Number, Number]
TubeKind: TypeAlias = Literal["duct", "artery", "vein", "organ"]
TubeEnd: TypeAlias = End | Literal["joined"]
Fluid: TypeAlias = Literal["bile", "blood", "none"]
Confidence: TypeAlias = Literal["high", "medium", "low", "measured", "assumed"]


class Place(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[place]`: where the anatomy's frame stands: LPS = origin + x row 1 + y row 2 + z row 3."""

    origin_LPS_mm: Point  # noqa: N815 (units are written as they are)
    rows_LPS: tuple[Point, Point, Point]  # noqa: N815


HEAD_RIGHT_FRONT: tuple[Point, Point, Point] = (
    (0.0, 0.0, 1.0),
    (-1.0, 0.0, 0.0),
    (0.0, -1.0, 0.0),
)
"""Rows of x to the head, y to the patient's right, z to the front, in LPS."""


class TubeTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[tube]]`: an axis through points, radii along it, the wall's law, and two ends."""

    name: str
    kind: TubeKind
    points_mm: list[Point]
    radius_mm: Number | list[Number]  # outer; of a list, spread evenly from end to end
    wall_mm: Number
    modulus_MPa: Number  # noqa: N815
    strength_MPa: Number  # noqa: N815
    stretch_at_break: Number | None = None
    tear_mm_per_s: Number | None = None  # how fast a tear crosses the wall; at once when None
    ends: tuple[TubeEnd, TubeEnd] = ("clamped", "clamped")
    elements: int = 20
    fluid: Fluid = "none"
    organ: str | None = None  # the surface: a file beside this one, or its content in base64
    source: str = ""
    confidence: Confidence = "assumed"  # of points and radii
    confidence_wall: Confidence = "assumed"


class JoinTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[join]]`: an end of a tube on the axis of one that stands earlier in the file."""

    tube: str
    end: Literal[0, 1]
    to: str
    at_mm: Number | Literal["begin", "end"]
    stiff: Number = 1.0  # factor on the stiffness of the tube's first element there
    face_mm: Number = 0.0  # along the tube to the other's wall: before it no stress is judged
    miss_mm: Number | None = None  # of labels: by how much the end's direction missed that axis
    voxels: int | None = None  # of labels: voxels in which the two touch there


class LayerTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[layer]]`: strands from a tube to another or to the bed, of a bed preset's tissue."""

    tube: str
    to: str  # a tube, or "bed"
    preset: str
    strands: int
    factor: Number = 1.0  # on the preset's toughness
    from_mm: Number = 0.0
    to_mm: Number | None = None
    reach_mm: Number | None = None  # longest gap between two walls that strands span
    gap_mm: Number | None = None
    yield_mm: Number | None = None
    failure_mm: Number | None = None
    slack_mm: Number | None = None
    floor_N_per_mm2: Number | None = None  # noqa: N815
    side: Literal["facing", "front", "back"] = "facing"
    sheet: str | None = None  # what the layer is part of: triangle, peritoneum, plate
    toward: Point | None = None  # where its bed lies; else behind, along -z


class TouchTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[touch]]`: two tubes that lie against each other and are not joined."""

    tube: str
    to: str
    length_mm: Number  # of the first tube, along which they touch


class ShownTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[shown]]`: an organ that is drawn and not solved."""

    organ: str
    name: str = ""


class Anatomy(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Tubes, where they join, and the layers of tissue between them."""

    name: str
    title: str = ""
    tube: list[TubeTable]
    join: list[JoinTable] = []
    layer: list[LayerTable] = []
    touch: list[TouchTable] = []
    shown: list[ShownTable] = []
    place: Place | None = None
    seed: int = 1
    tissue: str = "normal"
    drawn: dict[str, str | Number] = {}  # what a generator drew, by name

    def tube_named(self, name: str) -> TubeTable:
        """Return a tube by its name."""
        return next(tube for tube in self.tube if tube.name == name)


class TableError(ValueError):
    """A fault of one table: which, by its kind and number from 0, and of which field."""

    def __init__(self, message: str, table: str, number: int, field: str | None = None) -> None:
        super().__init__(message)
        self.table, self.number, self.field = table, number, field
