"""The organ file: its content, read and written (docs/organ-format.md)."""

from organ_geometry.organ_file.organ_code import OrganCode
from organ_geometry.organ_file.organ_file import (
    FILE_VERSION,
    LARGEST_FILE_BYTES,
    OrganFileError,
    code_bytes,
    code_from_bytes,
    organ_from_bytes,
    read_organ,
    write_organ,
)

__all__ = [
    "FILE_VERSION",
    "LARGEST_FILE_BYTES",
    "OrganCode",
    "OrganFileError",
    "code_bytes",
    "code_from_bytes",
    "organ_from_bytes",
    "read_organ",
    "write_organ",
]
