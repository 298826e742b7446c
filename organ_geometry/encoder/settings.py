"""The encoder's tuning: one value for each idea, with its reason.

Lengths are in steps or tolerances, rates in bits. "Table" is the ablation table in docs/encoder.md,
made by `python -m benchmarks.encoder_ablation`: a row for each idea, switched off by a value.
"""

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

Effort: TypeAlias = Literal["quick", "full"]


@dataclass(frozen=True, slots=True)
class Penalty:
    """Bits that an error costs: phi(D) = slope D + wall max(0, D - margin)^2.

    D is a section's mean squared distance in squared limits, so that D = 1 is just kept.
    """

    slope: float  # bits for D from 0 to 1 in a section
    wall: float  # bits for a D that exceeds the margin by 1; soft, so that descent can cross it
    margin: float  # a D below 1, because what is evaluated differs a little from what is predicted


@dataclass(frozen=True, slots=True)
class EncoderSettings:
    """How widely the encoder searches, and what it weighs."""

    # Axes: refinement levels tried, beyond those of the centroids' own fewest bits. A coarser axis
    # often saves more bits than sections then need (table: levels).
    axis_levels: tuple[int, ...] = (0, -1)
    # Steps of the axis, in tolerances (table: axis steps). These and the next value were chosen for
    # the five sets of the table; neighbouring values change a set's bytes by 5 to 10 % either way.
    axis_steps: tuple[float, ...] = (1.0, 1.5, 2.0)
    # Squared error, in squared steps summed over sections, that a bit of the first axis is worth:
    # few bits, because sections take up what it leaves.
    axis_bit_worth: float = 0.1
    # Whether end sections may lean out of the axis, as oblique images do (table: tilts).
    tilts: bool = True

    # Sections: steps of shape coefficients, in tolerances, best guess first (table: section steps).
    section_steps: tuple[float, ...] = (0.75, 0.5, 1.0)
    # Steps where none of those keeps the tolerance.
    finer_steps: tuple[float, ...] = (0.35, 0.25, 0.15)
    # Squared error, in squared steps, that a bit is worth before any refinement.
    bit_worth: float = 0.1
    # Differences smaller than this are stored as zero where bits count: a zero is so much cheaper
    # than a one that rounding from 1/2 up would cost more bits than it saves error.
    dead_zone: float = 0.6
    # Bits of a key section: before its integers are known, and beside them once they are.
    key_bits: float = 16.0
    key_own_bits: float = 6.0
    # Rotations of half-curves that cut the error below this share are used (table: rotation).
    rotation_used: float = 0.7

    # Refinement: rounds of linearise, descend, evaluate, for choosing an axis, and for the chosen.
    choice_rounds: int = 3
    rounds: int = 3
    # Edge points of a boundary that stand for all of it while integers are chosen; evaluated is
    # what comes out by all of them.
    points: int = 36
    # Whether the penalty is raised for sections that were missed (table: penalty learned).
    penalty_learned: bool = True
    # With sections kept each to its limit: nothing for errors well inside it, and a wall from 96 %.
    penalty: Penalty = Penalty(0.3, 300.0, 0.96)
    # To come as near as the steps allow, where the question is whether a tolerance can be kept.
    nearest_penalty: Penalty = Penalty(30.0, 3000.0, 0.9)
    # Where all sections together are promised: slope D so that errors cost this share of the bits,
    # because bits go with the logarithm of the error.
    overall_fraction: float = 0.4
    # How many of the smallest encodings have their key sections moved, dropped and added one by
    # one, in how many rounds, and the bits such a move must save (table: full effort).
    moved: int = 0
    moved_rounds: int = 6
    moved_bits: float = 0.5

    # Stacks of so many sections are searched by about `sample` of them first.
    many_sections: int = 192
    sample: int = 48


QUICK = EncoderSettings()
FULL = EncoderSettings(moved=2)
SETTINGS: dict[Effort, EncoderSettings] = {"quick": QUICK, "full": FULL}


def sample_settings(settings: EncoderSettings) -> EncoderSettings:
    """Return the settings for a sample: its encoding is only a start for that of all sections."""
    # The middle axis step and two section steps. More rounds: on a sample they are quick.
    return replace(settings, axis_steps=(1.5,), section_steps=settings.section_steps[::2], rounds=5)
