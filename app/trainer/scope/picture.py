"""An anatomy through the scope, in one client's page: what is sent once, and each frame.

The page draws all of it from a frame's few numbers (`packing`), in `page/`: `pose.js`, `state.js`,
`sheet.js`, `instruments.js`, `picture.js` and `marks.js`, and the shaders beside them.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import viser

from app.anatomy import AnatomyNetwork
from app.simulation import Dissection, Trocar
from app.trainer.scope.packing import Frame, Packing
from app.trainer.scope.pose import Laparoscope
from app.trainer.scope.surroundings import (
    film_runs,
    floor_under,
    strand_table,
)
from app.trainer.scope.tube_walls import RINGS, SIDES, round_wall, tube_wall
from app.trainer.stage.drawn import add_mesh
from app.trainer.viser_bridge.fast_transport import stream
from app.trainer.viser_bridge.page import file_text, float32_text, run_function, run_picture
from physics.bed import BeamOnBed

NODE = "/scope/state"
PAGE = Path(__file__).with_name("page")
SCRIPTS = (
    "pose",
    "pictures",
    "state",
    "sheet",
    "lumps",
    "instruments",
    "picture",
    "marks",
    "pointer",
    "photograph",
    "gamepad",
)
# The linear light of a tube's wall and of its darker places; vessels and bumps on it, its gloss;
# loose fibres and fat on it, lumps and the folds of spiral valves. Matched by eye to photographs.
LOOKS: Mapping[str, Mapping[str, Any]] = {
    "duct": {
        "color": (0.56, 0.41, 0.22), "deep": (0.46, 0.25, 0.12), "vessels": 1.0, "bumps": 1.2,
        "rough": 0.34, "wet": 1.1, "fibres": 0.35, "fat": 0.55, "lumps": 1.2, "folds": 0.0,
        "pulse": False,
    },
    "artery": {
        "color": (0.58, 0.15, 0.11), "deep": (0.48, 0.07, 0.05), "vessels": 0.2, "bumps": 0.7,
        "rough": 0.34, "wet": 1.0, "fibres": 0.12, "fat": 0.15, "lumps": 1.0, "folds": 0.0,
        "pulse": True,
    },
    "vein": {
        "color": (0.20, 0.08, 0.13), "deep": (0.13, 0.04, 0.08), "vessels": 0.1, "bumps": 0.5,
        "rough": 0.34, "wet": 1.0, "fibres": 0.1, "fat": 0.1, "lumps": 1.0, "folds": 0.0,
        "pulse": False,
    },
    "organ": {
        "color": (0.35, 0.37, 0.22), "deep": (0.42, 0.30, 0.17), "vessels": 1.0, "bumps": 0.9,
        "rough": 0.32, "wet": 1.2, "fibres": 0.05, "fat": 0.25, "lumps": 0.5, "folds": 0.0,
        "pulse": False,
    },
    "duodenum": {
        "color": (0.52, 0.22, 0.15), "deep": (0.47, 0.14, 0.09), "vessels": 1.0, "bumps": 1.8,
        "rough": 0.34, "wet": 1.0, "fibres": 0.05, "fat": 0.5, "lumps": 1.3, "folds": 0.0,
        "pulse": False,
    },
}  # fmt: skip
# Colour of the tube that one goes on as, and the element there: of one that ends by itself.
NOWHERE = (0.0, 0.0, 0.0, -1000)
# The spiral valves show at a cystic duct.
FOLDED = ("cystic", "cystic_duct")
# (x, y, z) mm and radius of the duodenum, which nobody touches, in the anatomies' frame.
DUODENUM = (
    (-4.0, 70.0, -12.0, 10.0), (-2.0, 52.0, -7.0, 11.0), (0.5, 34.0, -4.0, 11.5),
    (1.5, 16.0, -2.5, 10.6), (0.0, -1.0, -2.5, 11.5), (-4.0, -18.0, -5.0, 11.4),
    (-10.0, -34.0, -8.0, 12.5), (-19.0, -50.0, -14.0, 12.0),
)  # fmt: skip
# (x, z) mm of the liver's edge and underside, from its foot behind the hilum.
LIVER = (
    (84.0, -12.0), (83.0, 2.0), (79.0, 16.0), (74.0, 27.0), (75.0, 33.0), (84.0, 37.0),
    (105.0, 42.0), (130.0, 46.0),
)  # fmt: skip


class ScopePicture:
    """One client's picture of a network on its bed.

    Parameters
    ----------
    scene
        Of one client.
    made, bed
        The anatomy's network, and its state.
    dissections
        Of each tube: its surface.
    scope
        In whose trocar the page's camera is.
    trocars
        Of the hands.
    instruments
        Their names, by the numbers that hands in frames have.
    plain
        Whether it is drawn more simply, for a machine without a graphics card.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        made: AnatomyNetwork,
        bed: BeamOnBed,
        dissections: Sequence[Dissection],
        *,
        scope: Laparoscope,
        trocars: Sequence[Trocar],
        instruments: Sequence[str],
        plain: bool = False,
    ) -> None:
        self._scene = scene
        self._packing = Packing(bed)
        # The page makes its shaders' kinds from those of viser's background.
        scene.set_background_image(np.zeros((8, 8, 3), np.uint8), format="png")
        self._mesh = add_mesh(
            scene, NODE, self._packing.numbers, np.zeros((1, 3), np.uint32), color=(0, 0, 0)
        )
        runs, films = film_runs(made, bed)
        floor = floor_under(made)
        rows, columns = floor.heights.shape
        given: dict[str, Any] = {
            "pivot": scope.pivot.tolist(),
            "base": scope.base.T.tolist(),
            "nodes": bed.places.shape[0],
            "tubes": _tubes(made, bed, dissections),
            "rings": RINGS,
            "sides": SIDES,
            "strands": float32_text(strand_table(made, bed)),
            "runs": float32_text(runs),
            "films": float32_text(films),
            "floor": {
                "x0": floor.x0, "y0": floor.y0, "cell": floor.cell, "columns": columns,
                "rows": rows, "heights": float32_text(floor.heights),
            },
            "liver": LIVER,
            "trocars": [each.place.tolist() for each in trocars],
            "instruments": list(instruments),
            "plain": plain,
        }  # fmt: skip
        shaders = {path.name.removesuffix(".glsl"): file_text(path) for path in PAGE.glob("*.glsl")}
        files = [PAGE / f"{name}.js" for name in SCRIPTS]
        run_picture(scene, files, "bluntdissectScope.show", NODE, given, shaders)

    def send(self, bed: BeamOnBed, frame: Frame, angle: float) -> bool:
        """Send a frame as a scope of an angle, rad, sees it, if it differs from the last one.

        Returns
        -------
        bool
            Whether it did.
        """
        self._packing.write(bed, frame, angle)
        return stream(self._mesh, "vertices", self._packing.numbers)

    def remove(self) -> None:
        """Give the page viser's own camera back, and remove the picture."""
        run_function(self._scene, "bluntdissectScope.hide")
        self._mesh.remove()


def _tubes(
    made: AnatomyNetwork, bed: BeamOnBed, dissections: Sequence[Dissection]
) -> list[dict[str, Any]]:
    """Return what the page knows of each tube, and of the organs that nobody touches."""
    out: list[dict[str, Any]] = []
    kinds = {tube.name: tube.kind for tube in made.anatomy.tube}
    onto = {join.tube: join for join in made.anatomy.join if join.at_mm == "end"}
    for tube, dissection in zip(made.anatomy.tube, dissections, strict=True):
        rest, joined = made.network.tubes[tube.name], [end == "joined" for end in tube.ends]
        wall = tube_wall(dissection, rest, (joined[0], joined[1]))
        goes_on = NOWHERE
        if join := onto.get(tube.name):
            # It goes on as the other one: no step in width, and one colour fades into the other.
            goes_on = (*LOOKS[kinds[join.to]]["color"], join.end * (len(rest.places) - 1))
            wall[-join.end] = made.network.tubes[join.to].radius[-1]
        look = dict(LOOKS[tube.kind])
        if tube.name in FOLDED:
            look["folds"] = 1.0
        out.append(
            {
                "name": tube.name,
                "nodes": bed.nodes_of(tube.name).tolist(),
                "radius": [round(float(r), 3) for r in rest.radius],
                "wall": float32_text(wall),
                "joined": joined,
                "bare": tube.kind == "organ",
                "onto": goes_on,
                "look": look,
            }
        )
    out.append(
        {
            "name": "duodenum",
            "still": DUODENUM,
            "wall": float32_text(round_wall(np.array(DUODENUM))),
            "bare": True,
            "onto": NOWHERE,
            "look": LOOKS["duodenum"],
        }
    )
    return out
