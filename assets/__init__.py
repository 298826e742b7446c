"""What ships with the trainer: the bile-duct phantom, images and organ, and material presets."""

from pathlib import Path

__all__ = ["BEDS", "BILE_DUCT", "BILE_DUCT_PHANTOM", "PRESETS", "VALIDATION"]

BILE_DUCT_PHANTOM: Path = Path(__file__).parent / "bile_duct_phantom"
"""Folder of the section images and their ``spacing.json``."""

BILE_DUCT: Path = Path(__file__).parent / "bile_duct_phantom.organ"
"""What `bluntdissect compress` makes of these images."""

PRESETS: Path = Path(__file__).parent / "presets.toml"
"""Material presets, each with its source and how sure it is."""

BEDS: Path = Path(__file__).parent / "beds.toml"
"""Beds of connective tissue, each with its source and how sure it is."""

VALIDATION: Path = Path(__file__).parent / "validation.toml"
"""The thesis's tables and curves of solids, which the theories are held against."""
