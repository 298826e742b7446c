"""Presets: which beam stands for the duct, of what material, when it breaks; and their files.

Ducts of one preset differ in modulus E and strength T (`Spread`). Bent and stretched alike they
have stresses s in proportion to E, by every theory. The used share s/T is in proportion to E/T,
which is lognormal with the median of this duct where E and T are so, each within its factor.
"""

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import NormalDist
from typing import Literal

import msgspec

from app.bounded_file import decoded, read_bounded
from app.relaxation_preset import relaxation_named
from assets import PRESETS
from physics import Beam, Law, LawName, Theory, calibrated_threshold, law_named

THESIS_PRESET = "thesis-bile-duct"
"""The thesis's full round bar; the shipped duct's default."""
ASSUMED_PRESET = "assumed-duct"
"""An organ's own sections, of an assumed material; every other organ's default."""

LIMITS: dict[str, tuple[float, float, str]] = {
    "modulus_MPa": (1e-5, 1e6, "MPa"),
    "poisson_ratio": (0.0, 0.499, ""),
    "break_force_N": (1e-6, 1e6, "N"),
    "break_stress_MPa": (1e-7, 1e6, "MPa"),
    "span_mm": (0.1, 1e4, "mm"),
    "diameter_mm": (0.01, 1e3, "mm"),
    "wall_mm": (1e-3, 1e3, "mm"),
    "modulus_factor": (1.0, 100.0, ""),
    "strength_factor": (1.0, 100.0, ""),
    "tear_mm_per_s": (0.1, 1e4, "mm/s"),
}
"""Smallest and largest value and unit of each number of a preset."""

BAND = 0.90
"""Of the ducts, between the ends of a band."""
# Factors where a preset states none: those of assets/study_plan.toml.
ASSUMED = 1.5, 1.3

SUFFIX = ".toml"
MOST_BYTES = 100_000

_HEADER = """\
# A preset of bluntdissect: give it as --preset FILE, or open it under Model in the trainer.
# mm, N and MPa; what each line means stands at the top of assets/presets.toml.

"""


class RoundBeam(msgspec.Struct, frozen=True, tag_field="section", tag="round", omit_defaults=True):
    """A round bar or tube, whatever the organ looks like."""

    span_mm: float  # between the clamps
    diameter_mm: float  # outer
    wall_mm: float | None = None  # a full bar when None
    first_clamp_mm: float | None = None  # from the organ's start; None: the clamps hold its middle

    def __post_init__(self) -> None:
        _check(self, "span_mm", "diameter_mm", "wall_mm")
        if self.wall_mm is not None and not self.wall_mm < 0.5 * self.diameter_mm:
            raise ValueError(
                f"wall_mm must be below half the diameter, {0.5 * self.diameter_mm:g} mm, got "
                f"{self.wall_mm:g} mm; a full bar has none"
            )
        if self.first_clamp_mm is not None and not 0.0 <= self.first_clamp_mm <= 1e5:
            raise ValueError(f"first_clamp_mm must be 0 mm or more, got {self.first_clamp_mm:g}")


class OrganBeam(msgspec.Struct, frozen=True, tag_field="section", tag="organ", omit_defaults=True):
    """A beam whose span and sections are the organ's own."""

    wall_mm: float | None = None  # inside the outer edge; None: as the images show it
    clamps_mm: tuple[float, float] | None = None  # from the organ's start; None: its ends

    def __post_init__(self) -> None:
        _check(self, "wall_mm")
        if self.clamps_mm is not None:
            first, second = self.clamps_mm
            if not (first >= 0.0 and 0.1 <= second - first <= 1e4):
                raise ValueError(
                    f"clamps_mm must be two places along the organ, 0 mm or more and 0.1 mm apart "
                    f"at least, got {first:g} and {second:g} mm"
                )


class Preset(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A duct to train on: its beam, its material and its break, with their sources.

    A `ValueError` says which number is outside its `LIMITS`, or that there is not exactly one of
    `break_force_N` and `break_stress_MPa`.
    """

    name: str  # on the command line
    beam: RoundBeam | OrganBeam
    modulus_MPa: float  # noqa: N815 (units are written as they are)
    title: str = ""  # in the panel
    description: str = ""  # what it feels like
    poisson_ratio: float = 0.3
    # of the wall where the duct is a beam in space
    law: LawName = "neo-hooke"
    stiffening: float | None = None  # of the exponential law
    # at mid-span; each theory's threshold is fitted to it
    break_force_N: float | None = None  # noqa: N815
    break_stress_MPa: float | None = None  # the threshold in every theory  # noqa: N815
    # geometric standard deviations between ducts, where they are known
    modulus_factor: float | None = None
    strength_factor: float | None = None
    relaxation: str | None = None  # how the wall relaxes, by name; not at all when None
    # how fast a tear crosses the wall of a beam in space; None: it is through at once
    tear_mm_per_s: float | None = None
    # its appearance in the picture
    looks_like: Literal["bile duct", "gallbladder", "ureter", "rubber"] = "bile duct"
    source: str = "Yours: no source is given."  # where the figures come from
    confidence: Literal["high", "medium", "low"] = "low"  # in the figures
    confidence_note: str = "Nobody has said how sure these figures are."

    def __post_init__(self) -> None:
        _check(self, "modulus_MPa", "poisson_ratio", "break_force_N", "break_stress_MPa")
        _check(self, "modulus_factor", "strength_factor", "tear_mm_per_s")
        if (self.break_force_N is None) == (self.break_stress_MPa is None):
            raise ValueError("a preset must have either break_force_N or break_stress_MPa")
        law_named(self.law, stiffening=self.stiffening)
        if self.relaxation is not None:
            relaxation_named(self.relaxation)
        if not self.name.strip():
            raise ValueError("a preset must have a name")
        for each, most in ((self.name, 80), (self.title, 120), (self.description, 1000)):
            if len(each) > most:
                raise ValueError(f"a preset's {each[:20]!r}... can have at most {most} characters")

    @property
    def label(self) -> str:
        """The title, or the name without one."""
        return self.title or self.name

    @property
    def ships(self) -> bool:
        """Whether it is a shipped preset, unchanged."""
        return presets().get(self.name) == self

    def round_beam(self) -> Beam:
        """Return the preset's own round beam."""
        if not isinstance(self.beam, RoundBeam):
            raise ValueError(f"preset {self.name} needs an organ: its beam is the organ's own")
        return Beam.round(
            span=self.beam.span_mm,
            diameter=self.beam.diameter_mm,
            modulus=self.modulus_MPa,
            poisson_ratio=self.poisson_ratio,
            wall=self.beam.wall_mm,
        )

    @property
    def law_in_space(self) -> Law:
        """The law of the wall where the duct is a beam in space."""
        return law_named(self.law, stiffening=self.stiffening)

    def threshold(self, theory: Theory, beam: Beam) -> float:
        """Return a theory's threshold, MPa: as given, or its stress at the break force."""
        if self.break_stress_MPa is not None:
            return self.break_stress_MPa
        assert self.break_force_N is not None  # noqa: S101 (checked when it was made)
        return calibrated_threshold(theory.pull(beam, 0.5 * beam.span), self.break_force_N)

    @property
    def strength(self) -> str:
        """The strength as it is given, and how each theory's threshold T follows from it."""
        if self.break_stress_MPa is not None:
            kilopascals = 1e3 * self.break_stress_MPa
            return f"a nominal stress of {kilopascals:.6g} kPa, which is T in every theory"
        return (
            f"a break at {self.break_force_N:.6g} N at mid-span; T is the stress that each theory "
            "reads there"
        )


@dataclass(frozen=True, slots=True)
class Spread:
    """Geometric standard deviations, 1 or more, of the modulus and the strength of ducts."""

    modulus_factor: float
    strength_factor: float

    @classmethod
    def of(cls, preset: Preset) -> "Spread":
        """Return what a preset states, and for what it does not, an assumption."""
        given = preset.modulus_factor, preset.strength_factor
        if given == (None, None):
            return cls(*ASSUMED)
        modulus, strength = (1.0 if each is None else each for each in given)
        return cls(modulus, strength)

    @property
    def _deviation(self) -> float:
        """Standard deviation of ln(E/T)."""
        return math.hypot(math.log(self.modulus_factor), math.log(self.strength_factor))

    def band(self, distance: float) -> tuple[float, float]:
        """Return the distances to break between which nine of ten ducts are; 0 is torn."""
        reach = math.exp(NormalDist().inv_cdf(0.5 + 0.5 * BAND) * self._deviation)
        used = 1.0 - distance
        return max(0.0, 1.0 - used * reach), max(0.0, 1.0 - used / reach)

    def torn(self, distance: float) -> float:
        """Return the share of ducts that would be torn."""
        used = 1.0 - distance
        if used <= 0.0 or self._deviation == 0.0:
            return float(used >= 1.0)
        return NormalDist(0.0, self._deviation).cdf(math.log(used))


def _check(of: msgspec.Struct, *names: str) -> None:
    """Raise unless each of these numbers that is given is within its limits."""
    for name in names:
        value, (low, high, unit) = getattr(of, name), LIMITS[name]
        if value is not None and not low <= value <= high:
            unit = f" {unit}" if unit else ""
            raise ValueError(f"{name} must be from {low:g} to {high:g}{unit}, got {value:g}")


class _PresetList(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    preset: list[Preset]


@cache
def presets() -> dict[str, Preset]:
    """Return the presets that ship with the trainer, by name."""
    found = msgspec.toml.decode(PRESETS.read_bytes(), type=_PresetList).preset
    return {preset.name: preset for preset in found}


def preset_named(name: str | Preset) -> Preset:
    """Return the preset of that name, or a whole one; a `ValueError` says which there are."""
    if isinstance(name, Preset):
        return name
    if name not in presets():
        raise ValueError(f"unknown preset {name!r}; there are: {', '.join(presets())}")
    return presets()[name]


def preset_toml(preset: Preset) -> bytes:
    """Return a preset as a file: TOML with one `[[preset]]`, its numbers to the last bit."""
    lines = {name: each for name, each in msgspec.to_builtins(preset).items() if each is not None}
    return _HEADER.encode() + msgspec.toml.encode({"preset": [lines]})


def read_preset(content: bytes, name: str) -> Preset:
    """Return the preset in a file."""
    if len(content) > MOST_BYTES:
        raise ValueError(f"{name} is no preset: it has more than {MOST_BYTES:,} bytes")
    try:
        found = decoded(msgspec.toml.decode, content, _PresetList, f"{name} is no preset").preset
    except ValueError as error:
        where = str(error).replace("`$.preset[0].", "`").replace(" - at `$.preset[0]`", "")
        raise ValueError(where) from None
    if len(found) != 1:
        raise ValueError(f"{name} must have one [[preset]], it has {len(found)}")
    return found[0]


def chosen_preset(text: str) -> Preset:
    """Return a preset by its name, if shipped, or from a file."""
    if text in presets():
        return preset_named(text)
    if Path(text).suffix.lower() != SUFFIX:
        raise ValueError(
            f"unknown preset {text!r}; there are: {', '.join(presets())}, or a file, *{SUFFIX}"
        )
    return read_preset(read_bounded(Path(text), MOST_BYTES, "preset"), text)
