# SciPy has no types.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportAttributeAccessIssue=false, reportArgumentType=false
"""Modulus, Poisson's ratio and strength of ducts from their measured pulls.

Every theory's force is F = E phi(d), with phi its force for a modulus of 1 MPa, which depends on
the geometry and on Poisson's ratio nu. So E follows in closed form for each nu, and the sum of
squares is RSS(E, nu) = R(nu) + s(nu) (E - E(nu))^2, s = sum phi^2, E(nu) = sum phi F / s.

Regions are of the profile likelihood for noise of the force that is normal, independent and
everywhere the same: a parameter is in its 95 % region where the least RSS that it allows is below
RSS_min (1 + t^2/(n - p)), t of Student's distribution with n - p degrees of freedom. For E alone
that is the exact interval of linear regression.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from app.study.curves import Curve
from physics import (
    Beam,
    Cubic,
    NoEquilibrium,
    Theory,
    check_rupture,
    critical_stations,
)

Row = NDArray[np.float64]
Identifiability = Literal["identified", "correlated", "unidentified", "fixed"]
"""How far data tell a parameter: it may be correlated with another one, or was not sought."""

FARTHEST = 5.0
"""Deflection, in spans, beyond which a unit is wrong rather than a duct that long."""
# Poisson's ratios that are tried first.
RATIOS = np.linspace(0.0, 0.495, 34)
# How many times as likely noise in proportion to force must be before it is named: of curves whose
# noise is the same everywhere at most one in so many is misjudged.
LIKELIER = 100.0
TISSUE = 1e-3, 100.0
"""Moduli, MPa, beyond which a unit is probably wrong: of the presets 0.05 to 11.3."""
BOUND = 0.95
"""Correlation from which on two parameters are warnings to trade against each other."""


@dataclass(frozen=True, slots=True)
class MeasuredPull:
    """A curve and the duct that it was measured on."""

    curve: Curve
    beam: Beam  # its modulus is not looked at
    grasp: float  # mm from the first clamp


@dataclass(frozen=True, slots=True)
class Estimate:
    """A parameter with its 95 % region."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    identifiability: Identifiability = "identified"

    @property
    def key(self) -> str:
        """Its name in JSON."""
        return self.name.replace("'s ", "_").replace(" ", "_").lower()


@dataclass(frozen=True, slots=True)
class Fit:
    """What curves say of the material."""

    modulus: Estimate
    poisson_ratio: Estimate
    strength: Estimate | None  # where a curve ends with the break
    noise: float  # standard deviation of the force, N
    correlation: float | None  # of modulus and Poisson's ratio, where both are sought
    condition: float | None  # of the scaled Jacobian, where both are sought
    residuals: list[Row]  # of each curve, N: measured less fitted
    alone: list[float]  # modulus of each curve by itself, MPa
    warnings: list[str]  # what the data cannot tell, in plain words

    @property
    def sought(self) -> list[Estimate]:
        """The parameters."""
        found = [self.modulus, self.poisson_ratio]
        return found if self.strength is None else [*found, self.strength]


def _uses_poisson(theory: Theory) -> bool:
    """Return whether a theory's force depends on Poisson's ratio."""
    return bool(theory.options.get("shear"))


def fit_pulls(pulls: list[MeasuredPull], theory: Theory, *, free_ratio: bool = False) -> Fit:
    """Return what the pulls of ducts of one material say of it.

    Parameters
    ----------
    pulls, theory
        One curve or more, and that which the forces are taken to follow.
    free_ratio
        Whether Poisson's ratio is sought, too, instead of taken from the beams.

    Returns
    -------
    Fit
        The parameters with their regions, and what the data cannot tell.

    Raises
    ------
    ValueError
        If the theory cannot follow a curve, or has no Poisson's ratio that could be sought.
    """
    if free_ratio and not _uses_poisson(theory):
        raise ValueError(
            f"the force of the {theory.name} theory does not depend on Poisson's ratio: it cannot "
            "be told; take exact with --shear or --law neo-hooke"
        )
    for each in pulls:
        far = float(each.curve.deflections.max()) / each.beam.span
        if far > FARTHEST:
            raise ValueError(
                f"{each.curve.name}: a deflection of {each.curve.deflections.max():.4g} mm is "
                f"{far:.3g} spans: is its unit right?"
            )
    measured = np.concatenate([each.curve.forces for each in pulls])
    problem = _Problem(pulls, theory, measured)
    count, sought = measured.size, 1 + int(free_ratio)
    if count <= sought + 1:
        raise ValueError(f"{count} points are too few for {sought} parameters")
    t = student(count - sought)
    given = pulls[0].beam.poisson_ratio
    warnings: list[str] = []
    correlation = condition = None
    if free_ratio:
        ratio, modulus, correlation, condition = _both(problem, t, warnings)
    else:
        least, e, scale = problem.best(given)
        half = t * math.sqrt(least / (count - 1) / scale)
        modulus = Estimate("modulus", "MPa", e, e - half, e + half)
        ratio = Estimate("Poisson's ratio", "", given, given, given, "fixed")
        if _uses_poisson(theory):
            warnings.append(
                f"Poisson's ratio was taken as {given:g}; the modulus depends on it by "
                f"{problem.slope_by_ratio(given):.2g} % for each 0.01"
            )
    phi = problem.forces(ratio.value)
    ends = np.cumsum([each.curve.forces.size for each in pulls])[:-1]
    residuals = np.split(measured - modulus.value * phi, ends)
    noise = math.sqrt(float(sum(np.sum(each**2) for each in residuals)) / (count - sought))
    alone = [
        float(shape @ each.curve.forces / (shape @ shape))
        for shape, each in zip(np.split(phi, ends), pulls, strict=True)
    ]
    warnings += _of_residuals(residuals, measured, theory)
    warnings += _of_noise(measured, modulus.value * phi, modulus.value, sought)
    warnings += _of_curves(residuals, np.split(phi, ends), (modulus.value, alone), count - sought)
    if not TISSUE[0] <= modulus.value <= TISSUE[1]:
        warnings.append(
            f"a modulus of {modulus.value:.3g} MPa is none of soft tissue ({TISSUE[0]:g} to "
            f"{TISSUE[1]:g} MPa): are the units of force and length right?"
        )
    strength = _strength(problem, modulus, ratio, warnings)
    return Fit(
        modulus,
        ratio,
        strength,
        noise,
        correlation,
        condition,
        list(residuals),
        alone,
        warnings,
    )


class _Problem:
    """Forces of a modulus of 1 MPa, by Poisson's ratio."""

    def __init__(self, pulls: list[MeasuredPull], theory: Theory, measured: Row) -> None:
        self.pulls = pulls
        self.theory = theory
        self.measured = measured
        self._known: dict[float, Row] = {}

    def forces(self, ratio: float) -> Row:
        """Return phi at all points."""
        if ratio not in self._known:
            rows = [self._forces_of(each, ratio) for each in self.pulls]
            self._known[ratio] = np.concatenate(rows)
        return self._known[ratio]

    def _forces_of(self, measured: MeasuredPull, ratio: float) -> Row:
        beam = measured.beam.of_material(1.0, ratio)
        pull = self.theory.pull(beam, measured.grasp)
        found = np.empty_like(measured.curve.deflections)
        for i in np.argsort(measured.curve.deflections):  # each from the one before
            place = float(measured.curve.deflections[i])
            try:
                found[i] = pull.to_deflection(place).force
            except NoEquilibrium as lost:
                raise ValueError(f"{measured.curve.name}, {place:.4g} mm: {lost}") from None
        return found

    def best(self, ratio: float) -> tuple[float, float, float]:
        """Return the least sum of squares with a ratio, its modulus, and sum phi^2."""
        phi = self.forces(ratio)
        scale = float(phi @ phi)
        modulus = float(phi @ self.measured) / scale
        return float(np.sum((self.measured - modulus * phi) ** 2)), modulus, scale

    def slope_by_ratio(self, ratio: float) -> float:
        """Return the change of the modulus, %, for 0.01 of Poisson's ratio."""
        up = min(ratio + 0.005, 0.495)
        there, here = self.best(up)[1], self.best(up - 0.01)[1]
        return 100.0 * (there / here - 1.0)

    def stress_at_end(self, measured: MeasuredPull, ratio: float) -> float:
        """Return the highest stress at a curve's last deflection for a modulus of 1 MPa."""
        beam = measured.beam.of_material(1.0, ratio)
        pull = self.theory.pull(beam, measured.grasp)
        pull.to_deflection(float(measured.curve.deflections[-1]))
        return check_rupture(pull.sample(critical_stations(beam, measured.grasp)), 1.0).total_stress


def _both(
    problem: _Problem, t: float, warnings: list[str]
) -> tuple[Estimate, Estimate, float, float]:
    """Return Poisson's ratio, the modulus, their correlation and the Jacobian's condition."""
    from scipy.optimize import brentq, minimize_scalar

    def least(ratio: float) -> float:
        return problem.best(ratio)[0]

    tried = np.array([least(float(ratio)) for ratio in RATIOS])
    k = int(np.argmin(tried))
    around = float(RATIOS[max(k - 1, 0)]), float(RATIOS[min(k + 1, RATIOS.size - 1)])
    found = minimize_scalar(least, bounds=around, method="bounded", options={"xatol": 1e-6})
    ratio, rss = float(found.x), float(found.fun)
    if tried[k] < rss:
        ratio, rss = float(RATIOS[k]), float(tried[k])
    count = problem.measured.size
    limit = rss * (1.0 + t**2 / (count - 2))

    def over(at: float) -> float:
        return least(at) - limit

    ends: list[float] = []
    for edge in (float(RATIOS[0]), float(RATIOS[-1])):
        inside = over(edge) <= 0.0
        ends.append(edge if inside else float(brentq(over, *sorted((edge, ratio)), xtol=1e-6)))
    low, high = ends
    # For each ratio in its region, the moduli that leave the sum of squares below the limit.
    reach: list[tuple[float, float]] = []
    for at in np.linspace(low, high, 41).tolist():
        rest, e, scale = problem.best(at)
        half = math.sqrt(max(limit - rest, 0.0) / scale)
        reach.append((e - half, e + half))
    e = problem.best(ratio)[1]
    step = 1e-4
    first, last = max(ratio - step, 0.0), min(ratio + step, 0.495)
    slope = e * (problem.forces(last) - problem.forces(first)) / (last - first)
    jacobian = np.stack([problem.forces(ratio) * e, slope], axis=1)
    jacobian = jacobian / np.sqrt((jacobian**2).sum(axis=0))
    # Of two columns of length 1 with the cosine c: correlation -c, condition ((1+|c|)/(1-|c|))^.5.
    cosine = float(jacobian[:, 0] @ jacobian[:, 1])
    condition = math.sqrt((1.0 + abs(cosine)) / max(1.0 - abs(cosine), 1e-16))
    at_edge = low <= float(RATIOS[0]) + 1e-6 or high >= float(RATIOS[-1]) - 1e-6
    of_ratio: Identifiability = "unidentified" if high - low > 0.3 else "identified"
    of_modulus: Identifiability = "correlated" if abs(cosine) > BOUND else "identified"
    if of_modulus == "correlated":
        warnings.append(
            f"modulus and Poisson's ratio trade against each other (correlation {-cosine:+.3f}, "
            f"condition {condition:.3g}): a stiffer duct with another ratio gives almost the same "
            "curve, so their regions are wide together"
        )
    if of_ratio == "unidentified":
        warnings.append(
            f"Poisson's ratio can hardly be told from these curves: anything from {low:.2f} to "
            f"{high:.2f} follows them as well; measure it another way and give it"
        )
    elif at_edge:
        warnings.append(
            f"Poisson's ratio runs to the end of what it can be, {ratio:.3g}: the theory may not "
            "follow these curves"
        )
    return (
        Estimate("Poisson's ratio", "", ratio, low, high, of_ratio),
        Estimate(
            "modulus", "MPa", e, min(a for a, _ in reach), max(b for _, b in reach), of_modulus
        ),
        -cosine,
        condition,
    )


def _strength(
    problem: _Problem, modulus: Estimate, ratio: Estimate, warnings: list[str]
) -> Estimate | None:
    """Return the strength by the curves that end with the break."""
    broken = [each for each in problem.pulls if each.curve.broke]
    if not broken:
        warnings.append(
            "no curve ends with a break: they say nothing of the strength but a lower bound"
        )
        return None
    fractions = np.array([problem.stress_at_end(each, ratio.value) for each in broken])
    breaks = modulus.value * fractions
    mean = float(breaks.mean())
    # Of the modulus, whose error all breaks share.
    shared = 0.5 * (modulus.high - modulus.low) / modulus.value * mean
    if len(broken) == 1:
        warnings.append(
            "one break says nothing of how strengths scatter: the region of the strength is that "
            "of the modulus alone"
        )
        half = shared
    else:
        scatter = float(breaks.std(ddof=1)) / math.sqrt(len(broken))
        half = math.hypot(student(len(broken) - 1) * scatter, shared)
    return Estimate("strength", "MPa", mean, mean - half, mean + half)


def _of_residuals(residuals: list[Row], measured: Row, theory: Theory) -> list[str]:
    """Say whether the theory follows the curves."""
    warnings: list[str] = []
    largest = max(float(np.abs(each).max()) for each in residuals)
    fraction = largest / float(np.abs(measured).max())
    if any(in_streaks(each) for each in residuals) and fraction > 1e-3:
        fitted = ", with a constant q," if isinstance(theory, Cubic) else ""
        warnings.append(
            f"the residuals run in streaks, up to {100.0 * fraction:.2g} % of the largest force: "
            f"the {theory.name} theory{fitted} does not follow these curves, and the regions, "
            "which know of noise only, are too narrow"
        )
    return warnings


def _of_noise(measured: Row, fitted: Row, modulus: float, sought: int) -> list[str]:
    """Say whether noise in proportion to force is far likelier than the same noise everywhere."""
    forced = fitted != 0.0
    count = int(forced.sum())
    relative = measured[forced] / fitted[forced]  # about 1
    factor = float(relative.mean())
    alike = float(np.sum((measured - fitted) ** 2)) / measured.size
    apart = float(np.mean((relative - factor) ** 2))
    if count < max(8, sought + 2) or not (alike > 0.0 and apart > 0.0) or count < measured.size - 1:
        return []
    # Logarithms of the likelihoods of these points, each at its own best modulus and noise.
    fall = 0.5 * count * math.log(alike / apart) - float(np.log(np.abs(fitted[forced])).sum())
    if fall <= math.log(LIKELIER):
        return []
    sd = math.sqrt(apart * count / (count - sought))
    half = student(count - sought) * sd / math.sqrt(count)
    low, high = modulus * (factor - half), modulus * (factor + half)
    return [
        f"the noise grows with the force, {100.0 * sd:.2g} % of it: the regions, which take it as "
        "the same everywhere, are too narrow; weighed by that noise the modulus is "
        f"{modulus * factor:.4g} MPa ({low:.4g} to {high:.4g})"
    ]


def in_streaks(residuals: Row) -> bool:
    """Return whether signs of residuals follow one another longer than chance has it (1 in 100)."""
    # Wald and Wolfowitz's test of runs, in its normal approximation.
    signs = residuals[residuals != 0.0] > 0.0
    ups, downs = int(signs.sum()), int((~signs).sum())
    count = ups + downs
    if count < 8 or not ups or not downs:
        return count >= 8
    runs = 1 + int(np.count_nonzero(signs[1:] != signs[:-1]))
    mean = 1.0 + 2.0 * ups * downs / count
    variance = (mean - 1.0) * (mean - 2.0) / (count - 1)
    return variance > 0.0 and (runs - mean) / math.sqrt(variance) < -2.326


def _of_curves(
    residuals: list[Row], phis: list[Row], moduli: tuple[float, list[float]], freedom: int
) -> list[str]:
    """Say whether curves differ by more than their noise (F test, 1 in 100)."""
    common, alone = moduli
    more = len(alone) - 1
    if not more:
        return []
    from scipy.stats import f

    together = sum(float(np.sum(each**2)) for each in residuals)
    apart = sum(
        float(np.sum((each + (common - e) * phi) ** 2))
        for each, phi, e in zip(residuals, phis, alone, strict=True)
    )
    least = float(f.ppf(0.99, more, freedom - more))
    if together - apart <= least * more * apart / (freedom - more):
        return []
    return [
        f"the curves differ by more than their noise: alone they give moduli from "
        f"{min(alone):.4g} to {max(alone):.4g} MPa; the region is that of one common modulus, not "
        "of the scatter between ducts"
    ]


def student(freedom: int) -> float:
    """Return the quantile of Student's distribution for a region of 95 %."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.975))
