"""What ships with the trainer: the bile-duct phantom, presets, beds, anatomies and experiments."""

from pathlib import Path

__all__ = [
    "ANATOMIES",
    "BEDS",
    "BILE_DUCT",
    "BILE_DUCT_PHANTOM",
    "EXPERIMENTS",
    "FREQUENCIES",
    "PRESETS",
    "RELAXATIONS",
    "RUNS",
    "SCRIPTS",
    "TUBE_KINDS",
    "VALIDATION",
]

BILE_DUCT_PHANTOM: Path = Path(__file__).parent / "bile_duct_phantom"
"""Folder of the section images and their ``spacing.json``."""

BILE_DUCT: Path = Path(__file__).parent / "bile_duct_phantom.organ"
"""What `bluntdissect compress` makes of these images."""

PRESETS: Path = Path(__file__).parent / "presets.toml"
"""Material presets, each with its source and how sure it is."""

BEDS: Path = Path(__file__).parent / "beds.toml"
"""Beds of connective tissue, each with its source and how sure it is."""

RELAXATIONS: Path = Path(__file__).parent / "relaxations.toml"
"""How tissue relaxes while it is held, each with its source and how sure it is."""

VALIDATION: Path = Path(__file__).parent / "validation.toml"
"""The thesis's tables and curves of solids, which the theories are held against."""

ANATOMIES: Path = Path(__file__).parent / "anatomies"
"""Folder of anatomies, tubes that join, each in a TOML file."""

EXPERIMENTS: Path = Path(__file__).parent / "experiments"
"""Folder of published experiments that are predicted, each in a TOML file."""

SCRIPTS: Path = Path(__file__).parent / "scripts"
"""Folder of scripted hands at anatomies, each in a TOML file."""

RUNS: Path = Path(__file__).parent / "runs"
"""Folder of recorded runs that *Show me* plays, each compressed JSON."""

FREQUENCIES: Path = Path(__file__).parent / "frequencies.toml"
"""How often the hepatocystic triangle is built how, each figure with its source."""

TUBE_KINDS: Path = Path(__file__).parent / "tube_kinds.toml"
"""Walls of ducts, vessels and organs where nothing better is known, and names that mean them."""
