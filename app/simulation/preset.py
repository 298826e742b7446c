"""Presets: which beam stands for the duct, of what material, and when it breaks."""

from functools import cache
from typing import Literal

import msgspec

from assets import PRESETS
from physics import Beam, Theory, calibrated_threshold

__all__ = ["DEFAULT_PRESET", "OrganBeam", "Preset", "RoundBeam", "preset_named", "presets"]

DEFAULT_PRESET = "thesis-bile-duct"


class RoundBeam(msgspec.Struct, frozen=True, tag_field="section", tag="round"):
    """A full round bar, whatever the organ looks like.

    Attributes
    ----------
    span_mm
        Length between the clamps, mm.
    diameter_mm
        Diameter, mm.
    """

    span_mm: float
    diameter_mm: float


class OrganBeam(msgspec.Struct, frozen=True, tag_field="section", tag="organ"):
    """A beam whose span and section are the organ's own."""


class Preset(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A duct to train on: its beam, its material and its break, with their sources.

    Attributes
    ----------
    name, title, description
        What it is called on the command line and in the panel, and what it feels like.
    beam
        The section that is solved.
    modulus_MPa, poisson_ratio
        The material.
    source, confidence, confidence_note
        Where the figures come from, how sure they are and why.
    break_force_N
        Whole force at the middle of the span at which every theory is made to tear, or None.
    break_stress_MPa
        Stress at which the duct tears in every theory, or None.
    """

    name: str
    title: str
    description: str
    beam: RoundBeam | OrganBeam
    modulus_MPa: float  # noqa: N815 (units are written as they are)
    poisson_ratio: float
    source: str
    confidence: Literal["high", "medium", "low"]
    confidence_note: str
    break_force_N: float | None = None  # noqa: N815
    break_stress_MPa: float | None = None  # noqa: N815

    def round_beam(self) -> Beam:
        """Return the beam of a preset that brings its own.

        Returns
        -------
        Beam
            The full round bar.

        Raises
        ------
        ValueError
            If the preset takes the organ's own sections.
        """
        if not isinstance(self.beam, RoundBeam):
            raise ValueError(f"preset {self.name} needs an organ: its beam is the organ's own")
        return Beam.round(
            span=self.beam.span_mm,
            diameter=self.beam.diameter_mm,
            modulus=self.modulus_MPa,
            poisson_ratio=self.poisson_ratio,
        )

    def threshold(self, theory: Theory, beam: Beam) -> float:
        """Return the stress at which the duct tears in a theory.

        Parameters
        ----------
        theory
            The theory that reads the stresses.
        beam
            The beam.

        Returns
        -------
        float
            Threshold T, MPa: as published, or what the theory reads at the known break.
        """
        if self.break_stress_MPa is not None:
            return self.break_stress_MPa
        assert self.break_force_N is not None  # noqa: S101 (presets() has checked it)
        return calibrated_threshold(theory, beam, 0.5 * beam.span, self.break_force_N)


class _PresetFile(msgspec.Struct, frozen=True):
    preset: list[Preset]


@cache
def presets() -> dict[str, Preset]:
    """Return the presets that ship with the trainer, by name, the default first.

    Returns
    -------
    dict[str, Preset]
        The presets.

    Raises
    ------
    ValueError
        If one of them has not exactly one kind of break.
    """
    found = msgspec.toml.decode(PRESETS.read_bytes(), type=_PresetFile).preset
    for preset in found:
        if (preset.break_force_N is None) == (preset.break_stress_MPa is None):
            raise ValueError(
                f"preset {preset.name} must have either break_force_N or break_stress_MPa"
            )
    return {preset.name: preset for preset in found}


def preset_named(name: str) -> Preset:
    """Return the preset of that name.

    Parameters
    ----------
    name
        One of `presets`.

    Returns
    -------
    Preset
        The preset.

    Raises
    ------
    ValueError
        If there is none of that name.
    """
    if name not in presets():
        raise ValueError(f"unknown preset {name!r}; there are: {', '.join(presets())}")
    return presets()[name]
