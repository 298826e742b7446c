"""Real organs to measure on: images, reference surfaces, and errors against them."""

import math
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import KDTree

from benchmarks.peer_meshes import Mesh, contour_loft
from benchmarks.surface_distance import TriangleSurface, spread_points
from organ_geometry import ImageStack, TraceOptions, read_image_stack, trace_organ

DATA = Path(os.environ.get("BLUNTDISSECT_DATA") or Path(__file__).parents[2] / "shared" / "data")
SETS = ("bile_duct_perpendicular", "bile_duct_parallel", "ureter_left", "aorta_ct")

# Sections at each end that no error is taken at: meshes close there, and organs end.
CLIPPED = 3

FINE_CORNERS = 128

# Masks cut from a mesh have a pixel set where two of its 2 x 2 samples are inside. Across an edge
# at an angle t to the pixels that is up to (cos t - sin t) / 4 px beyond it; this is the mean.
MASK_SHIFT_PX = -(math.sqrt(2.0) - 1.0) / math.pi


@dataclass(frozen=True)
class OrganSet:
    """A stack of masks and the reference surface of the organ."""

    name: str  # Name of its folder in `DATA`

    @property
    def images(self) -> Path:
        """Folder of the masks."""
        return DATA / self.name / "masks"

    @cached_property
    def stack(self) -> ImageStack:
        """The masks and their planes."""
        return read_image_stack(self.images)

    @cached_property
    def contours(self) -> list[NDArray[np.float64]]:
        """(N, 3) edge points of each section in which the builder finds the organ, mm."""
        stack = self.stack
        rows, columns = stack.shape
        middle = 0.5 * np.array([columns - 1.0, rows - 1.0])
        found: list[NDArray[np.float64]] = []
        for section in trace_organ(stack, TraceOptions(polarity="bright")).sections:
            plane = (section.outer - middle) * stack.pixel_size
            frame = stack.frames[section.index]
            found.append(stack.origins[section.index] + plane @ frame[:, :2].T)
        return found

    @cached_property
    def axis(self) -> NDArray[np.float64]:
        """(S, 3) mean of each section's edge points, mm."""
        return np.array([contour.mean(axis=0) for contour in self.contours])

    @cached_property
    def radius(self) -> float:
        """Radius of the circle of a section's area across the axis, averaged over the axis, mm."""
        along = np.gradient(self.axis, axis=0)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        vectors = np.array([_area_vector(contour) for contour in self.contours])
        areas = np.abs(np.einsum("si,si->s", vectors, along))
        return float(np.sqrt(areas / np.pi).mean())

    @property
    def pixel(self) -> float:
        """Geometric mean of a pixel's sides, mm."""
        return float(np.sqrt(self.stack.pixel_size.prod()))

    @property
    def edge_shift(self) -> float:
        """How far the edges of masks cut from a mesh are to be moved out, mm."""
        return MASK_SHIFT_PX * self.pixel if self.reference_files else 0.0

    @property
    def reference_files(self) -> list[Path]:
        """Meshes that the masks were cut from."""
        return sorted((DATA / self.name / "reference").glob("*.obj"))

    @cached_property
    def truth(self) -> TriangleSurface:
        """The reference mesh, or where there is none the loft of all edge points."""
        if not self.reference_files:
            return TriangleSurface(*contour_loft(self.contours, FINE_CORNERS))
        mesh = trimesh.load_mesh(self.reference_files[0], process=False)
        return TriangleSurface(np.asarray(mesh.vertices), np.asarray(mesh.faces))

    @cached_property
    def _sections(self) -> KDTree:
        return KDTree(self.axis)

    def rms(self, mesh: Mesh, count: int) -> float:
        """Return the RMS distance of a mesh to the true surface, sections at the ends left out."""
        distances = self.inner_distances(spread_points(*mesh, count)[0])
        return float(np.sqrt(np.mean(distances**2))) if len(distances) else np.inf

    def inner_distances(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distances of points to the true surface, sections at the ends left out."""
        _, section = self._sections.query(points)
        last = len(self.axis) - 1 - CLIPPED
        if len(points) == 0 or section.min() > CLIPPED or section.max() < last:
            return np.empty(0)
        return self.truth.distances(points[(section >= CLIPPED) & (section <= last)])


def missing_sets() -> list[str]:
    """Return the sets that are not on this machine."""
    return [name for name in SETS if not OrganSet(name).images.is_dir()]


def _area_vector(contour: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the vector area (3,) that a closed contour (N, 3) bounds."""
    here = contour - contour.mean(axis=0)
    return 0.5 * np.cross(here, np.roll(here, -1, axis=0)).sum(axis=0)
