"""Keys of files as they were written before, by their present names."""

from typing import Any, cast

PRESENT = {
    "bending_across_Nmm2": "bending_across_N_mm2",
    "bending_stiffness_Nmm2": "bending_stiffness_N_mm2",
    "floor_N_mm2": "floor_N_per_mm2",
    "from_share": "from_fraction",
    "grasp_share": "grasp_fraction",
    "part_mm": "failure_mm",
    "rate_ml_s": "rate_ml_per_s",
    "speed_mm_s": "speed_mm_per_s",
    "stiffness_N_mm": "stiffness_N_per_mm",
    "stiffness_N_mm2": "stiffness_N_per_mm2",
    "stiffness_kPa_mm": "stiffness_kPa_per_mm",
    "strands_a_mm": "strands_per_mm",
    "strength_N_mm": "strength_N_per_mm",
    "to_share": "to_fraction",
    "torsion_stiffness_Nmm2": "torsion_stiffness_N_mm2",
    "toughness_J_m2": "toughness_J_per_m2",
    "two_sided": "bilateral",
}


def with_present_keys(found: Any) -> Any:
    """Return what a file holds, with the present names of the keys of all its tables."""
    if isinstance(found, dict):
        table = cast("dict[str, Any]", found)
        return {_present(key): with_present_keys(each) for key, each in table.items()}
    if isinstance(found, list):
        rows = cast("list[Any]", found)
        # Of a run's inputs, thousands of rows of numbers, there is nothing to rename.
        return [with_present_keys(each) for each in rows] if _has_tables(rows) else rows
    return found


def _present(key: str) -> str:
    return ".".join(PRESENT.get(each, each) for each in key.split("."))


def _has_tables(rows: list[Any]) -> bool:
    return bool(rows) and isinstance(rows[0], dict)
