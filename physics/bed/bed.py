"""A bed: a layer of strands under a stretch of the beam, evenly spaced or scattered from a seed."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from physics.bed.network import Network
from physics.bed.space_beam import SpaceBeam
from physics.bed.strands import Strands
from physics.quantity import finite, positive

Floats = NDArray[np.float64]

# mm: steps in which the nearest place of another tube is looked for; shortest strand between tubes.
ALONG, THINNEST = 0.25, 0.3
# Part of both radii within which axes cross, as where tubes join: there is nothing between them.
CROSSING = 0.8
SHORTEST, FORWARD = 0.4, 0.6


@dataclass(frozen=True, slots=True)
class Patch:
    """An adhesion: a stretch of a bed whose strands are `factor` times as stiff and as tough."""

    from_mm: float  # from the first end
    to_mm: float
    factor: float

    def __post_init__(self) -> None:
        finite(self.from_mm, "from_mm of a patch", "mm")
        finite(self.to_mm, "to_mm of a patch", "mm")
        positive(self.factor, "factor of a patch", "")
        if self.to_mm <= self.from_mm:
            raise ValueError(
                f"a patch must end after it begins, got {self.from_mm:g} to {self.to_mm:g} mm"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Bed:
    """A layer of strands, by its own stiffness and toughness for each mm of the beam.

    With nothing scattered the strands are evenly spaced in one row, straight down from the axis,
    as alike as they can be. The elongation at which they yield follows from stiffness, toughness
    and softening: G = k u_0 u_f / 2 with u_f = softening u_0.
    """

    # where it lies under the beam, from its first end; the whole length when None
    from_mm: float | None = None
    to_mm: float | None = None
    strands: int = 600
    # of the bed, for each mm of beam and of elongation, N/mm^2; or one for each of `stations`
    stiffness: float | tuple[float, ...]
    # energy to part it, for each mm of beam, N (mJ/mm); likewise
    toughness: float | tuple[float, ...]
    softening: float = 2.0  # u_f / u_0: elongation at parting over that at yield; 1 is brittle
    # where stiffness and toughness are given, mm; linear between them
    stations: tuple[float, ...] | None = None
    bilateral: bool = False  # whether strands also push when they are shorter than at rest
    # stiffness with which the bed pushes back a beam deeper than at rest, N/mm^2
    floor: float = 0.0
    gap: float = 3.0  # length of a strand straight down, mm
    # rad from straight down, either side, to which strands hold; None: the axis
    around: float | None = None
    fan: float = 0.0  # standard deviation of their directions off straight down, rad
    slack: float = 0.0  # largest slack at rest, mm; spread evenly from 0
    # coefficient of variation of the energy to part one, stiffness in proportion
    scatter: float = 0.0
    stiffness_scatter: float = 0.0  # coefficient of variation of the stiffness alone
    # offset along from the even places, in spacings: 0 none, 1 anywhere in their own
    jitter: float = 0.0
    patches: tuple[Patch, ...] = ()
    seed: int = 1  # of all that is scattered

    def __post_init__(self) -> None:
        if not 1 <= self.strands <= 200_000:
            raise ValueError(f"strands of a bed must be 1 to 200,000, got {self.strands:,}")
        for name, unit in (("stiffness", "N/mm^2"), ("toughness", "N")):
            value: float | tuple[float, ...] = getattr(self, name)
            values = value if isinstance(value, tuple) else (value,)
            if isinstance(value, tuple) and (
                self.stations is None or len(self.stations) != len(values)
            ):
                raise ValueError(f"{name} of a bed must be one number, or one for each station")
            for each in values:
                positive(each, f"{name} of a bed", unit)
        if self.stations is not None and not (
            len(self.stations) >= 2
            and all(math.isfinite(s) for s in self.stations)
            and all(b > a for a, b in zip(self.stations, self.stations[1:], strict=False))
        ):
            raise ValueError(f"stations of a bed must rise, got {list(self.stations)}")
        if not (math.isfinite(self.softening) and self.softening >= 1.0):
            raise ValueError(f"softening of a bed must be 1 or more, got {self.softening}")
        positive(self.gap, "gap of a bed", "mm")
        for name, unit, most in (
            ("floor", "N/mm^2", math.inf),
            ("slack", "mm", math.inf),
            ("scatter", "", 1.0),
            ("stiffness_scatter", "", 1.0),
            ("fan", "rad", 1.0),
            ("jitter", "", 1.0),
        ):
            value = finite(getattr(self, name), f"{name} of a bed", unit)
            if not 0.0 <= value <= most:
                limit = "0 or more" if most == math.inf else f"from 0 to {most:g}"
                allowed = f"{limit} {unit}".strip()
                raise ValueError(f"{name} of a bed must be {allowed}, got {value:g}")
        if self.around is not None and not 0.0 <= self.around <= math.pi:
            raise ValueError(f"around of a bed must be from 0 to pi rad, got {self.around}")
        if self.bilateral and self.slack > 0.0:
            raise ValueError(f"a bilateral bed cannot be slack, got slack {self.slack:g} mm")
        if self.seed < 0:
            raise ValueError(f"seed of a bed must be 0 or more, got {self.seed}")

    def with_patch(self, *patches: Patch) -> "Bed":
        """Return the same bed with more adhesions."""
        return replace(self, patches=(*self.patches, *patches))

    def strands_under(
        self, beam: SpaceBeam, up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    ) -> Strands:
        """Return the bed's strands under a beam at rest, `up` the unit direction away from it."""
        drawn = np.random.default_rng(self.seed).random((15, self.strands))
        stations, radius = self._stations(beam, drawn)
        zero = np.zeros(self.strands)
        angles = zero if self.around is None else self.around * (2.0 * drawn[1] - 1.0)
        out = zero if self.around is None else radius
        lean = (
            self.gap * math.tan(self.fan) * np.stack([_bell(drawn[2:5]), _bell(drawn[5:8])], axis=1)
        )
        stiffness, yield_elongation = self._law(beam, stations, drawn)
        return Strands.between(
            beam,
            stations,
            around=angles,
            out=out,
            gap=self.gap,
            lean=lean,
            slack=self.slack * drawn[8],
            stiffness=stiffness,
            yield_elongation=yield_elongation,
            failure_elongation=self.softening * yield_elongation,
            bilateral=self.bilateral,
            up=up,
        )

    def strands_between(
        self,
        network: Network,
        tube: str,
        to: str,
        *,
        reach: float = math.inf,
        side: Literal["facing", "front", "back"] = "facing",
    ) -> Strands:
        """Return the layer's strands from one tube of a network to another.

        Each goes from its place to the nearest place of the other tube, leaning by the layer's fan,
        from wall to wall within the angle `around` of the straight line between both axes. One
        shorter than the layer's gap stretches less far, at the same energy, down to `SHORTEST` of
        it: else a thin sheet would not part.

        Parameters
        ----------
        network
            The tubes at rest.
        tube, to
            Names of both.
        reach
            Longest gap between both walls that is spanned, mm; there are no strands where it is
            wider, or where tubes meet.
        side
            Whether strands hold the sides that face each other, or lie more in front (towards z)
            or behind.

        Returns
        -------
        Strands
            As many as there is room for.
        """
        names = list(network.tubes)
        one, other = network.tubes[tube], network.tubes[to]
        drawn = np.random.default_rng(self.seed).random((15, self.strands))
        stations, radius = self._stations(one, drawn)
        place, along = one.places_at(stations)
        line: Floats = np.linspace(0.0, other.span, 1 + math.ceil(other.span / ALONG))
        far: Floats = ((other.places_at(line)[0] - place[:, None]) ** 2).sum(axis=2)
        lean: Floats = math.tan(self.fan) * self.gap * _bell(drawn[2:5])
        feet_at: Floats = np.clip(line[far.argmin(axis=1)] + lean, 0.0, other.span)
        foot, foot_along = other.places_at(feet_at)
        thick: Floats = np.interp(feet_at, other.stations, other.radius)
        spread = np.zeros(self.strands)
        if self.around is not None:
            spread = self.around * (2.0 * drawn[1] - 1.0)
        direction: Floats = foot - place
        away = np.sqrt((direction**2).sum(axis=1))
        front = {"facing": 0.0, "front": 1.0, "back": -1.0}[side]
        ends = place + radius[:, None] * _around(direction, along, spread, front)
        feet = foot + thick[:, None] * _around(-direction, foot_along, -spread, front)
        length = np.sqrt(((feet - ends) ** 2).sum(axis=1))
        both = radius + thick
        there: NDArray[np.bool_] = (
            (away - both <= reach) & (length >= THINNEST) & (away >= CROSSING * both)
        )
        stiffness, yields = self._law(one, stations, drawn)
        shorter: Floats = np.clip(length / self.gap, SHORTEST, 1.0)
        yields, stiffness = yields * shorter, stiffness / shorter**2
        return Strands(
            stations[there],
            ends[there],
            feet[there],
            stiffness[there],
            (length + self.slack * drawn[8])[there],
            yields[there],
            (self.softening * yields)[there],
            np.full(int(there.sum()), float(self.bilateral)),
            np.full(int(there.sum()), names.index(tube)),
            np.full(int(there.sum()), names.index(to)),
            feet_at[there],
        )

    def _stations(self, beam: SpaceBeam, drawn: Floats) -> tuple[Floats, Floats]:
        """Return the (S,) places of the strands on a beam, and its radius there, mm."""
        a, b = self._reach(beam.span)
        place = 0.5 + self.jitter * (drawn[0] - 0.5)
        spacing = (b - a) / self.strands
        stations: Floats = a + (np.arange(self.strands, dtype=np.float64) + place) * spacing
        return stations, np.interp(stations, beam.stations, beam.radius)

    def _law(self, beam: SpaceBeam, stations: Floats, drawn: Floats) -> tuple[Floats, Floats]:
        """Return the (S,) stiffnesses and yield elongations of strands at stations of a beam."""
        a, b = self._reach(beam.span)
        spacing = (b - a) / self.strands
        energy = self._at(self.toughness, stations) * spacing
        stiffness = self._at(self.stiffness, stations) * spacing
        for patch in self.patches:
            inside = (stations >= patch.from_mm) & (stations <= patch.to_mm)
            energy[inside] *= patch.factor
            stiffness[inside] *= patch.factor
        tough = _scattered(drawn[9:12], self.scatter)
        energy *= tough
        stiffness *= tough * _scattered(drawn[12:15], self.stiffness_scatter)
        return stiffness, np.sqrt(2.0 * energy / (stiffness * self.softening))

    def floor_under(self, beam: SpaceBeam) -> Floats:
        """Return the (N,) stiffnesses of the bed's floor at a beam's nodes, N/mm."""
        a, b = self._reach(beam.span)
        s = beam.stations
        edges = np.concatenate([[s[0]], 0.5 * (s[1:] + s[:-1]), [s[-1]]])
        reach = np.clip(edges, a, b)
        return self.floor * np.diff(reach)

    def _reach(self, span: float) -> tuple[float, float]:
        a = 0.0 if self.from_mm is None else finite(self.from_mm, "from_mm of a bed", "mm")
        b = span if self.to_mm is None else finite(self.to_mm, "to_mm of a bed", "mm")
        if not (a >= 0.0 and b <= span * (1.0 + 1e-9)):
            raise ValueError(
                f"a bed from {a:g} to {b:g} mm lies outside the beam, which runs from 0 to "
                f"{span:g} mm"
            )
        if b <= a:
            raise ValueError(f"a bed must end after it begins, got {a:g} to {b:g} mm")
        for patch in self.patches:
            if patch.from_mm >= b or patch.to_mm <= a:
                raise ValueError(
                    f"a patch from {patch.from_mm:g} to {patch.to_mm:g} mm lies outside its bed, "
                    f"which runs from {a:g} to {b:g} mm"
                )
        return a, b

    def _at(self, value: float | tuple[float, ...], at: Floats) -> Floats:
        if self.stations is None or not isinstance(value, tuple):
            return np.full(at.size, value)
        return np.asarray(np.interp(at, self.stations, value), dtype=np.float64)


def _around(direction: Floats, along: Floats, angle: Floats, front: float) -> Floats:
    """Return (S, 3) unit directions across axes, at angles from ways that lead to another tube."""
    # A layer in front has its angles turned by `FORWARD` of what there is to straight forward.
    first = direction - (direction * along).sum(axis=1)[:, None] * along
    first /= np.maximum(np.sqrt((first**2).sum(axis=1)), 1e-9)[:, None]
    second = np.cross(along, first)
    if front:
        ahead = np.arctan2(front * second[:, 2], front * first[:, 2])
        angle = angle + FORWARD * ahead
    return np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second


def _bell(uniform: Floats) -> Floats:
    """Return nearly normal numbers, mean 0, standard deviation 1, from three uniform ones each."""
    return 2.0 * (uniform[0] + uniform[1] + uniform[2] - 1.5)


def _scattered(drawn: Floats, variation: float) -> Floats:
    """Return lognormal factors, cut off at 3 sd, of mean 1 and this coefficient of variation."""
    if variation == 0.0:
        return np.ones(int(drawn.shape[1]), dtype=np.float64)
    sd = math.sqrt(math.log1p(variation * variation))
    spread = [math.exp(sd * each) for each in _bell(drawn).tolist()]
    # Scaled to a sample mean of 1, so that the seed does not change the toughness of the bed.
    scale = len(spread) / math.fsum(spread)
    return np.array([scale * each for each in spread])
