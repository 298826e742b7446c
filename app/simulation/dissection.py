"""A dissection: an organ between two clamps, and the beam that stands for it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.simulation.preset import DEFAULT_PRESET, OrganBeam, Preset, RoundBeam, preset_named
from organ_geometry.driving_points import DrivingPoints, driving_points
from organ_geometry.mesh.tear import TornPiece, torn_pieces
from organ_geometry.organ import Organ
from physics import Beam, Equilibrium, Exact, ExactAlong, RuptureCheck, Theory, VaryingBeam

__all__ = ["PIECES", "Dissection", "default_preset", "fits", "organ_beam"]

SECTIONS_ALONG = 64
"""Sections that stand for an organ along a varying beam."""
DRIVING_POINTS_PER_SPAN = 60
"""A bend of one span, followed to a hundredth of the duct's radius."""


@dataclass(frozen=True, slots=True, eq=False)
class Dissection:
    """An organ held by two clamps, solved as a beam. Nothing in it changes while it is pulled.

    Attributes
    ----------
    organ
        The organ.
    preset
        Material, break and kind of beam.
    beam
        The beam between the clamps.
    clamps
        Arc lengths of the two clamps along the organ's axis, mm.
    driving
        The driving points that the beam moves.
    frame
        (3, 3) orthonormal columns: from the first clamp to the second, lateral, along the pull.
    """

    organ: Organ
    preset: Preset
    beam: Beam
    clamps: tuple[float, float]
    driving: DrivingPoints
    frame: NDArray[np.float64]

    @classmethod
    def of(cls, organ: Organ, preset: Preset) -> "Dissection":
        """Return the dissection of an organ with a preset.

        A preset with a span of its own clamps the middle of the organ over that span; one that
        takes the organ's sections clamps it at its ends.

        Parameters
        ----------
        organ
            The organ.
        preset
            The preset.

        Returns
        -------
        Dissection
            The dissection.

        Raises
        ------
        ValueError
            If the organ is shorter than the preset's span.
        """
        if isinstance(preset.beam, RoundBeam):
            beam = preset.round_beam()
            if not fits(organ, preset):
                raise ValueError(
                    f"preset {preset.name} clamps {beam.span:g} mm of duct and this organ is "
                    f"{organ.length:.1f} mm long; take a preset with the organ's own sections"
                )
        else:
            beam = organ_beam(organ, preset)
        first = max(0.0, 0.5 * (organ.length - beam.span))
        clamps = (first, min(organ.length, first + beam.span))
        driving = driving_points(
            organ, spacing=beam.span / DRIVING_POINTS_PER_SPAN, at=np.array(clamps)
        )
        return cls(organ, preset, beam, clamps, driving, pull_frame(organ, clamps))

    @property
    def beam_stations(self) -> NDArray[np.float64]:
        """(D,) where each driving point is on the beam, mm; those behind a clamp are at it."""
        return np.clip(self.driving.stations - self.clamps[0], 0.0, self.beam.span)

    @property
    def key_stations(self) -> NDArray[np.float64]:
        """(N,) where the organ's key sections between the clamps are on the beam, mm."""
        stations = self.organ.key_stations - self.clamps[0]
        return stations[(stations > 0.0) & (stations < self.beam.span)]

    def theory_for(self, theory: Theory) -> Theory:
        """Return a theory as it solves this organ.

        Parameters
        ----------
        theory
            The theory that was chosen.

        Returns
        -------
        Theory
            The exact beam along the organ's own sections where the preset takes those; every
            other theory as it is, with `beam`.
        """
        if not (isinstance(theory, Exact) and isinstance(self.preset.beam, OrganBeam)):
            return theory
        even = np.linspace(0.0, self.beam.span, SECTIONS_ALONG)
        stations = np.union1d(even, self.key_stations)
        sections = self.organ.section_properties(
            self.clamps[0] + stations, direction=self.frame[:, 2]
        )
        return ExactAlong(
            theory,
            VaryingBeam(
                stations=stations,
                areas=sections.area,
                second_moments=sections.second_moment,
                fibre_distances=sections.fibre_distance,
                modulus=self.beam.modulus,
                poisson_ratio=self.beam.poisson_ratio,
            ),
        )

    def axis_point(self, station: float) -> NDArray[np.float64]:
        """Return a point of the axis at rest.

        Parameters
        ----------
        station
            Distance from the first clamp, mm.

        Returns
        -------
        NDArray[np.float64]
            (3,) the point, mm.
        """
        return self.organ.axis_at(np.array([self.clamps[0] + station]))[0]

    def rest_transforms(self) -> NDArray[np.float64]:
        """Return the transforms of the driving points at rest.

        Returns
        -------
        NDArray[np.float64]
            (D, 3, 4) zeros (`DrivingPoints.transforms`).
        """
        return np.zeros((self.driving.stations.size, 3, 4))

    def move(
        self, pulled: Equilibrium, out: NDArray[np.float64], *, part: float = 1.0
    ) -> NDArray[np.float64]:
        """Write the transforms of the driving points that follow a pulled beam.

        Parameters
        ----------
        pulled
            The beam, sampled at `beam_stations`.
        out
            (D, 3, 4) receives the transforms.
        part
            Part of the displacement and rotation to show: 1 the pulled beam, 0 rest.

        Returns
        -------
        NDArray[np.float64]
            `out`.
        """
        return self.driving.transforms(
            part * (pulled.along - pulled.stations),
            part * pulled.across,
            part * pulled.rotation,
            self.frame,
            out,
        )

    def torn_at(
        self, check: RuptureCheck, *, edge_length: float, seed: int = 1
    ) -> tuple[TornPiece, TornPiece]:
        """Return the two pieces that the organ tears into.

        Parameters
        ----------
        check
            Where it tears, and on which side first.
        edge_length
            Wanted length of the triangles' edges, mm.
        seed
            Chooses the rim's raggedness.

        Returns
        -------
        tuple[TornPiece, TornPiece]
            The piece in the first clamp and the one in the second.
        """
        return torn_pieces(
            self.organ,
            min(self.clamps[0] + check.station, self.clamps[1]),
            (check.tension_side or 1) * self.frame[:, 2],
            edge_length=edge_length,
            seed=seed,
        )


PIECES = ("first_piece", "second_piece")
"""Names of the two pieces of a torn organ: the one in the first clamp and the other."""


def fits(organ: Organ, preset: Preset) -> bool:
    """Return whether an organ is long enough for a preset.

    Parameters
    ----------
    organ
        The organ.
    preset
        The preset.

    Returns
    -------
    bool
        Whether it is.
    """
    return not isinstance(preset.beam, RoundBeam) or holds(organ, preset.beam.span_mm)


def holds(organ: Organ, span: float) -> bool:
    """Return whether an organ is long enough to be clamped over a span.

    Parameters
    ----------
    organ
        The organ.
    span
        Length between the clamps, mm.

    Returns
    -------
    bool
        Whether it is, to a part in 10,000: images say no more.
    """
    return organ.length >= span * (1.0 - 1e-4)


def default_preset(organ: Organ) -> Preset:
    """Return the preset that an organ gets when nobody chooses one.

    Parameters
    ----------
    organ
        The organ.

    Returns
    -------
    Preset
        The thesis's duct where the organ is long enough for it, else the porcine one, which
        takes the organ's own sections.
    """
    thesis = preset_named(DEFAULT_PRESET)
    return thesis if fits(organ, thesis) else preset_named("porcine-bile-duct")


def organ_beam(organ: Organ, preset: Preset) -> Beam:
    """Return the beam of constant section that stands for an organ: that of its weakest section.

    Parameters
    ----------
    organ
        The organ.
    preset
        The material.

    Returns
    -------
    Beam
        Span of the whole organ; area, second moment and fibre distance of the key section with
        the smallest second moment over fibre distance, which bending stresses most.
    """
    frame = pull_frame(organ, (0.0, organ.length))
    sections = organ.section_properties(organ.key_stations, direction=frame[:, 2])
    weakest = int(np.argmin(sections.second_moment / sections.fibre_distance))
    return Beam(
        span=organ.length,
        area=float(sections.area[weakest]),
        second_moment=float(sections.second_moment[weakest]),
        fibre_distance=float(sections.fibre_distance[weakest]),
        modulus=preset.modulus_MPa,
        poisson_ratio=preset.poisson_ratio,
    )


def pull_frame(organ: Organ, clamps: tuple[float, float]) -> NDArray[np.float64]:
    """Return the frame that a clamped organ is pulled in.

    Parameters
    ----------
    organ
        The organ.
    clamps
        Arc lengths of the clamps, mm.

    Returns
    -------
    NDArray[np.float64]
        (3, 3) columns: from clamp to clamp, lateral, and along the pull, which is the images'
        up at the middle as far as it is across the organ.
    """
    middle = 0.5 * (clamps[0] + clamps[1])
    first, last = organ.axis_at(np.array(clamps))
    along: NDArray[np.float64] = (last - first) / np.linalg.norm(last - first)
    up: NDArray[np.float64] = organ.up_at(np.array([middle]))[0]
    up = up - np.dot(up, along) * along
    up = up / np.linalg.norm(up)
    return np.stack([along, np.cross(up, along), up], axis=1)
