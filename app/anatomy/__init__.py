"""Anatomies: files of several tubes that join, cases drawn from a seed, and a patient's labels."""

from app.anatomy.anatomy_file import (
    anatomy_named,
    anatomy_toml,
    checked,
    first_edition,
    read_anatomy,
    shipped_anatomies,
)
from app.anatomy.anatomy_geometry import TubeLine, tube_line, tube_lines
from app.anatomy.anatomy_labels import anatomy_labels, labels_suffix
from app.anatomy.anatomy_network import AnatomyNetwork, anatomy_network
from app.anatomy.case_workbench import CaseWorkbench
from app.anatomy.hepatocystic_triangle import drawn_anatomy
from app.anatomy.patient_case import (
    CaseBuilder,
    CaseChoices,
    PatientCase,
    TubeEndName,
    named_labels,
    patient_case,
    write_case,
)
from app.anatomy.tables import Anatomy, TubeTable
from app.anatomy.tube_kinds import tube_title, wall_of
from app.anatomy.tube_organ import place_of, tube_organ

__all__ = [
    "Anatomy",
    "AnatomyNetwork",
    "CaseBuilder",
    "CaseChoices",
    "CaseWorkbench",
    "PatientCase",
    "TubeEndName",
    "TubeLine",
    "TubeTable",
    "anatomy_labels",
    "anatomy_named",
    "anatomy_network",
    "anatomy_toml",
    "checked",
    "drawn_anatomy",
    "first_edition",
    "labels_suffix",
    "named_labels",
    "patient_case",
    "place_of",
    "read_anatomy",
    "shipped_anatomies",
    "tube_line",
    "tube_lines",
    "tube_organ",
    "tube_title",
    "wall_of",
    "write_case",
]
