"""A specimen's tubes at rest: beams that join, their surfaces, walls and fluids; the strands."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from app.anatomy import (
    Anatomy,
    TubeLine,
    TubeTable,
    anatomy_network,
    place_of,
    tube_lines,
    tube_organ,
)
from app.simulation.specimen.dissection import DRIVING_POINTS_PER_SPAN, Dissection
from app.simulation.specimen.preset import OrganBeam, Preset
from app.simulation.specimen.surface_mapping import SurfaceMapping
from organ_geometry import DrivingPoints
from physics import Beam
from physics.bed import BeamOnBed, Flow, Network, SpaceBeam, Strands

Floats = NDArray[np.float64]


def no_fluids(_: BeamOnBed) -> dict[str, Flow]:
    """Return the fluids of tubes that have none."""
    return {}


@dataclass(frozen=True, eq=False)
class Tubes:
    """Tubes at rest in the tissue that holds them; of a single duct there is one.

    Attributes
    ----------
    network, strands, floor
        As `BeamOnBed` takes them.
    dissections
        Of each tube: its surface, and how that follows the beam.
    strengths
        Of each tube: the stress at which its wall tears, MPa.
    fluids
        Returns the fluids in the tubes of a network on its bed, by name.
    """

    network: Network
    strands: Strands
    floor: tuple[Floats, ...] | None
    dissections: tuple[Dissection, ...]
    strengths: tuple[float, ...]
    fluids: Callable[[BeamOnBed], Mapping[str, Flow]] = no_fluids

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of the tubes, in order."""
        return tuple(self.network.tubes)

    @cached_property
    def tear_speeds(self) -> dict[str, float]:
        """How fast a tear crosses the wall, mm/s, of the tubes that do not part at once."""
        speeds = zip(
            self.names, (each.preset.tear_mm_per_s for each in self.dissections), strict=True
        )
        return {name: speed for name, speed in speeds if speed is not None}

    @cached_property
    def strands_of(self) -> tuple[NDArray[np.int64], ...]:
        """Of each tube the numbers of the strands that hold it."""
        return tuple(np.flatnonzero(self.strands.tubes == each) for each in range(len(self.names)))

    @cached_property
    def press_stresses(self) -> tuple[Floats, ...]:
        """Of each tube, at its nodes: the wall's stress by a force across it of 1 N, MPa.

        The force bends a beam on an elastic foundation, of the strands that hold it, by
        F / (4 beta) with beta^4 = k / (4 E I) (Hetenyi 1946), one that is clamped at both ends by
        F L / 8; the smaller counts.
        """
        return tuple(
            _press_stress(rest, float(self.strands.stiffness[mine].sum()))
            for rest, mine in zip(self.network.tubes.values(), self.strands_of, strict=True)
        )

    @cached_property
    def surfaces(self) -> tuple[SurfaceMapping, ...]:
        """Of each tube: how its surface follows the beam."""
        return tuple(
            SurfaceMapping(dissection, rest, self.strands.some(mine), name)
            for dissection, (name, rest), mine in zip(
                self.dissections, self.network.tubes.items(), self.strands_of, strict=True
            )
        )

    @classmethod
    def of_anatomy(cls, anatomy: Anatomy, *, touching: bool = True, clear: bool = True) -> "Tubes":
        """Return the tubes of an anatomy, whose frame is the beams'; whether they touch."""
        made = anatomy_network(anatomy, touching=touching, clear=clear)
        lines = tube_lines(anatomy)
        return cls(
            made.network,
            made.strands,
            made.floor,
            tuple(
                _dissection(anatomy, each, lines[each.name], made.network.tubes[each.name])
                for each in anatomy.tube
            ),
            tuple(float(each.strength_MPa) for each in anatomy.tube),
            made.flows,
        )


def tube_preset(tube: TubeTable) -> Preset:
    """Return the wall of an anatomy's tube as a preset."""
    return Preset(
        name=tube.name,
        beam=OrganBeam(wall_mm=float(tube.wall_mm)),
        modulus_MPa=float(tube.modulus_MPa),
        law="linear",
        break_stress_MPa=float(tube.strength_MPa),
        tear_mm_per_s=None if tube.tear_mm_per_s is None else float(tube.tear_mm_per_s),
        source=tube.source or "The anatomy's file.",
    )


def _dissection(anatomy: Anatomy, tube: TubeTable, line: TubeLine, rest: SpaceBeam) -> Dissection:
    """Return a tube's surface, its organ's or a round one, driven along the tube's axis."""
    preset, organ = tube_preset(tube), tube_organ(anatomy, tube, line)
    rows, origin = place_of(anatomy)
    beam = Beam.round(
        span=rest.span,
        diameter=2.0 * float(line.radius.mean()),
        modulus=preset.modulus_MPa,
        poisson_ratio=preset.poisson_ratio,
        wall=float(tube.wall_mm),
    )
    clamps = 0.0, organ.length
    driving = DrivingPoints.of(
        organ, spacing=organ.length / DRIVING_POINTS_PER_SPAN, at=np.array(clamps)
    )
    return Dissection(organ, preset, beam, clamps, driving, rows.T.copy(), origin)


def _press_stress(rest: SpaceBeam, held: float) -> Floats:
    """Return the stress by a force across a beam of 1 N at its nodes, (N,) MPa; `held` in N/mm."""
    assert rest.wall is not None  # noqa: S101 (every tube here has a wall)
    bending = rest.stiffness[:, 4:].min(axis=1)
    bending = np.concatenate([bending[:1], 0.5 * (bending[1:] + bending[:-1]), bending[-1:]])
    decay = (held / rest.span / (4.0 * bending)) ** 0.25
    moment = 1.0 / np.maximum(4.0 * decay, 8.0 / rest.span)
    stress: Floats = moment / rest.wall[:, 1:].min(axis=1)
    return stress
