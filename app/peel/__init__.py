"""Scenes of a beam on a bed, or of tubes that join, from TOML files; no organ is needed."""

from app.peel.scene import PeelScene, read_scene

__all__ = ["PeelScene", "read_scene"]
