"""Dissections: which beam stands for an organ, and where it is clamped and pulled."""

import math
from dataclasses import replace

import numpy as np
import pytest
from simulated import phantom
from tubes import LENGTH, RADIUS, tube

from app.simulation import (
    Dissection,
    OrganBeam,
    Preset,
    RoundBeam,
    default_preset,
    fits,
    preset_named,
    presets,
)
from organ_geometry.mesh.skin import organ_skin
from organ_geometry.organ import Organ
from physics import (
    Beam,
    Cubic,
    Exact,
    Fem,
    Linear,
    MassSpring,
    NeoHooke,
    TautString,
    Theory,
    VaryingBeam,
    break_of,
)


def shortened(organ: Organ, factor: float) -> Organ:
    return Organ(
        organ.axis * [factor, 1.0, 1.0], organ.frames, organ.keys, organ.outer, organ.lumen
    )


def test_presets_ship_with_source_and_confidence() -> None:
    assert next(iter(presets())) == "thesis-bile-duct"
    assert {"thesis-bile-duct", "thesis-rubber", "thesis-thin-rubber"} < set(presets())
    assert sum(not preset.name.startswith("thesis") for preset in presets().values()) >= 2
    for preset in presets().values():
        assert preset.source
        assert preset.confidence_note


def test_thesis_preset_solves_its_own_round_bar_whatever_the_organ_looks_like() -> None:
    for organ in (phantom(), tube(wall=1.0), shortened(tube(), 2.0)):
        beam = Dissection.of(organ, preset_named("thesis-bile-duct")).beam
        assert beam.span == 50.8
        assert beam.area == pytest.approx(math.pi * 8.89**2 / 4.0)
        assert beam.second_moment == pytest.approx(math.pi * 8.89**4 / 64.0)


def test_an_organ_that_is_far_too_thick_for_a_bar_is_not_drawn_along_it() -> None:
    heart = tube(radius=42.0)
    for name in ("thesis-bile-duct", "thesis-rubber", "thesis-thin-rubber"):
        assert not fits(heart, preset_named(name))
        with pytest.raises(ValueError, match="up to 85 mm thick: its surface cannot follow"):
            Dissection.of(heart, preset_named(name))
    # Its own sections bend so little that no edge of its mesh grows to twice its length.
    dissection = Dissection.of(heart, default_preset(heart))
    beam = dissection.beam
    event = break_of(Cubic().pull(beam, 25.4), dissection.preset.threshold(Cubic(), beam))
    assert event is not None
    skin = organ_skin(heart, edge_length=4.0)
    pulled = Cubic().pull(beam, 25.4).to_force(event.force).sample(dissection.beam_stations)
    moved = np.empty_like(skin.vertices)
    transforms = dissection.move(pulled, dissection.rest_transforms())
    skin.bound_to(dissection.driving).deform(transforms, moved)

    def lengths(vertices: np.ndarray) -> np.ndarray:
        return np.linalg.norm(vertices[skin.faces] - vertices[np.roll(skin.faces, 1, 1)], axis=2)

    assert (lengths(moved) / lengths(skin.vertices)).max() < 2.0


def test_organ_preset_takes_the_weakest_section_of_the_organ() -> None:
    """`tube` is 4.445 mm in radius at its ends and a tenth less in the middle, with a 1 mm wall."""
    outer, inner = 0.9 * RADIUS, 0.9 * RADIUS - 1.0
    beam = Dissection.of(tube(wall=1.0), preset_named("porcine-gallbladder")).beam
    # Two degree-6 curves leave 0.5 % of a circle's area aside, a wall's is a difference of two.
    assert beam.span == pytest.approx(LENGTH)
    assert beam.area == pytest.approx(math.pi * (outer**2 - inner**2), rel=0.02)
    assert beam.second_moment == pytest.approx(math.pi / 4 * (outer**4 - inner**4), rel=0.02)
    assert beam.fibre_distance == pytest.approx(outer, rel=0.01)
    assert beam.modulus == 9.03


def test_exact_beam_solves_the_organ_s_own_sections_along_it() -> None:
    organ = tube(wall=1.0)
    dissection = Dissection.of(organ, preset_named("porcine-gallbladder"))
    beam = dissection.beam
    assert isinstance(beam, VaryingBeam)
    assert beam.weakest is not None
    at = np.array([25.4])
    weakest = Exact().pull(beam.weakest, 25.4).to_force(5.0).sample(at).deflection
    varying = Exact().pull(beam, 25.4).to_force(5.0).sample(at)
    # The waist is the weakest section, the rest is up to a tenth wider: stiffer, by less than the
    # widest section alone would be.
    assert 0.6 * weakest < varying.deflection < 0.98 * weakest
    area = varying.normal_force[0] / varying.normal_stress[0]
    assert area == pytest.approx(beam.area, rel=0.01)  # the waist is at 24 mm
    for theory in (Cubic(), Fem()):
        one = theory.pull(beam.weakest, 25.4).to_force(5.0).sample(at)
        assert theory.pull(beam, 25.4).to_force(5.0).sample(at).deflection == one.deflection
    thesis = Dissection.of(organ, preset_named("thesis-bile-duct"))
    assert not isinstance(thesis.beam, VaryingBeam)


def test_exact_beam_along_an_even_organ_is_that_of_its_section() -> None:
    organ = tube(wall=1.0)
    even = Organ(
        organ.axis, organ.frames, organ.keys, organ.outer[[0, 0, 0]],
        None if organ.lumen is None else organ.lumen[[0, 0, 0]],
    )  # fmt: skip
    dissection = Dissection.of(even, preset_named("porcine-gallbladder"))
    at = np.array([10.0, 25.4])
    for exact in (Exact(), Exact(Linear(shear=True)), Exact(NeoHooke())):
        beam = dissection.beam
        assert isinstance(beam, VaryingBeam)
        assert beam.weakest is not None
        along = exact.pull(beam, 20.0).to_force(5.0).sample(at)
        constant = exact.pull(beam.weakest, 20.0).to_force(5.0).sample(at)
        assert along.deflection == pytest.approx(constant.deflection, rel=1e-9)
        assert along.total_stress == pytest.approx(constant.total_stress, rel=1e-6)


def test_long_organ_is_clamped_in_its_middle_and_stays_at_rest_outside() -> None:
    organ = shortened(tube(), 2.0)
    dissection = Dissection.of(organ, preset_named("thesis-bile-duct"))
    assert dissection.clamps == pytest.approx((25.4, 76.2))
    pulled = Cubic().pull(dissection.beam, 25.4).to_force(3.0).sample(dissection.beam_stations)
    transforms = dissection.move(pulled, dissection.rest_transforms())
    outside = (dissection.driving.stations <= 25.4) | (dissection.driving.stations >= 76.2)
    assert outside.sum() > 10
    assert not transforms[outside].any()
    assert np.abs(transforms[~outside]).max(axis=(1, 2)).min() > 0.0


def test_only_the_shipped_duct_opens_on_the_thesis_s_bar() -> None:
    assert default_preset(phantom()).name == "thesis-bile-duct"
    other = replace(phantom(), encoded=b"")
    for organ in (tube(), tube(wall=1.0), shortened(tube(wall=1.0), 2.0), other):
        preset = default_preset(organ)
        assert preset.name == "assumed-duct"
        assert "assum" in preset.source.lower()
        assert Dissection.of(organ, preset).own_sections


def test_organ_of_one_s_own_has_its_own_span_and_is_clamped_at_its_ends() -> None:
    organ = shortened(tube(wall=1.0), 2.0)
    dissection = Dissection.of(organ, default_preset(organ))
    assert dissection.clamps == (0.0, organ.length)
    assert dissection.beam.span == pytest.approx(2.0 * LENGTH)
    assert "the organ's own hollow sections" in dissection.section(Cubic())
    assert "not the organ's own hollow sections" in Dissection.of(
        organ, preset_named("thesis-bile-duct")
    ).section(Cubic())


@pytest.mark.parametrize(
    "theory",
    [Cubic(), TautString(), Exact(), Exact(NeoHooke()), Fem(), MassSpring()],
    ids=lambda theory: f"{theory.name}-{getattr(theory, 'law', '')}",
)
def test_hollow_organ_is_a_hollow_beam_in_every_theory(theory: Theory) -> None:
    """An even tube with a 1 mm wall beside the closed form's ring, and beside the full bar."""
    organ = tube(wall=1.0)
    even = replace(organ, outer=organ.outer[[0, 0, 0]], lumen=np.asarray(organ.lumen)[[0, 0, 0]])
    beam = Dissection.of(even, preset_named("assumed-duct")).beam
    ring, full = (
        Beam.round(span=beam.span, diameter=2.0 * RADIUS, modulus=beam.modulus, wall=wall)
        for wall in (1.0, None)
    )

    def deflection(of: Beam) -> float:
        return theory.pull(of, 0.5 * of.span).to_force(0.5).deflection

    # Two degree-6 curves leave 0.5 % of a circle's area aside, a wall's is a difference of two.
    assert deflection(beam) == pytest.approx(deflection(ring), rel=0.02)
    assert deflection(beam) > 1.1 * deflection(full)


def test_short_organ_is_refused_by_a_span_it_cannot_hold() -> None:
    organ = shortened(tube(wall=1.0), 0.5)
    with pytest.raises(ValueError, match=r"clamps 50\.8 mm of duct and this organ is 25\.4 mm"):
        Dissection.of(organ, preset_named("thesis-bile-duct"))


def own(beam: RoundBeam | OrganBeam) -> Preset:
    return Preset("mine", beam, modulus_MPa=1.0, break_stress_MPa=0.5)


def test_a_wall_that_is_typed_makes_a_full_organ_hollow() -> None:
    full = tube()
    typed = Dissection.of(full, own(OrganBeam(wall_mm=1.0))).beam
    drawn = Dissection.of(tube(wall=1.0), own(OrganBeam())).beam
    assert typed.area == pytest.approx(drawn.area, rel=0.02)
    assert typed.second_moment == pytest.approx(drawn.second_moment, rel=0.02)
    assert typed.fibre_distance == pytest.approx(drawn.fibre_distance, rel=1e-6)
    with pytest.raises(ValueError, match=r"wall of 4\.2 mm is thicker than the organ"):
        Dissection.of(full, own(OrganBeam(wall_mm=4.2)))


def test_clamps_that_are_typed_are_where_the_organ_is_held() -> None:
    organ = tube(wall=1.0)
    held = Dissection.of(organ, own(OrganBeam(clamps_mm=(10.0, 40.0))))
    assert held.clamps == (10.0, 40.0)
    assert held.beam.span == 30.0
    bar = Dissection.of(organ, own(RoundBeam(30.0, 8.0, wall_mm=1.0, first_clamp_mm=5.0)))
    assert bar.clamps == (5.0, 35.0)
    assert bar.beam.area == pytest.approx(math.pi * (16.0 - 9.0))
    assert bar.beam.second_moment == pytest.approx(math.pi / 4.0 * (256.0 - 81.0))
    for beam in (OrganBeam(clamps_mm=(10.0, 60.0)), RoundBeam(30.0, 8.0, first_clamp_mm=30.0)):
        with pytest.raises(ValueError, match=r"second clamp at 60 mm and this organ is 50\.8"):
            Dissection.of(organ, own(beam))


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.5])
def test_frame_is_right_handed_along_the_clamps_and_up_the_images(turn: float) -> None:
    organ = tube(wall=1.0)
    rotation = np.array(
        [
            [math.cos(turn), -math.sin(turn), 0.0],
            [math.sin(turn), math.cos(turn), 0.0],
            [0.0, 0.0, 1.0],
        ]
    ) @ np.array(
        [
            [1.0, 0.0, 0.0],
            [0.0, math.cos(turn), -math.sin(turn)],
            [0.0, math.sin(turn), math.cos(turn)],
        ]
    )
    turned = Organ(
        organ.axis @ rotation.T + [10.0, -20.0, 1000.0],
        rotation @ organ.frames,
        organ.keys,
        organ.outer,
        organ.lumen,
    )
    dissection = Dissection.of(turned, preset_named("porcine-bile-duct"))
    frame = dissection.frame
    assert frame.T @ frame == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)
    assert frame[:, 0] == pytest.approx(rotation[:, 0], abs=1e-12)
    assert frame[:, 2] == pytest.approx(rotation[:, 2], abs=1e-12)
    # A turned organ is the same beam.
    still = Dissection.of(organ, preset_named("porcine-bile-duct")).beam
    assert dissection.beam.second_moment == pytest.approx(still.second_moment, rel=1e-9)
