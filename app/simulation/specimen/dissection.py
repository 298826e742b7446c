"""A dissection: an organ between two clamps, and the beam that stands for it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray

from app.simulation.specimen.preset import (
    ASSUMED_PRESET,
    THESIS_PRESET,
    OrganBeam,
    Preset,
    RoundBeam,
    preset_named,
)
from assets import BILE_DUCT
from organ_geometry import DrivingPoints, Organ, SectionProperties
from organ_geometry.mesh import TornPiece, torn_pieces
from physics import Beam, Equilibrium, Linear, RuptureCheck, Theory, VaryingBeam
from physics.bed import SpaceBeam
from physics.section import Ring

SECTIONS_ALONG = 64
"""Stations at which an organ's section properties are taken for a varying beam."""
# Largest ratio of an organ's thickness to that of a preset's bar. Where the thesis's bar merely
# bends, the heart, 28 times as thick, is stretched to five times its length.
MOST_TIMES = 6.0
# So many follow a bend of one span to within a hundredth of the duct's radius.
DRIVING_POINTS_PER_SPAN = 60


@dataclass(frozen=True, slots=True, eq=False)
class Dissection:
    """An organ held by two clamps, solved as a beam. Nothing in it changes while it is pulled."""

    organ: Organ
    preset: Preset
    beam: Beam  # round bar or tube of the preset, or a `VaryingBeam` of the organ's own sections
    clamps: tuple[float, float]  # arc lengths of both along the organ's axis, mm
    driving: DrivingPoints  # the driving points that the beam moves
    # (3, 3) orthonormal columns: from clamp to clamp, lateral, along the pull
    frame: NDArray[np.float64]
    # (3,) where that frame's origin is; the first clamp if None
    origin_mm: NDArray[np.float64] | None = None

    @classmethod
    def of(cls, organ: Organ, preset: Preset) -> "Dissection":
        """Return the dissection of an organ with a preset; raise if it does not fit."""
        # A round beam clamps the organ's middle over its span, or from `first_clamp_mm` on; a beam
        # of the organ's own sections clamps it at its ends, or at `clamps_mm`.
        clamps = _clamps(organ, preset)
        frame = pull_frame(organ, clamps)
        if isinstance(preset.beam, RoundBeam):
            beam = preset.round_beam()
        else:
            beam = _organ_beam(organ, preset, clamps, frame[:, 2])
        driving = DrivingPoints.of(
            organ, spacing=beam.span / DRIVING_POINTS_PER_SPAN, at=np.array(clamps)
        )
        return cls(organ, preset, beam, clamps, driving, frame)

    @property
    def own_sections(self) -> bool:
        """Whether the organ's own sections are solved instead of the preset's round bar."""
        return isinstance(self.preset.beam, OrganBeam)

    def section(self, theory: Theory) -> str:
        """Return which section a theory solves, in words."""
        kind, beam = self.preset.beam, self.beam
        drawn = "hollow" if self.organ.hollow else "full"
        if isinstance(kind, RoundBeam):
            shape = "full round bar" if kind.wall_mm is None else "round tube"
            wall = "" if kind.wall_mm is None else f" with a wall of {kind.wall_mm:g} mm"
            return (
                f"a {shape}, {beam.span:.4g} mm between the clamps, {kind.diameter_mm:.4g} mm "
                f"thick{wall}; not the organ's own {drawn} sections"
            )
        own = f"the organ's own {drawn} sections"
        if kind.wall_mm is not None:
            own = f"the organ's own outline with a wall of {kind.wall_mm:g} mm"
        which = "all along it" if theory.takes_all_sections else "the weakest one"
        return f"{own}, {which}, {beam.span:.4g} mm between the clamps"

    def space_beam(self, *, elements: int, nodes_at: Sequence[float] = ()) -> SpaceBeam:
        """Return the beam in space that stands for the duct, with nodes at some stations, mm."""
        # A beam of the organ's own sections lies along its axis, a round one is straight.
        beam, law = self.beam, self.preset.law_in_space
        if not self.own_sections:
            return SpaceBeam.of(beam, law=law, elements=elements, nodes_at=nodes_at)
        at = np.linspace(0.0, beam.span, SECTIONS_ALONG)
        axis = self.in_frame(self.organ.axis_at(self.clamps[0] + at))
        up = self.sections_at(at, self.frame[:, 2])
        across = self.sections_at(at, self.frame[:, 1])
        e, nu = beam.modulus, beam.poisson_ratio
        g = 0.5 * e / (1.0 + nu)
        moments = np.stack([up.second_moment, across.second_moment])
        fibres = np.stack([up.fibre_distance, across.fibre_distance])
        rows = None
        if isinstance(law, Linear):
            shear = np.array(
                [
                    [
                        area * Ring(float(area), float(moment)).shear_coefficient(nu)
                        for area, moment in zip(sections.area, sections.second_moment, strict=True)
                    ]
                    for sections in (across, up)
                ]
            )
        else:
            both = (moments[0], moments[1]), (fibres[0], fibres[1])
            rows, areas = law.fibres_in_space(e, nu, up.area, *both)
            shear = np.stack([areas, areas])
        stiffness = np.stack(
            [e * up.area, *(g * shear), g * moments.sum(axis=0), *(e * moments)], axis=1
        )
        chords = np.sqrt((np.diff(axis, axis=0) ** 2).sum(axis=1))
        along = np.concatenate([[0.0], np.cumsum(chords)])
        return SpaceBeam.from_axis(
            elements=elements,
            stiffness=stiffness,
            axis=axis,
            stations=along * (1.0 + 1e-3),
            radius=fibres.mean(axis=0),
            wall=np.stack([up.area, *(moments / fibres)], axis=1),
            fibres=rows,
            nodes_at=nodes_at,
        )

    @property
    def beam_stations(self) -> NDArray[np.float64]:
        """(D,) station of each driving point on the beam, mm; behind a clamp, the clamp's."""
        return np.clip(self.driving.stations - self.clamps[0], 0.0, self.beam.span)

    @property
    def key_stations(self) -> NDArray[np.float64]:
        """(N,) stations on the beam of the organ's key sections between the clamps, mm."""
        stations = self.organ.key_stations - self.clamps[0]
        return stations[(stations > 0.0) & (stations < self.beam.span)]

    def sections_at(
        self, stations: NDArray[np.float64], direction: NDArray[np.float64]
    ) -> SectionProperties:
        """Return the organ's sections, with the preset's wall if it has one."""
        kind = self.preset.beam
        wall = kind.wall_mm if isinstance(kind, OrganBeam) else None
        return _sections(self.organ, self.clamps[0] + stations, direction, wall)

    def axis_point(self, station: float) -> NDArray[np.float64]:
        """Return the axis's point at rest, (3,) mm, at a distance from the first clamp, mm."""
        return self.organ.axis_at(np.array([self.clamps[0] + station]))[0]

    @property
    def origin(self) -> NDArray[np.float64]:
        """(3,) where the frame's origin is, mm."""
        return self.axis_point(0.0) if self.origin_mm is None else self.origin_mm

    def in_frame(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (..., 3) places of the organ in the frame: along, beside and over its origin."""
        # Not BLAS's product, whose last digits differ between processors: runs begin from these.
        away = places - self.origin
        return (away[..., np.newaxis] * self.frame).sum(axis=-2)

    def rest_transforms(self) -> NDArray[np.float64]:
        """Return (D, 3, 4) zeros: the driving points' transforms at rest."""
        return np.zeros((self.driving.stations.size, 3, 4))

    def move(
        self, pulled: Equilibrium, out: NDArray[np.float64], *, fraction: float = 1.0
    ) -> NDArray[np.float64]:
        """Write to `out` the transforms for a part of a displacement: 1 as pulled, 0 at rest."""
        return self.driving.transforms(
            fraction * (pulled.along - pulled.stations),
            fraction * pulled.across,
            fraction * pulled.rotation,
            self.frame,
            out,
        )

    def torn_at(
        self, check: RuptureCheck, *, edge_length: float, seed: int = 1
    ) -> tuple[TornPiece, TornPiece]:
        """Return the pieces in the first and in the second clamp; `seed` for the ragged rim."""
        return torn_pieces(
            self.organ,
            min(self.clamps[0] + check.station, self.clamps[1]),
            (check.tension_side or 1) * self.frame[:, 2],
            edge_length=edge_length,
            down=-self.frame[:, 2],
            seed=seed,
        )


PIECES = ("first_piece", "second_piece")
"""Names of the two pieces of a torn organ: in the first clamp, in the second."""


def organ_beam(organ: Organ, preset: Preset) -> VaryingBeam:
    """Return the beam of an organ's own sections alone, as in `Dissection.of`."""
    clamps = _clamps(organ, preset)
    return _organ_beam(organ, preset, clamps, pull_frame(organ, clamps)[:, 2])


def fits(organ: Organ, preset: Preset) -> bool:
    """Return whether an organ is long enough for a preset's beam, and not far too thick for it."""
    try:
        _clamps(organ, preset)
    except ValueError:
        return False
    return True


def _clamps(organ: Organ, preset: Preset) -> tuple[float, float]:
    """Return the arc lengths of the clamps; a `ValueError` if the organ does not suit the beam."""
    beam = preset.beam
    if isinstance(beam, RoundBeam) and 2.0 * organ.largest_radius > MOST_TIMES * beam.diameter_mm:
        raise ValueError(
            f"preset {preset.name} is a bar {beam.diameter_mm:g} mm thick and this organ is up to "
            f"{2.0 * organ.largest_radius:.0f} mm thick: its surface cannot follow the bends of a "
            f"bar so thin; take a preset with the organ's own sections"
        )
    if isinstance(beam, OrganBeam):
        if beam.clamps_mm is None:
            return 0.0, organ.length
        first, last = beam.clamps_mm
    elif beam.first_clamp_mm is None:
        if not holds(organ, beam.span_mm):
            raise ValueError(
                f"preset {preset.name} clamps {beam.span_mm:g} mm of duct and this organ is "
                f"{organ.length:.1f} mm long; take a preset with the organ's own sections"
            )
        first = max(0.0, 0.5 * (organ.length - beam.span_mm))
        last = first + beam.span_mm
    else:
        first, last = beam.first_clamp_mm, beam.first_clamp_mm + beam.span_mm
    if not holds(organ, last):
        raise ValueError(
            f"preset {preset.name} has its second clamp at {last:g} mm and this organ is "
            f"{organ.length:.1f} mm long"
        )
    return first, min(organ.length, last)


def holds(organ: Organ, length: float) -> bool:
    """Return whether an organ has a length, mm, to a part in 10,000: images say no more."""
    return organ.length >= length * (1.0 - 1e-4)


def default_preset(organ: Organ) -> Preset:
    """Return the thesis's preset for the shipped duct, or the assumed one."""
    shipped = bool(organ.encoded) and organ.encoded == _shipped()
    return preset_named(THESIS_PRESET if shipped else ASSUMED_PRESET)


@cache
def _shipped() -> bytes:
    return BILE_DUCT.read_bytes()


def _organ_beam(
    organ: Organ, preset: Preset, clamps: tuple[float, float], pull: NDArray[np.float64]
) -> VaryingBeam:
    """Return the beam of an organ's own sections between two clamps."""
    assert isinstance(preset.beam, OrganBeam)  # noqa: S101 (the caller has looked)
    span, wall = clamps[1] - clamps[0], preset.beam.wall_mm
    keys = organ.key_stations
    keys = np.union1d(keys[(keys > clamps[0]) & (keys < clamps[1])], clamps)
    few = _sections(organ, keys, pull, wall)
    # For theories of one section: the key section, or the one at a clamp, with the smallest section
    # modulus, which is the one that bending stresses most.
    weakest = int(np.argmin(few.second_moment / few.fibre_distance))
    stations = np.union1d(np.linspace(0.0, span, SECTIONS_ALONG), keys[1:-1] - clamps[0])
    along = _sections(organ, clamps[0] + stations, pull, wall)
    return VaryingBeam(
        stations=stations,
        areas=along.area,
        second_moments=along.second_moment,
        fibre_distances=along.fibre_distance,
        weakest=Beam(
            span=span,
            area=float(few.area[weakest]),
            second_moment=float(few.second_moment[weakest]),
            fibre_distance=float(few.fibre_distance[weakest]),
            modulus=preset.modulus_MPa,
            poisson_ratio=preset.poisson_ratio,
        ),
        modulus=preset.modulus_MPa,
        poisson_ratio=preset.poisson_ratio,
    )


def _sections(
    organ: Organ, stations: NDArray[np.float64], pull: NDArray[np.float64], wall: float | None
) -> SectionProperties:
    """Return sections as the images show them, or of a wall inside the outer edge."""
    # The bore is the outline, scaled about its centroid so that a circle's wall is just as thick.
    if wall is None:
        return organ.section_properties(stations, direction=pull)
    whole = _outlines(organ, tuple(stations.tolist()), tuple(pull.tolist()))
    radius = np.sqrt(whole.area / math.pi)
    if not wall < radius.min():
        raise ValueError(
            f"a wall of {wall:g} mm is thicker than the organ, whose radius is {radius.min():.3g} "
            f"mm at its thinnest place"
        )
    bore_squared = (1.0 - wall / radius) ** 2
    return SectionProperties(
        area=whole.area * (1.0 - bore_squared),
        second_moment=whole.second_moment * (1.0 - bore_squared**2),
        fibre_distance=whole.fibre_distance,
    )


@lru_cache(maxsize=4)
def _outlines(
    organ: Organ, stations: tuple[float, ...], pull: tuple[float, ...]
) -> SectionProperties:
    """Return the sections inside the outer edge, which are the same for every wall."""
    return replace(organ, lumen=None).section_properties(
        np.array(stations), direction=np.array(pull)
    )


def pull_frame(organ: Organ, clamps: tuple[float, float]) -> NDArray[np.float64]:
    """Return (3, 3) columns: from clamp to clamp, lateral, along the pull."""
    middle = 0.5 * (clamps[0] + clamps[1])
    first, last = organ.axis_at(np.array(clamps))
    along: NDArray[np.float64] = (last - first) / np.sqrt(((last - first) ** 2).sum())
    # The pull: up in the images at the middle, less its component along the organ.
    up: NDArray[np.float64] = organ.up_at(np.array([middle]))[0]
    up = up - (up * along).sum() * along
    up = up / np.sqrt((up**2).sum())
    return np.stack([along, np.cross(up, along), up], axis=1)
