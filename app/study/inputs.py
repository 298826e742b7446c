"""What a study can vary, with units and limits."""

from dataclasses import dataclass

from app.simulation import LIMITS
from physics.exact import MOST_STIFFENING

BED = "bed."
"""Prefix of the inputs of a bed."""
ANATOMY = "anatomy."
"""Prefix of the inputs of an anatomy."""


@dataclass(frozen=True, slots=True)
class Input:
    """A number within limits, or a word."""

    unit: str = ""
    low: float | None = None  # None: a word
    high: float = 0.0
    whole: bool = False  # a whole number
    words: tuple[str, ...] = ()  # the only ones; any if none

    @property
    def is_number(self) -> bool:
        """Whether it is a number."""
        return self.low is not None

    def check(self, value: object) -> None:
        """Raise a `ValueError` unless this is a value of the input."""
        if self.low is None:
            if not isinstance(value, str):
                raise ValueError(f"must be a word in quotes, got {value!r}")
            if self.words and value not in self.words:
                raise ValueError(f"must be one of {', '.join(self.words)}, got {value!r}")
            return
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"must be a number, got {value!r}")
        if self.whole and value != int(value):
            raise ValueError(f"must be a whole number, got {value!r}")
        if not self.low <= value <= self.high:
            unit = f" {self.unit}" if self.unit else ""
            raise ValueError(f"must be from {self.low:g} to {self.high:g}{unit}, got {value:g}")


def _limited(name: str) -> Input:
    low, high, unit = LIMITS[name]
    return Input(unit, low, high)


DUCT_INPUTS: dict[str, Input] = {
    "preset": Input(),
    "organ": Input(),
    "theory": Input(words=("cubic", "string", "exact", "fem", "mass-spring")),
    "law": Input(words=("linear", "linear with shear", "neo-hooke", "exponential")),
    "stiffening": Input("", 0.0, MOST_STIFFENING),
    "q": Input("", 0.0, 2.0),
    **{name: _limited(name) for name in LIMITS if not name.endswith("_factor")},
    "grasp_mm": Input("mm", 1e-3, 1e4),
    "grasp_fraction": Input("", 0.001, 0.999),
    "force_N": Input("N", -1e6, 1e6),
    "deflection_mm": Input("mm", -1e4, 1e4),
}
"""Of the duct and its pull; law and its stiffening belong to the exact theory, q to the cubic."""

BED_INPUTS: dict[str, Input] = {
    "bed.name": Input(words=("normal", "loose", "firm", "inflamed", "scar")),
    "bed.toughness_J_per_m2": Input("J/m2", 1e-3, 1e5),
    "bed.strength_kPa": Input("kPa", 1e-3, 1e5),
    "bed.stiffness_kPa_per_mm": Input("kPa/mm", 1e-3, 1e6),
    "bed.yield_mm": Input("mm", 1e-2, 1e2),
    "bed.failure_mm": Input("mm", 2e-2, 2e2),
    "bed.scatter": Input("", 0.0, 1.0),
    "bed.slack_mm": Input("mm", 0.0, 10.0),
    "bed.gap_mm": Input("mm", 0.1, 100.0),
    "bed.around_deg": Input("deg", 1.0, 180.0),
    "bed.seed": Input("", 0, 2**31, whole=True),
    "bed.hook_mm": Input("mm", 1e-3, 1e4),
    "bed.lift_mm": Input("mm", 1e-3, 1e3),
    "bed.steps": Input("", 2, 10_000, whole=True),
    "bed.step_s": Input("s", 1e-4, 1e4),
    "bed.hold_s": Input("s", 1e-4, 1e5),
    "bed.until": Input("", 0.001, 0.999),
    "bed.elements": Input("", 8, 2000, whole=True),
    "bed.strands": Input("", 8, 20_000, whole=True),
}
"""Of the bed, and of the hook that lifts the duct off it."""

ANATOMY_INPUTS: dict[str, Input] = {
    "anatomy.name": Input(),
    "anatomy.script": Input(),
    "anatomy.tube": Input(),
    "anatomy.at_mm": Input("mm", 0.0, 1e3),
    "anatomy.pull_mm": Input("mm", 1e-2, 500.0),
    "anatomy.azimuth_deg": Input("deg", -360.0, 360.0),
    "anatomy.elevation_deg": Input("deg", -90.0, 90.0),
    "anatomy.speed_mm_per_s": Input("mm/s", 0.1, 1e3),
    "anatomy.modulus_factor": Input("", 1e-2, 1e2),
    "anatomy.strength_factor": Input("", 1e-2, 1e2),
    "anatomy.toughness_factor": Input("", 1e-2, 1e2),
    "anatomy.artery_strength_MPa": Input("MPa", 1e-3, 1e3),
    "anatomy.duct_strength_MPa": Input("MPa", 1e-3, 1e3),
}
"""Of several tubes, and of the script or the pull that they are put to."""

INPUTS = DUCT_INPUTS | BED_INPUTS | ANATOMY_INPUTS
