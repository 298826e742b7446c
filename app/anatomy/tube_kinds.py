"""What tubes are made of by their kind, and which kind a name means (assets/tube_kinds.toml)."""

from functools import cache
from typing import Literal, TypeAlias

import msgspec

from app.anatomy.tables import Confidence, Fluid, TubeKind
from assets import TUBE_KINDS

Role: TypeAlias = TubeKind | Literal["shown"]
"""A kind of tube, or `shown`: drawn and not solved."""


class _Shown(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    names: list[str]


class TubeWall(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A kind's wall; assets/tube_kinds.toml says what each number is."""

    names: list[str]
    term: str
    wall_fraction: float
    most_wall_mm: float
    modulus_MPa: float  # noqa: N815 (units are written as they are)
    strength_MPa: float  # noqa: N815
    relaxation: str  # of assets/relaxations.toml
    fluid: Fluid
    source: str
    confidence: Confidence
    stretch_at_break: float | None = None

    def thickness(self, radii: list[float]) -> float:
        """Return the wall of a tube of outer radii, mm: thin enough for its narrowest place."""
        wall = min(
            self.wall_fraction * sum(radii) / len(radii), self.most_wall_mm, 0.6 * min(radii)
        )
        return round(wall, 3)


class _Kinds(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    shown: _Shown
    organ: TubeWall
    vein: TubeWall
    artery: TubeWall
    duct: TubeWall


@cache
def _kinds() -> _Kinds:
    return msgspec.toml.decode(TUBE_KINDS.read_bytes(), type=_Kinds)


TITLES = {
    "common": "common duct",
    "cystic": "cystic duct",
    "rha": "right hepatic artery",
    "artery": "cystic artery",
    "artery2": "second cystic artery",
}
"""Tubes of the anatomies that are shipped or drawn."""


def tube_title(name: str) -> str:
    """Return what a tube is called in words, by its name in a file."""
    return TITLES.get(name, name.replace("_", " "))


def wall_of(kind: TubeKind) -> TubeWall:
    """Return the wall of a kind of tube."""
    return getattr(_kinds(), kind)


def kind_of_name(name: str) -> Role | None:
    """Return what a label's name means, or None: the first kind of which it has a word."""
    words = name.lower().replace("_", " ").replace("-", " ")
    kinds = _kinds()
    found: dict[Role, list[str]] = {
        "organ": kinds.organ.names,
        "shown": kinds.shown.names,
        "vein": kinds.vein.names,
        "artery": kinds.artery.names,
        "duct": kinds.duct.names,
    }
    return next((kind for kind, names in found.items() if any(n in words for n in names)), None)
