"""Time to move a skin, beside a copy of its bytes, and to export a rigged organ."""

import math
from dataclasses import replace

import numpy as np

from app.export.pull_export import PullExport
from app.export.rigged_organ import rigged_organ
from app.simulation import Dissection, Specimen, preset_named
from benchmarks.stopwatch import microseconds
from organ_geometry import Organ
from organ_geometry.mesh import organ_skin
from physics import Cubic

VERTICES = 20_000
CALLS = 200
KEYS = 200


def skinning_figures(organ: Organ) -> dict[str, float]:
    """Return the times to move a skin of twenty thousand vertices."""
    dissection = Dissection.of(organ, preset_named("porcine-bile-duct"))
    area = (2 if organ.hollow else 1) * 2.0 * math.pi * organ.mean_radius * organ.length
    skin = organ_skin(organ, edge_length=math.sqrt(area / VERTICES))
    bound = skin.bound_to(dissection.driving)
    beam = dissection.beam
    pulled = Cubic().pull(beam, 0.5 * beam.span).to_force(0.02).sample(dissection.beam_stations)
    transforms = dissection.move(pulled, dissection.rest_transforms())
    out = np.empty_like(skin.vertices)

    def move() -> None:
        for _ in range(CALLS):
            dissection.move(pulled, transforms)
            bound.deform(transforms, out)

    def deform() -> None:
        for _ in range(CALLS):
            bound.deform(transforms, out)

    def copy() -> None:
        for _ in range(CALLS):
            np.copyto(out, skin.vertices)

    moved, deformed, copied = (microseconds(each, CALLS) for each in (move, deform, copy))
    return {
        "skinned_vertices": float(len(out)),
        "deform_with_points_us": moved,
        "deform_us": deformed,
        "copy_us": copied,
        "deform_per_copy": moved / copied,
    }


def export_figures(organ: Organ) -> dict[str, float]:
    """Return the time and bytes of a rigged organ."""
    specimen = Specimen(preset_named("porcine-bile-duct"), organ, theory=Cubic())
    dissection = specimen.dissection
    order = PullExport(specimen, 0.5 * dissection.beam.span, frames=KEYS)

    def content(keys: int) -> bytes:
        wanted = replace(order, frames=keys)
        event = wanted.break_event
        assert event is not None
        return rigged_organ(
            organ_skin(organ, edge_length=order.edge_length),
            dissection.driving,
            wanted.motions(),
            dissection.torn_at(event.check, edge_length=order.edge_length),
            radius=organ.mean_radius,
        )

    def pull_bytes(keys: int) -> int:
        skin = organ_skin(organ, edge_length=order.edge_length)
        motion = order.pull(keys)
        return len(rigged_organ(skin, dissection.driving, [motion], radius=organ.mean_radius))

    return {
        "export_keys": float(KEYS),
        "export_ms": 1e-3 * microseconds(lambda: content(KEYS), 1, repeats=3),
        "export_bytes": float(len(content(KEYS))),
        "bytes_a_key": (pull_bytes(KEYS) - pull_bytes(KEYS // 2)) / (KEYS - KEYS // 2),
    }
