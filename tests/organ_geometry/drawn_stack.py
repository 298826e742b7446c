"""Stacks of drawn images in memory, and the edges that the tracing finds in one of them."""

from pathlib import Path
from typing import Any

import numpy as np

from organ_geometry import GreyImage, ImageStack, TraceOptions, trace_organ
from organ_geometry.contours.edge_curve import NoEdgeFound
from organ_geometry.contours.traced_organ import TracedOrgan, TracedSection
from organ_geometry.images.image_planes import ImagePlanes
from organ_geometry.images.image_volume import VolumeSlices


def traced_image(
    image: GreyImage, pixel_size: tuple[float, float] = (1.0, 1.0), **options: Any
) -> TracedOrgan:
    """What is traced in a stack of one image."""
    stack = ImageStack(
        source=Path("drawn"),
        names=("image",),
        slices=VolumeSlices(image[np.newaxis]),
        shape=(image.shape[0], image.shape[1]),
        planes=ImagePlanes(np.array(pixel_size), 1.0, np.zeros((1, 3)), np.eye(3)[np.newaxis]),
    )
    return trace_organ(stack, TraceOptions(**options), workers=1)


def traced_edges(image: GreyImage, **options: Any) -> TracedSection:
    """The edges in an image; what the tracing says where it finds none is raised."""
    traced = traced_image(image, **options)
    if traced.problems:
        raise NoEdgeFound(traced.problems[0])
    return traced.sections[0]
