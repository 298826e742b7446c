# SciPy has no types.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportUnknownLambdaType=false
"""Stiffness and toughness of the bed that a duct was lifted off, from its force-lift curves.

The model is the duct in space on its strands, lifted as far as the curve goes; its forces are
taken between steps in proportion. Sought are the logarithms of the layer's stiffness k and
toughness G; the elongations follow, yield_mm = (2 G / (k s))^(1/2) and failure_mm = s yield_mm,
with the bed's own ratio s. Regions are of the Jacobian at the best fit, in logarithms, with
Student's t.
"""

import math
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from app.simulation import BedPreset
from app.study.beds import lift
from app.study.fit import BOUND, Estimate, Identifiability, MeasuredPull, in_streaks, student
from physics.bed import SpaceBeam

Row = NDArray[np.float64]

ELEMENTS, STRANDS_A_MM, STEPS = 32, 4.0, 40
"""Of the model: coarser than the trainer's, by half a per cent of the force."""
WIDE = 3.0
"""Ratio of the ends of a region from which on a parameter is hardly told."""


@dataclass(frozen=True, slots=True)
class BedFit:
    """What curves say of a bed."""

    stiffness: Estimate
    toughness: Estimate
    noise: float  # standard deviation of the force, N
    correlation: float  # of the logarithms of both
    condition: float  # of the scaled Jacobian
    residuals: list[Row]  # of each curve, N: measured less fitted
    bed: BedPreset  # with what was found
    warnings: list[str]  # what the data cannot tell

    @property
    def sought(self) -> list[Estimate]:
        """The parameters."""
        return [self.stiffness, self.toughness]


def fit_bed(pulls: list[MeasuredPull], bed: BedPreset) -> BedFit:
    """Return what curves of ducts that were lifted say of the bed below."""
    from scipy.optimize import least_squares

    measured = np.concatenate([each.curve.forces for each in pulls])
    beams = [SpaceBeam.of(each.beam, elements=ELEMENTS, nodes_at=[each.grasp]) for each in pulls]

    def lifted(values: list[float]) -> list[tuple[Row, int]]:
        layer = _bed(bed, *values)
        return [_lifted(*each, layer) for each in zip(pulls, beams, strict=True)]

    def forces(logs: Row) -> Row:
        return np.concatenate([row for row, _ in lifted(np.exp(logs).tolist())])

    start = np.log(
        [2.0 * bed.toughness_J_per_m2 / (bed.yield_mm * bed.failure_mm), bed.toughness_J_per_m2]
    )
    found = least_squares(
        lambda logs: forces(logs) - measured,
        start,
        bounds=(start - math.log(300.0), start + math.log(300.0)),
        diff_step=0.01,
        x_scale=1.0,
        xtol=1e-6,
        ftol=1e-8,
    )
    freedom = measured.size - 2
    if freedom < 1:
        raise ValueError(f"{measured.size} points are too few for stiffness and toughness")
    noise = math.sqrt(2.0 * float(found.cost) / freedom)
    information = found.jac.T @ found.jac
    scale = np.sqrt(np.diag(information))
    if not np.all(scale > 0.0):
        raise ValueError("the forces do not depend on the bed: is the duct lifted at all?")
    cosine = float(information[0, 1] / (scale[0] * scale[1]))
    shared = max(1.0 - cosine**2, 1e-16)
    half = student(freedom) * noise / (scale * math.sqrt(shared))
    names = (("bed stiffness", "kPa/mm"), ("bed toughness", "J/m2"))
    values = np.exp(found.x).tolist()
    ends = [np.exp(found.x + sign * np.minimum(half, 30.0)).tolist() for sign in (-1.0, 1.0)]
    warnings: list[str] = []
    estimates: list[Estimate] = []
    for i, (name, unit) in enumerate(names):
        found_as: Identifiability = "identified"
        if ends[1][i] / ends[0][i] > WIDE:
            found_as = "unidentified"
            why = (
                " (no part of the curve shows strands part)"
                if i == 1 and not any(parted for _, parted in lifted(values))
                else ""
            )
            warnings.append(
                f"the {name} can hardly be told from these curves: anything from "
                f"{ends[0][i]:.3g} to {ends[1][i]:.3g} {unit} follows them as well{why}"
            )
        elif abs(cosine) > BOUND:
            found_as = "correlated"
        estimates.append(Estimate(name, unit, values[i], ends[0][i], ends[1][i], found_as))
    if abs(cosine) > BOUND:
        warnings.append(
            f"stiffness and toughness of the bed trade against each other (correlation "
            f"{-cosine:+.3f})"
        )
    ends_of = np.cumsum([each.curve.forces.size for each in pulls])[:-1]
    residuals = list(np.split(-found.fun, ends_of))
    largest = float(np.abs(found.fun).max()) / float(np.abs(measured).max())
    if any(in_streaks(each) for each in residuals) and largest > 0.01:
        warnings.append(
            f"the residuals run in streaks, up to {100.0 * largest:.2g} % of the largest force: "
            "this bed does not follow these curves, and the regions are too narrow"
        )
    warnings.append(
        f"everything else of the bed is that of {bed.name!r} and of its scattered strands, the "
        "duct's modulus as given"
    )
    return BedFit(
        estimates[0],
        estimates[1],
        noise,
        -cosine,
        math.sqrt((1.0 + abs(cosine)) / max(1.0 - abs(cosine), 1e-16)),
        residuals,
        _bed(bed, *values),
        warnings,
    )


def _bed(bed: BedPreset, stiffness: float, toughness: float) -> BedPreset:
    softening = bed.failure_mm / bed.yield_mm
    length = math.sqrt(2.0 * toughness / (stiffness * softening))
    return msgspec.structs.replace(
        bed, toughness_J_per_m2=toughness, yield_mm=length, failure_mm=softening * length
    )


def _lifted(measured: MeasuredPull, beam: SpaceBeam, bed: BedPreset) -> tuple[Row, int]:
    """Return the forces at a curve's lifts, and how many strands have parted at the last."""
    lifts = measured.curve.deflections
    strands = max(40, round(STRANDS_A_MM * beam.span))
    history = lift(
        beam, bed.bed(beam, strands=strands), at=measured.grasp, to=float(lifts.max()), steps=STEPS
    )
    steps = np.concatenate([[0.0], history.hands[:, 0, 2]])
    # What a gauge along the lift reads.
    forces = np.concatenate([[0.0], history.forces[:, 0, 2]])
    return np.interp(lifts, steps, forces), int(history.broken[-1])
