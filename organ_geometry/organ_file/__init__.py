"""The organ file: what it holds, read and written (docs/organ-format.md)."""

from organ_geometry.organ_file.organ_code import OrganCode
from organ_geometry.organ_file.organ_file import (
    LARGEST_FILE_BYTES,
    VERSION,
    OrganFileError,
    code_bytes,
    code_from_bytes,
    organ_from_bytes,
    read_organ,
    write_organ,
)

__all__ = [
    "LARGEST_FILE_BYTES",
    "VERSION",
    "OrganCode",
    "OrganFileError",
    "code_bytes",
    "code_from_bytes",
    "organ_from_bytes",
    "read_organ",
    "write_organ",
]
