"""From cross-section images to an organ: its axis, its outlines, its file.

    stack = read_image_stack(Path("scans"), ReadOptions(pixel_size=(0.1, 0.1), slice_spacing=0.4))
    built = build_organ(stack, TraceOptions(polarity="dark"), Promise(tolerance_mm=0.05))
    write_organ(built.organ, Path("duct.organ"))

Between the two are the stages `trace_organ`, `reslice_where_needed`, `fit_organ`, `encode_organ`
and `report_organ`, each of which takes what the one before returns.

Surfaces of an organ are in `organ_geometry.mesh`. Each name is imported when it is first asked for,
so that a command which only reads an organ loads no image library.
"""

import ast
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from organ_geometry.atomic_file import WorkFolder as WorkFolder
    from organ_geometry.atomic_file import check_target as check_target
    from organ_geometry.atomic_file import file_name as file_name
    from organ_geometry.atomic_file import make_folder as make_folder
    from organ_geometry.atomic_file import remove_left_behind as remove_left_behind
    from organ_geometry.atomic_file import write_atomic as write_atomic
    from organ_geometry.contours.organ_tracing import trace_organ as trace_organ
    from organ_geometry.contours.trace_options import Seed as Seed
    from organ_geometry.contours.trace_options import TraceOptions as TraceOptions
    from organ_geometry.contours.traced_organ import TracedOrgan as TracedOrgan
    from organ_geometry.contours.traced_organ import TracedSection as TracedSection
    from organ_geometry.curves.fitted_organ import FittedOrgan as FittedOrgan
    from organ_geometry.curves.fitted_organ import fit_organ as fit_organ
    from organ_geometry.driving_points import DrivingPoints as DrivingPoints
    from organ_geometry.encoder.encode import ToleranceTooSmall as ToleranceTooSmall
    from organ_geometry.images.grey_image import GreyImage as GreyImage
    from organ_geometry.images.grey_image import ImageStackError as ImageStackError
    from organ_geometry.images.grey_image import list_text as list_text
    from organ_geometry.images.image_files import IMAGE_SUFFIXES as IMAGE_SUFFIXES
    from organ_geometry.images.image_region import Region as Region
    from organ_geometry.images.image_stack import ImageStack as ImageStack
    from organ_geometry.images.label_volume import LabelVolume as LabelVolume
    from organ_geometry.images.label_volume import read_labels as read_labels
    from organ_geometry.images.label_volume import write_labels as write_labels
    from organ_geometry.images.medical_file import DICOM_SUFFIXES as DICOM_SUFFIXES
    from organ_geometry.images.medical_file import VOLUME_SUFFIXES as VOLUME_SUFFIXES
    from organ_geometry.images.medical_file import is_dicom_file as is_dicom_file
    from organ_geometry.images.medical_file import is_volume_file as is_volume_file
    from organ_geometry.images.medical_file import read_header as read_header
    from organ_geometry.images.spacing_file import SPACING_FILE as SPACING_FILE
    from organ_geometry.images.stack_reader import ReadOptions as ReadOptions
    from organ_geometry.images.stack_reader import read_image_stack as read_image_stack
    from organ_geometry.images.stack_reader import stack_labels as stack_labels
    from organ_geometry.organ import Organ as Organ
    from organ_geometry.organ import SectionProperties as SectionProperties
    from organ_geometry.organ import Wall as Wall
    from organ_geometry.organ_builder import BuiltOrgan as BuiltOrgan
    from organ_geometry.organ_builder import Promise as Promise
    from organ_geometry.organ_builder import build_fitted as build_fitted
    from organ_geometry.organ_builder import build_organ as build_organ
    from organ_geometry.organ_builder import encode_organ as encode_organ
    from organ_geometry.organ_builder import report_organ as report_organ
    from organ_geometry.organ_file import FILE_VERSION as FILE_VERSION
    from organ_geometry.organ_file import code_from_bytes as code_from_bytes
    from organ_geometry.organ_file import organ_from_bytes as organ_from_bytes
    from organ_geometry.organ_file import read_organ as read_organ
    from organ_geometry.organ_file import write_organ as write_organ
    from organ_geometry.reslice.resliced_stack import ReslicedSlices as ReslicedSlices
    from organ_geometry.reslice.resliced_stack import When as When
    from organ_geometry.reslice.resliced_stack import reslice_stack as reslice_stack
    from organ_geometry.reslice.resliced_stack import reslice_where_needed as reslice_where_needed
    from organ_geometry.section_report import SectionReport as SectionReport
    from organ_geometry.tubes.label_tubes import FoundTubes as FoundTubes
    from organ_geometry.tubes.label_tubes import LabelTube as LabelTube
    from organ_geometry.tubes.label_tubes import LabelTubes as LabelTubes
    from organ_geometry.tubes.label_tubes import found_tubes as found_tubes
    from organ_geometry.tubes.round_organ import round_organ as round_organ
    from organ_geometry.tubes.tube_joins import TubeJoin as TubeJoin
else:
    # The names above by their modules, declared once: read from the lines that type checkers read.
    _MODULE_OF = {
        name.name: line.module
        for line in ast.walk(ast.parse(Path(__file__).read_text(encoding="utf-8")))
        if isinstance(line, ast.ImportFrom) and line.module.startswith(f"{__name__}.")
        for name in line.names
    }

    def __getattr__(name: str) -> object:
        """Import a name of the face from the module that holds it (PEP 562)."""
        if name not in _MODULE_OF:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        found = getattr(import_module(_MODULE_OF[name]), name)
        globals()[name] = found
        return found

    def __dir__() -> list[str]:
        return sorted({*globals(), *_MODULE_OF})
