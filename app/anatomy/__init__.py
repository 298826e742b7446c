"""Anatomies: files of several tubes that join, cases drawn from a seed, and a patient's labels."""

from app.anatomy.anatomy_file import anatomy_toml, read_anatomy, shipped_anatomies
from app.anatomy.anatomy_geometry import TubeLine, tube_lines
from app.anatomy.anatomy_network import AnatomyNetwork, anatomy_network
from app.anatomy.hepatocystic_triangle import drawn_anatomy
from app.anatomy.patient_case import PatientCase, named_labels, patient_case, write_case
from app.anatomy.tables import Anatomy

__all__ = [
    "Anatomy",
    "AnatomyNetwork",
    "PatientCase",
    "TubeLine",
    "anatomy_network",
    "anatomy_toml",
    "drawn_anatomy",
    "named_labels",
    "patient_case",
    "read_anatomy",
    "shipped_anatomies",
    "tube_lines",
    "write_case",
]
