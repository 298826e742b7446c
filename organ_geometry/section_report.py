"""Report of each section: what was found, and its distance to the organ."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from organ_geometry.curves.fitted_organ import FittedOrgan
from organ_geometry.curves.half_curves import closed_outlines
from organ_geometry.curves.outline_distance import polygon_distances
from organ_geometry.encoder.encode import EncodedOrgan
from organ_geometry.surface_distance import root_mean_squares, section_distances

_BACK_CORNERS = 64


@dataclass(frozen=True, slots=True)
class SectionReport:
    """Report of one section: what was found, and its distance to the organ.

    Errors are distances of the edge points to a boundary: "fit" to the section's own half-curves,
    the others to the organ that its file gives, that is after sections were left out and
    interpolated. The largest error is the larger of both ways, edge points to the organ and the
    organ to the edges, so that no part of the organ is far from what the images show. A lumen
    counts where the organ has one. Pixels are the geometric mean of the pixel's two sides. Where
    nothing was found, errors are NaN.

    Attributes
    ----------
    index
        Number of the section in the stack, from 0.
    edge_points
        Number of edge points found, the lumen's included.
    problem
        Why nothing that can be used was found, or None.
    kept
        Whether it is a key section.
    fit_normal_rms_px, fit_normal_rms_mm
        RMS distance to its own half-curves along their normals.
    fit_algebraic_rms_px, fit_algebraic_rms_mm
        RMS distance to them in y, as the thesis's least squares measure it (see `fit_error`).
    rms_px, rms_mm, max_mm
        RMS and largest distance to the organ.
    """

    index: int
    name: str
    edge_points: int
    lumen: bool
    problem: str | None
    kept: bool = False
    fit_normal_rms_px: float = math.nan
    fit_normal_rms_mm: float = math.nan
    fit_algebraic_rms_px: float = math.nan
    fit_algebraic_rms_mm: float = math.nan
    rms_px: float = math.nan
    rms_mm: float = math.nan
    max_mm: float = math.nan


def section_reports(fitted: FittedOrgan, encoded: EncodedOrgan) -> tuple[SectionReport, ...]:
    """Return one report for each image, measured on the organ as its file gives it."""
    stack, pixel = fitted.stack, fitted.stack.mean_pixel
    away = section_distances(encoded.organ, fitted.contours, encoded.places)
    rms = root_mean_squares(away)
    back = _back_distances(encoded)
    kept = _kept(encoded)
    reports = {
        index: SectionReport(
            index=index, name=stack.names[index], edge_points=0, lumen=False, problem=problem
        )
        for index, problem in fitted.problems.items()
    }
    for place, section in enumerate(fitted.sections):
        walls = [(section.curves, section.outer)]
        if encoded.organ.hollow and section.lumen is not None and section.lumen_curves is not None:
            walls.append((section.lumen_curves, section.lumen))
        normal = _rms([curves.distances(points) for curves, points in walls])
        algebraic = _rms([curves.algebraic_distances(points) for curves, points in walls])
        reports[section.index] = SectionReport(
            index=section.index,
            name=stack.names[section.index],
            edge_points=len(section.outer) + (0 if section.lumen is None else len(section.lumen)),
            lumen=section.lumen is not None,
            problem=None,
            kept=place in kept,
            fit_normal_rms_px=normal / pixel,
            fit_normal_rms_mm=normal,
            fit_algebraic_rms_px=algebraic / pixel,
            fit_algebraic_rms_mm=algebraic,
            rms_px=float(rms[place]) / pixel,
            rms_mm=float(rms[place]),
            max_mm=max(float(away[place].max()), float(back[place])),
        )
    return tuple(reports[index] for index in range(len(stack)))


def _kept(encoded: EncodedOrgan) -> set[int]:
    """Return which sections stand for the key sections: the nearest, each for one of them."""
    organ = encoded.organ
    kept: set[int] = set()
    for key in organ.key_stations / organ.length:
        nearest = np.argsort(np.abs(encoded.places - key), kind="stable")
        kept.add(next((int(place) for place in nearest if int(place) not in kept), 0))
    return kept


def _back_distances(encoded: EncodedOrgan) -> NDArray[np.float64]:
    """Return the (S,) largest distances, mm, of the organ's outlines to the edges' surface."""
    organ = encoded.organ
    count = len(encoded.outlines.outer)
    stations = np.linspace(0.0, organ.length, count)
    largest = np.zeros(count)
    nearest = np.round(encoded.places * (count - 1)).astype(np.intp)
    walls = [(organ.rows_at(stations), encoded.outlines.outer)]
    if encoded.outlines.lumen is not None:
        walls.append((organ.rows_at(stations, "lumen"), encoded.outlines.lumen))
    for rows, edges in walls:
        corners = closed_outlines(rows, _BACK_CORNERS)
        for place in np.unique(nearest).tolist():
            away = polygon_distances(corners[place], edges[place])
            largest[place] = max(largest[place], float(away.max()))
    return largest[nearest]


def _rms(distances: list[NDArray[np.float64]]) -> float:
    every = np.concatenate(distances)
    return float(np.sqrt(np.mean(every * every)))


def pooled_rms(sections: tuple[SectionReport, ...], values: list[float]) -> float:
    """Return the root mean square over all edge points of values that are one a section."""
    squares, points = 0.0, 0
    for section, value in zip(sections, values, strict=True):
        if section.problem is None:
            squares += section.edge_points * value**2
            points += section.edge_points
    return math.sqrt(squares / points)
