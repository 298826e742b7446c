"""The promise on real sections: no slice is further from the decoded organ than the tolerance."""

import dataclasses
import os
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from contours import RADIUS, cylinder
from hypothesis import given, settings
from hypothesis import strategies as st

from organ_geometry.contours.contour import SectionContour
from organ_geometry.contours.organ_tracing import trace_organ
from organ_geometry.curves.fitted_organ import fit_organ
from organ_geometry.curves.half_curves import closed_outlines
from organ_geometry.encoder.candidate import thinnest_wall
from organ_geometry.encoder.encode import ToleranceTooSmall, encoded_organ
from organ_geometry.images.stack_reader import read_image_stack
from organ_geometry.organ_file import code_from_bytes, organ_from_bytes
from organ_geometry.surface_distance import root_mean_squares, section_distances

DATA = Path(os.environ.get("BLUNTDISSECT_DATA") or Path(__file__).parents[3] / "shared" / "data")
SETS = ("bile_duct_perpendicular", "bile_duct_parallel", "ureter_left", "aorta_ct")


@cache
def contours_of(name: str) -> tuple[tuple[SectionContour, ...], float, bool]:
    """Contours of a real set, its organ's mean radius, and whether its frames are left-handed."""
    stack = read_image_stack(DATA / name / "masks")
    fitted = fit_organ(stack, trace_organ(stack))
    left_handed = float(np.linalg.det(stack.frames[0])) < 0.0
    return fitted.contours, fitted.mean_radius, left_handed


@pytest.mark.long  # a real organ
@pytest.mark.parametrize("name", SETS)
def test_every_slice_keeps_to_every_tolerance(name: str) -> None:
    if not (DATA / name / "masks").is_dir():
        pytest.skip(f"{name} is not in {DATA}")
    contours, radius, left_handed = contours_of(name)

    @settings(max_examples=2, deadline=None, derandomize=True)
    @given(fraction=st.floats(0.015, 0.2))
    def keeps(fraction: float) -> None:
        tolerance = fraction * radius
        try:
            encoded = encoded_organ(contours, tolerance, left_handed=left_handed)
        except ToleranceTooSmall as refused:
            tolerance = refused.smallest_mm
            # What is named is kept.
            encoded = encoded_organ(contours, tolerance, left_handed=left_handed)
        organ = organ_from_bytes(encoded.organ.encoded)
        rms = root_mean_squares(section_distances(organ, contours, encoded.places))
        assert rms.max() <= organ.tolerance_mm <= tolerance

    keeps()


def test_all_sections_together_keep_to_what_they_may() -> None:
    contours = cylinder(noise=0.004 * RADIUS)
    encoded = encoded_organ(contours, 0.05 * RADIUS, overall=0.01 * RADIUS)
    away = section_distances(encoded.organ, contours, encoded.places)
    pooled = np.concatenate(away)
    assert np.sqrt(np.mean(pooled**2)) <= 0.01 * RADIUS
    assert root_mean_squares(away).max() <= encoded.organ.tolerance_mm <= 0.05 * RADIUS


def test_more_effort_takes_no_more_bytes() -> None:
    contours = cylinder(noise=0.01 * RADIUS)
    quick, full = (
        len(encoded_organ(contours, 0.02 * RADIUS, effort=effort).organ.encoded)
        for effort in ("quick", "full")
    )
    assert full <= quick


def test_a_thin_wall_stays_a_wall() -> None:
    # The wall is thinner than the tolerance, which alone would let its sides cross.
    organ = encoded_organ(cylinder(lumen=0.97), 0.06 * RADIUS, hollow=True).organ
    outer = closed_outlines(organ.rows_at(organ.stations), 96)
    lumen = closed_outlines(organ.rows_at(organ.stations, "lumen"), 96)
    assert min(thinnest_wall(*walls) for walls in zip(outer, lumen, strict=True)) > 0.0


@pytest.mark.slow
def test_a_lumen_outside_is_refused_by_its_section() -> None:
    with pytest.raises(ValueError, match="the lumen of section 0 is not inside its outer boundary"):
        encoded_organ(cylinder(lumen=1.1, sections=9), 0.02 * RADIUS, hollow=True)


def test_the_images_up_does_not_turn_with_half_curves() -> None:
    code = code_from_bytes(encoded_organ(cylinder(), 0.05 * RADIUS).organ.encoded)
    plain, turned = (dataclasses.replace(code, turn=turn).organ() for turn in (0, 11))
    stations = np.linspace(0.0, plain.length, 9)
    assert np.degrees(turned.turn) == pytest.approx(11 * 180 / 32)
    np.testing.assert_allclose(turned.up_at(stations), plain.up_at(stations), atol=1e-12)
    np.testing.assert_allclose(plain.up_at(stations), -plain.frames_at(stations)[:, :, 1])
