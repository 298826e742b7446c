"""The duct as it is drawn: marked where instruments touch it, and streamed without a gap."""

import io
import math
from typing import Any

import numpy as np
import pytest
import trimesh
import viser
from browser import TrainerPage, newest, trainer_page
from playwright.sync_api import Browser, expect
from simulated import phantom, pull, pull_session, tear

from app.simulation import Phase, Session
from app.trainer.server.trainer import Trainer
from app.trainer.stage.appearance import appearance_of
from app.trainer.stage.clamps import clamp_glb
from app.trainer.stage.contact import BITE, Contact, HookPlace, _press
from app.trainer.stage.hook import bend_radius, wire_radius
from app.trainer.stage.tissue import Tissue

SPAN, RADIUS = 50.8, 4.4453


def middle(height: float) -> np.ndarray:
    """The axis in the middle, raised, mm."""
    return np.array([0.5 * SPAN, 0.0, height])


def contact_of(session: Session) -> Contact:
    """The marks on a session's only surface."""
    dissection = session.tissue.dissection
    skin = session.drawn.surfaces[0].skin
    return Contact(
        skin, dissection.organ.axis_at(skin.stations), dissection.frame, dissection.clamps, RADIUS
    )


def test_clamps_flatten_the_ends_and_leave_the_rest() -> None:
    session = pull_session(phantom())
    skin = session.drawn.surfaces[0].skin
    contact = contact_of(session)
    contact.mark(skin.vertices, None)
    free = np.linalg.norm(contact._pinch, axis=1)
    assert free[np.abs(skin.stations - 0.5 * SPAN) < 0.3 * SPAN].max() < 3e-3 * RADIUS
    end = np.flatnonzero(skin.stations < 1e-9)
    outer = end[end < len(skin.vertices) // 2]
    assert np.ptp(contact.vertices[outer, 2]) == pytest.approx(2.0 * BITE * RADIUS, rel=0.01)
    assert np.ptp(contact.vertices[end, 1]) > np.ptp(skin.vertices[end, 1])
    assert contact.shade[end].max() < 0.7
    assert contact.shade[np.argmin(np.abs(skin.stations - 0.5 * SPAN))] == pytest.approx(1.0)


def test_hook_lies_in_a_groove_that_deepens_with_the_pull() -> None:
    session = pull_session(phantom())
    skin, contact = session.drawn.surfaces[0].skin, contact_of(session)
    wire, bend = wire_radius(RADIUS), bend_radius(RADIUS)
    depths = []
    contact.mark(skin.vertices, None)
    untouched = contact.vertices.copy()
    for sunk in (0.1, 0.9):
        hook = HookPlace(middle(sunk), np.eye(3), RADIUS)
        contact.mark(skin.vertices, hook)
        moved = contact.vertices - untouched
        below = (np.abs(skin.vertices[:, 0] - 0.5 * SPAN) < 0.5) & (skin.vertices[:, 2] < -4.0)
        depths.append(moved[below, 2].max())
        # No vertex of the outer wall is inside the wire, where that runs below the duct.
        outer = contact.vertices[: len(skin.vertices) // 2]
        low = outer[:, 2] < -0.5 * RADIUS
        radial = np.hypot(outer[:, 1], outer[:, 2] - sunk) - bend
        from_wire = np.hypot(outer[:, 0] - 0.5 * SPAN, radial)
        assert from_wire[low].min() > 0.95 * wire
        assert contact.shade.min() < 0.6
        # Its own side of the duct only, and only near it.
        above = (np.abs(skin.vertices[:, 0] - 0.5 * SPAN) < 8.0) & (skin.vertices[:, 2] > 4.0)
        assert np.abs(moved[above]).max() < 1e-3
        quarter = np.abs(skin.vertices[:, 0] - 0.25 * SPAN) < 2.0
        assert np.abs(moved[quarter]).max() < 1e-3
    assert depths[1] > depths[0] + 0.7


@pytest.mark.parametrize("side", [(1.0, 0.0), (0.0, -1.0), (-0.6, 0.8)])
def test_a_nick_opens_the_torn_side_down_to_its_front_and_no_more(
    side: tuple[float, float],
) -> None:
    session = pull_session(phantom())
    skin, contact = session.drawn.surfaces[0].skin, contact_of(session)
    contact.mark(skin.vertices, None)
    before = skin.grid(contact.vertices.copy()).astype(float)
    contact.open_nick(20.0, side, 0.3)
    after, shade = skin.grid(contact.vertices), skin.grid(contact.shade)
    away = np.abs(skin.grid(skin.stations).mean(axis=1) - 20.0)
    heights = [
        (each[..., 2] * side[0] + each[..., 1] * side[1]) / RADIUS for each in (before, after)
    ]
    there = away.argmin()
    # At a depth of 0.3 the front is at 1 - 2 x 0.3 of the radius; the ring there lies on it.
    assert heights[0][there].max() == pytest.approx(1.0, abs=0.1)
    assert heights[1][there].max() == pytest.approx(0.4, abs=0.12)
    torn = shade < 0.0
    assert torn[there].any()
    assert heights[0][torn].min() > 0.3
    assert np.array_equal(after[~torn], before[~torn].astype(np.float32))
    assert not torn[away > 0.5 * RADIUS].any()


def test_contact_kernel_is_its_python_form() -> None:
    skin = pull_session(phantom(), vertices=500).drawn.surfaces[0].skin
    arguments = (middle(0.6), np.eye(3), bend_radius(RADIUS), wire_radius(RADIUS))
    compiled, plain = skin.vertices.copy(), skin.vertices.copy()
    shades = np.ones((2, len(skin.vertices)), np.float32)
    _press(compiled, shades[0], *arguments)
    _press.py_func(plain, shades[1], *arguments)
    np.testing.assert_allclose(compiled, plain, atol=1e-5)
    np.testing.assert_allclose(shades[0], shades[1], atol=1e-5)


def test_every_surface_knows_its_grids() -> None:
    session = pull_session(phantom())
    surfaces = [*session.drawn.surfaces]
    tear(session)
    for surface in [*surfaces, *session.drawn.surfaces]:
        skin = surface.skin
        assert skin.wall_size == len(skin.vertices) // 2  # the phantom is hollow
        assert np.all(np.diff(skin.grid(skin.stations), axis=0) > 0.0)
        # Each grid's direction outwards is what its handedness says.
        outer, lumen = skin.grid(skin.vertices), skin.grid(skin.vertices, "lumen")
        around = np.roll(outer, -1, axis=1) - outer
        normals = np.cross(around[:-1], np.diff(outer, axis=0)) * (1 if skin.right_handed else -1)
        assert np.all(np.sum(outer[:-1] * [0.0, 1.0, 1.0] * normals, axis=2) > 0.0)
        assert np.all(np.linalg.norm((outer - lumen)[..., 1:], axis=2) > 0.1)
        for side in ("outer", "inside"):
            numbers, faces = skin.side(side)
            assert set(faces.ravel().tolist()) == set(range(len(numbers)))
        both = [skin.side(side) for side in ("outer", "inside")]
        np.testing.assert_array_equal(
            np.concatenate([numbers[faces] for numbers, faces in both]), skin.faces
        )


def tissue_of(scene: viser.SceneApi, session: Session, contact: Contact) -> Tissue:
    """The picture of a session's only surface."""
    look = appearance_of(session.tissue.dissection.preset)
    return Tissue(scene, "/organ/skin", contact, look=look, radius=RADIUS)


def test_streamed_rings_are_where_the_session_has_the_wall_and_go_on_into_the_jaws(
    scene: viser.SceneApi,
) -> None:
    session = pull_session(phantom())
    pull(session, 2.0)
    (surface,) = session.drawn.surfaces
    contact = contact_of(session)
    tissue = tissue_of(scene, session, contact)
    contact.mark(surface.vertices, None)
    tissue.show(contact.vertices, contact.shade)
    handle = scene.get_handle_by_name("/organ/skin")
    assert isinstance(handle, viser.MeshHandle)
    places = tissue._surface.places
    wall = surface.skin.wall_size
    shown = places[tissue._outer].reshape(-1, 3)
    np.testing.assert_array_equal(shown, contact.vertices[:wall])
    # Between the clamps the picture departs from the section's two half-curves by their edge only.
    free = np.abs(surface.skin.stations[:wall] - 0.5 * SPAN) < 0.3 * SPAN
    apart = np.linalg.norm(shown - surface.vertices[:wall], axis=1)
    assert 0.02 < apart[free].max() < 0.7
    # Nothing but the rings and a shade for each of their points is sent.
    assert handle.vertices.nbytes < 16.2 * places.size / 3
    # The stubs go on from the wall's ends without a gap or a step.
    for stub, end in (
        (contact.stubs[0][-1], places[tissue._outer][0]),
        (contact.stubs[1][0], places[tissue._outer][-1]),
    ):
        assert np.abs(stub - end)[:, 0] == pytest.approx(0.12 * RADIUS, abs=1e-3)
        assert np.abs(stub - end)[:, 1:].max() < 0.01 * RADIUS
    tissue.remove()
    assert scene.get_handle_by_name("/organ/skin") is None


def test_jaws_touch_what_they_hold() -> None:
    session = pull_session(phantom())
    contact = contact_of(session)
    skin = session.drawn.surfaces[0].skin
    contact.mark(skin.vertices, None)
    ring = contact.vertices[: skin.sides]
    clamp = trimesh.load(
        io.BytesIO(clamp_glb("first", radius=RADIUS, bite=BITE, tissue=(1, 1, 1))), file_type="glb"
    )
    assert isinstance(clamp, trimesh.Scene)
    steel = clamp.geometry["0"].vertices
    over = steel[(np.abs(steel[:, 0]) < 0.35 * RADIUS) & (np.abs(steel[:, 1]) < 0.5 * RADIUS)]
    for side in (1.0, -1.0):
        jaw = (side * over[:, 2])[side * over[:, 2] > 0.0].min()
        held = (side * ring[np.abs(ring[:, 1]) < 0.5 * RADIUS, 2]).max()
        assert -0.12 * RADIUS < jaw - held < 0.03 * RADIUS


def test_rings_are_smooth_where_the_half_curves_meet() -> None:
    session = pull_session(phantom())
    contact, skin = contact_of(session), session.drawn.surfaces[0].skin
    contact.mark(skin.vertices, None)
    turns = []
    for vertices in (skin.vertices, contact.vertices):
        ring = skin.grid(vertices)[skin.rings // 2, :, 1:]
        edges = np.roll(ring, -1, axis=0) - ring
        angles = np.unwrap(np.arctan2(edges[:, 1], edges[:, 0]))
        turns.append(np.abs(np.angle(np.exp(1j * np.diff(angles)))).max())
    even = 2.0 * math.pi / skin.sides
    assert turns[0] > 1.8 * even  # an edge
    assert turns[1] < 1.4 * even


FINE = """() => {
    const { mesh, columns, grids, source, position } =
        window.bluntdissectSurfaces.surfaces.get('/organ/skin');
    const { map, normalMap, clearcoat } = mesh.material;  // pictures come when they are read
    return {
        columns, rows: grids[0].rows, position: Array.from(position),
        normal: Array.from(mesh.geometry.attributes.normal.array),
        streamed: Array.from(source.geometry.attributes.position.array.subarray(0, 3000)),
        seen: mesh.visible && mesh.parent === source.parent, coarse: source.visible,
        pictures: [map, normalMap].map(each => each?.image?.width ?? 0), clearcoat,
    };
}"""


def fine_surface(tab: TrainerPage) -> dict[str, Any]:
    """The duct as the page draws it, when its finish is there."""
    tab.page.wait_for_function("() => window.bluntdissectSurfaces?.surfaces.get('/organ/skin')")
    return tab.page.evaluate(FINE)


def test_page_draws_a_fine_smooth_textured_duct_that_follows_the_pull(browser: Browser) -> None:
    trainer = Trainer(phantom(), port=0, scene="free")
    try:
        with trainer_page(browser, trainer.address, width=480, height=360) as tab:
            session = newest(trainer).session
            at_rest: list[float] = fine_surface(tab)["position"]

            def follows(lifted: float) -> None:
                fine = fine_surface(tab)
                assert np.abs(np.subtract(fine["position"], at_rest)).max() >= lifted
                assert fine["seen"]
                assert not fine["coarse"]
                assert min(fine["pictures"]) >= 1024
                assert fine["clearcoat"] > 0.5
                rows, columns = fine["rows"], fine["columns"]
                shape = (rows, columns, 3)
                places = np.reshape(fine["position"][: rows * columns * 3], shape)
                normals = np.reshape(fine["normal"][: rows * columns * 3], shape)
                # Each second point of each second row is one that was streamed.
                streamed = np.reshape(fine["streamed"], (-1, 3))
                sides = (columns - 1) // 2
                np.testing.assert_allclose(places[2, :-1:2], streamed[sides : 2 * sides])
                # Both columns at the texture's seam are one: no ridge, no gap.
                np.testing.assert_allclose(places[:, 0], places[:, -1], atol=1e-5)
                np.testing.assert_allclose(normals[:, 0], normals[:, -1], atol=1e-4)
                np.testing.assert_allclose(np.linalg.norm(normals, axis=2), 1.0, atol=1e-4)
                # From one point to the next they turn no more than a smooth tube's do: about the
                # ring by its step, along the duct little outside the clamps and the hook's groove.
                around = np.sum(normals[:, 1:] * normals[:, :-1], axis=2)
                free = slice(rows // 4, rows // 3)
                assert np.arccos(np.clip(around[free], -1, 1)).max() < 2.2 * 2.0 * math.pi / columns
                along = np.sum(normals[1:] * normals[:-1], axis=2)[free]
                assert np.arccos(np.clip(along, -1, 1)).max() < 0.15

            tab.eventually(lambda: follows(0.0))
            session.set_target_force(2.5)
            tab.wait_for_force(2.5)
            tab.eventually(lambda: follows(5.0))
    finally:
        trainer.stop()


def test_slow_page_gets_the_simple_picture_and_a_way_back(
    browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    least = "app.trainer.view.page_view.LEAST_PICTURES"
    monkeypatch.setattr(least, 1000.0)  # no page draws as many
    trainer = Trainer(phantom(), port=0, scene="free", look="auto")
    try:
        with trainer_page(browser, trainer.address, width=480, height=360) as tab:
            expect(tab.page.get_by_text("software mode")).to_contain_text("A simpler picture helps")
            tab.wait_for_node("skin_inside")  # of the plain look
            expect(tab.page.get_by_text("A simpler picture", exact=True)).to_be_visible()
            tab.open("Model")
            box = tab.page.get_by_role("checkbox", name="Simple picture")
            expect(box).to_be_checked()
            tab.tick("Simple picture")
            tab.wait_until(lambda: "skin_inside" not in tab.nodes() and fine_surface(tab)["seen"])
            # And once more: what stood for the fine surface is seen again.
            tab.tick("Simple picture")
            tab.wait_for_node("skin_inside")
            tab.page.wait_for_function(
                """() => {
                    let seen = false;
                    window.__viserMutable.nodeRefFromName['/organ/skin'].traverse(node => {
                        seen ||= node.isMesh && node.visible;
                    });
                    return seen;
                }"""
            )
    finally:
        trainer.stop()


def test_torn_is_said_only_of_pieces_that_are_apart() -> None:
    session = pull_session(phantom())
    session.set_target_force(session.planar.force_limit)
    while session.reading().phase is not Phase.TORN:
        session.advance()
    rims = []
    for surface, end in zip(session.drawn.surfaces, (-1, 0), strict=True):
        rims.append(surface.skin.grid(surface.vertices)[end])
    # Both rims have the same shape: what was one place has come apart, most where it tore first.
    gaps = (rims[1] - rims[0])[:, 0]
    assert gaps.min() > -1e-3
    assert gaps.max() > 0.3 * RADIUS
    assert np.mean(gaps > 0.1 * RADIUS) > 0.5
