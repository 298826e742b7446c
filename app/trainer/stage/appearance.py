"""How each kind of duct looks: colours, vessels and gloss.

Chosen by eye, not computed: no model here says what tissue looks like.
"""

from dataclasses import dataclass
from typing import Literal

from app.simulation import Dissection, Preset, RoundBeam

Kind = Literal["bile duct", "gallbladder", "ureter", "rubber"]

Surroundings = Literal["liver", "fat", "bench"]
"""What the duct lies in: the bed below the liver, fat alone, or a bench."""

_NO_LUMEN = 0.02

Color = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Appearance:
    """How one kind of duct looks; colours are sRGB, 0 to 255."""

    base: Color  # ground colour
    deep: Color  # darker patches on it
    flushed: Color  # patches flushed with blood
    pale: Color  # paler fibres
    vessel: Color  # of the vessels in the wall
    vessels: int  # trunks running along it
    vessel_width: float  # of the widest trunk, mm
    capillaries: float  # strength of the fine network between them, 0 to 1
    fibres: float  # strength of the fibres along it, 0 to 1
    roughness: float  # as in glTF's metallic-roughness model
    clearcoat: float  # of the wet film
    inside: Color  # of the lumen
    raw: Color  # of torn wall
    blood: Color | None  # soaks a torn end; None where nothing bleeds
    spilt: Color | None  # runs out of a torn lumen; None for nothing
    surroundings: Surroundings
    bite: float  # height of its section between a clamp's jaws over that at rest


_KINDS: dict[Kind, Appearance] = {
    "bile duct": Appearance(
        base=(206, 158, 118), deep=(176, 122, 88), flushed=(190, 100, 84), pale=(226, 194, 156),
        vessel=(116, 24, 26), vessels=6, vessel_width=0.42, capillaries=0.75, fibres=0.8,
        roughness=0.48, clearcoat=0.65,
        inside=(92, 56, 30), raw=(164, 70, 58), blood=(72, 5, 7), spilt=(58, 50, 10),
        surroundings="liver", bite=0.62,
    ),
    "gallbladder": Appearance(
        base=(138, 142, 104), deep=(106, 116, 84), flushed=(150, 106, 84), pale=(170, 168, 130),
        vessel=(104, 36, 32), vessels=8, vessel_width=0.5, capillaries=0.9, fibres=0.4,
        roughness=0.44, clearcoat=0.75,
        inside=(84, 80, 34), raw=(140, 74, 58), blood=(72, 5, 7), spilt=(58, 50, 10),
        surroundings="liver", bite=0.62,
    ),
    "ureter": Appearance(
        base=(216, 184, 166), deep=(190, 148, 132), flushed=(204, 128, 118),
        pale=(234, 212, 196), vessel=(150, 40, 44), vessels=4, vessel_width=0.34,
        capillaries=0.45, fibres=1.0, roughness=0.46, clearcoat=0.7,
        inside=(150, 84, 76), raw=(184, 96, 84), blood=(76, 6, 8), spilt=None,
        surroundings="fat", bite=0.62,
    ),
    "rubber": Appearance(
        base=(64, 66, 70), deep=(54, 56, 60), flushed=(64, 66, 70), pale=(82, 84, 88),
        vessel=(64, 66, 70), vessels=0, vessel_width=0.3, capillaries=0.0, fibres=0.0,
        roughness=0.72, clearcoat=0.0,
        inside=(58, 60, 64), raw=(70, 72, 76), blood=None, spilt=None,
        surroundings="bench", bite=0.9,
    ),
}  # fmt: skip


def appearance_of(preset: Preset) -> Appearance:
    """Return the appearance of a preset's duct."""
    return _KINDS[preset.looks_like]


def drawn_radius(dissection: Dissection) -> float:
    """Return the radius that a duct is drawn with, mm: that of the beam solved."""
    beam = dissection.preset.beam
    return 0.5 * beam.diameter_mm if isinstance(beam, RoundBeam) else dissection.organ.mean_radius


def drawn_lumen(dissection: Dissection) -> float | None:
    """Return the drawn radius of a torn duct's lumen over its wall's, if not the skin's own."""
    beam = dissection.preset.beam
    if beam.wall_mm is not None:
        return max(_NO_LUMEN, 1.0 - beam.wall_mm / drawn_radius(dissection))
    return _NO_LUMEN if dissection.preset.looks_like == "rubber" else None
