"""The static things around the duct (tissue bed, clamps, hook, lights, camera), and its surface."""

from app.trainer.stage.camera import Viewpoint, viewpoint
from app.trainer.stage.lighting import Look
from app.trainer.stage.stage import Stage

__all__ = ["Look", "Stage", "Viewpoint", "viewpoint"]
