"""A duct in its bed of tissue: beds and their sources, scenes of a beam on one (docs/peel.md)."""

from app.simulation.bed.preset import BedPreset, beam_in_space, bed_named, bed_presets
from app.simulation.bed.scene import PeelScene, read_scene

__all__ = ["BedPreset", "PeelScene", "beam_in_space", "bed_named", "bed_presets", "read_scene"]
