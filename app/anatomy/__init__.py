"""Anatomies: files of several tubes that join, cases drawn from a seed, and a patient's labels."""

from app.anatomy.anatomy_file import anatomy_toml, read_anatomy, shipped_anatomies
from app.anatomy.anatomy_geometry import TubeLine, tube_lines
from app.anatomy.hepatocystic_triangle import drawn_anatomy
from app.anatomy.tables import Anatomy

__all__ = [
    "Anatomy",
    "TubeLine",
    "anatomy_toml",
    "drawn_anatomy",
    "read_anatomy",
    "shipped_anatomies",
    "tube_lines",
]
