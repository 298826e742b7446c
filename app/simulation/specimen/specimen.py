"""A specimen: what is in hand, as a value, and the one recipe from it to beams and strands."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property, lru_cache

from app.anatomy import Anatomy, tube_line, tube_organ, wall_of
from app.bed_preset import BedPreset, bed_named
from app.relaxation_preset import relaxation_named
from app.simulation.specimen.dissection import Dissection
from app.simulation.specimen.preset import Preset, RoundBeam
from app.simulation.specimen.tubes import Tubes, tube_preset
from organ_geometry import Organ
from physics import Beam, Exact, Linear, Theory
from physics.bed import BeamOnBed, Bed, Network, Relaxation, SpaceBeam, Strands
from physics.quantity import positive

DUCT = "duct"
"""Name of the tube where there is one."""
LINEAR_UP_TO = 0.3
"""Strength over modulus up to which every duct of the linear law breaks (docs/theory.md)."""
THRESHOLD_RANGE = (0.25, 2.0)
"""Smallest and largest threshold that may be set, in thresholds of the specimen itself."""


@dataclass(frozen=True)
class Specimen:
    """A duct of a preset's beam or an organ's sections, and what holds and solves it.

    Without an `organ` it is the preset's own round beam. A `theory` solves a free duct in the plane
    of its pull; without one the duct is a beam in space, free or in a `bed`, whose wall has the
    preset's law. An `anatomy` has several tubes and its own tissue (`of_anatomy`).
    """

    preset: Preset
    organ: Organ | None = None
    bed: BedPreset | None = None
    _: KW_ONLY
    bed_seed: int = 1  # of the bed's scatter
    theory: Theory | None = None
    threshold_MPa: float | None = None  # the preset's own when None  # noqa: N815
    # how strands and walls relax in space: not at all, as bed and preset have it, or by constants
    # of its own
    relaxation: bool | tuple[Relaxation | None, Relaxation | None] = False
    anatomy: Anatomy | None = None  # of several tubes, of which preset and organ are the first's
    tubes_touch: bool = True  # whether these touch each other
    clear_strands: bool = True  # whether no strand leads through one that it does not hold

    def __post_init__(self) -> None:
        if self.anatomy is not None and (self.bed is not None or self.theory is not None):
            raise ValueError(
                f"the anatomy {self.anatomy.name!r} has its own tissue: it takes no bed and no "
                "theory of the plane"
            )
        if self.bed is not None and self.theory is not None:
            raise ValueError(
                f"a duct in a bed is a beam in space, not solved by the {self.theory.name} theory"
            )
        if self.threshold_MPa is not None:
            positive(self.threshold_MPa, "threshold", "MPa")

    @classmethod
    def of_sections(
        cls,
        preset: Preset,
        organ: Organ | None,
        bed: BedPreset | None = None,
        *,
        bed_seed: int = 1,
        theory: Theory | None = None,
        threshold_MPa: float | None = None,  # noqa: N803
        relaxation: bool = False,
    ) -> "Specimen":
        """Return a specimen that has an organ only where the organ's sections are solved."""
        if organ is not None and isinstance(preset.beam, RoundBeam):
            raise ValueError(f"preset {preset.name} brings its own beam; leave out the organ")
        if organ is None and not isinstance(preset.beam, RoundBeam):
            raise ValueError(f"preset {preset.name} takes an organ's own sections: give an organ")
        return cls(
            preset,
            organ,
            bed,
            bed_seed=bed_seed,
            theory=theory,
            threshold_MPa=threshold_MPa,
            relaxation=relaxation,
        )

    @classmethod
    def of_anatomy(cls, anatomy: Anatomy, *, relaxation: bool = False) -> "Specimen":
        """Return an anatomy's tubes in their tissue."""
        first = anatomy.tube[0]
        organ = tube_organ(anatomy, first, tube_line(first))
        return cls(tube_preset(first), organ, anatomy=anatomy, relaxation=relaxation)

    def tubes(self, *, elements: int) -> Tubes:
        """Return the tubes at rest; a single duct's beam has so many elements."""
        if self.anatomy is not None:
            return self._anatomy_tubes
        return _single_tube(self, elements)

    @cached_property
    def _anatomy_tubes(self) -> Tubes:
        assert self.anatomy is not None  # noqa: S101 (the caller has looked)
        return Tubes.of_anatomy(self.anatomy, touching=self.tubes_touch, clear=self.clear_strands)

    @cached_property
    def dissection(self) -> Dissection:
        """The organ between its clamps."""
        if self.anatomy is not None:
            return self._anatomy_tubes.dissections[0]
        if self.organ is None:
            raise ValueError(f"preset {self.preset.name} is solved without an organ here")
        return _dissection(self.organ, self.preset)

    @cached_property
    def beam(self) -> Beam:
        """The beam that stands for the duct in the plane of its pull."""
        return self.preset.round_beam() if self.organ is None else self.dissection.beam

    @property
    def solved_by(self) -> Theory:
        """The theory, or the one that the beam in space equals where no bed holds it."""
        return Exact(self.preset.law_in_space) if self.theory is None else self.theory

    def relaxing(self, wanted: bool | None = None) -> tuple[Relaxation | None, Relaxation | None]:
        """How strands and walls relax; constants of its own stay where another choice is wanted."""
        if isinstance(self.relaxation, tuple):
            return self.relaxation
        if not (self.relaxation if wanted is None else wanted):
            return None, None
        names = None if self.bed is None else self.bed.relaxation, self.preset.relaxation
        if (anatomy := self.anatomy) is not None:
            layers = {bed_named(each.preset).relaxation for each in anatomy.layer}
            walls: set[str | None] = {wall_of(each.kind).relaxation for each in anatomy.tube}
            names = _alike(layers, "layers"), _alike(walls, "tubes")
        strands, wall = (None if each is None else relaxation_named(each).made() for each in names)
        return strands, wall

    @cached_property
    def threshold(self) -> float:
        """Stress at which the wall tears, MPa."""
        if self.threshold_MPa is not None:
            return self.threshold_MPa
        return self.preset.threshold(self.solved_by, self.beam)

    @property
    def doubt(self) -> str:
        """Why its law is not good up to its strength, or nothing."""
        solved = self.solved_by
        linear = isinstance(solved, Exact) and solved.law == Linear(shear=True)
        if not linear or self.organ is None:
            return ""
        most = LINEAR_UP_TO * self.beam.modulus
        if self.threshold <= most:
            return ""
        return (
            "by the linear law a section shears instead of being stretched beyond some "
            f"{1e3 * most:.4g} kPa, below the threshold: the duct may never break, and its "
            "distance to break may rise while it is stretched"
        )

    @property
    def section(self) -> str:
        """Which section is solved, in words."""
        if self.organ is not None:
            return self.dissection.section(self.solved_by)
        kind = self.preset.beam
        full = isinstance(kind, RoundBeam) and kind.wall_mm is None
        return "a full round bar" if full else "a round tube"

    def space_beam(self, *, elements: int, nodes_at: Sequence[float] = ()) -> SpaceBeam:
        """Return the beam in space, with nodes at some stations, mm from the first clamp."""
        if self.organ is None:
            law = self.preset.law_in_space
            return SpaceBeam.of(self.beam, law=law, elements=elements, nodes_at=nodes_at)
        return self.dissection.space_beam(elements=elements, nodes_at=nodes_at)

    def layer(self, beam: SpaceBeam, strands: int | None = None) -> Bed | None:
        """Return the bed under the beam in space, of the preset's own number of strands if None."""
        if self.bed is None:
            return None
        return self.bed.bed(beam, seed=self.bed_seed, strands=strands)

    def on_bed(self, beam: SpaceBeam, *, rods: int = 0, retrace: bool = False) -> BeamOnBed:
        """Return the beam in space on its bed, or free, in real time."""
        layer = self.layer(beam)
        strands, wall = self.relaxing()
        if layer is None:
            return BeamOnBed(beam, rods=rods, retrace=retrace, wall_relaxation=wall)
        return BeamOnBed(
            beam,
            layer.strands_under(beam),
            floor=layer.floor_under(beam),
            rods=rods,
            retrace=retrace,
            strand_relaxation=strands,
            wall_relaxation=wall,
        )


@lru_cache(maxsize=32)
def _single_tube(specimen: Specimen, elements: int) -> Tubes:
    """Return a single duct's tube: made once for all who practise on it."""
    network = _free_tube(specimen.preset, specimen.organ, elements)
    rest = network.tubes[DUCT]
    layer = specimen.layer(rest)
    return Tubes(
        network,
        Strands.joined([]) if layer is None else layer.strands_under(rest),
        None if layer is None else (layer.floor_under(rest),),
        (specimen.dissection,),
        (specimen.threshold,),
    )


@lru_cache(maxsize=8)
def _free_tube(preset: Preset, organ: Organ | None, elements: int) -> Network:
    """Return a single duct's beam: made once for all beds that it lies in."""
    return Network({DUCT: Specimen(preset, organ).space_beam(elements=elements)})


@lru_cache(maxsize=8)
def _dissection(organ: Organ, preset: Preset) -> Dissection:
    return Dissection.of(organ, preset)


def _alike(names: set[str | None], what: str) -> str | None:
    """Return the one relaxation that all have."""
    if len(names) > 1:
        raise ValueError(
            f"{what} of an anatomy relax alike, not by {', '.join(sorted(map(str, names)))}"
        )
    return names.pop() if names else None
