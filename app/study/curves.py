"""Measured force-deflection curves from CSV files, their units named in the header."""

import csv
import math
import re
from dataclasses import dataclass, replace
from pathlib import Path
from unicodedata import normalize

import numpy as np
from numpy.typing import NDArray

from app.bounded_file import read_bounded
from app.simulation import LIMITS

LENGTHS = {
    "mm": 1.0,
    "um": 1e-3,
    "\u03bcm": 1e-3,
    "cm": 10.0,
    "m": 1000.0,
    "in": 25.4,
    "inch": 25.4,
}
FORCES = {
    "N": 1.0,
    "mN": 1e-3,
    "kN": 1e3,
    "gf": 9.80665e-3,
    "kgf": 9.80665,
    "lbf": 4.4482216152605,
}
COLUMNS = {
    "deflection": ("deflection", LENGTHS, 1.0),
    "displacement": ("deflection", LENGTHS, 1.0),
    "lift": ("deflection", LENGTHS, 1.0),
    "force": ("force", FORCES, 1.0),
    "load": ("force", FORCES, 1.0),
    "half_force": ("force", FORCES, 2.0),  # P of the thesis, on one half of the duct
}
# Numbers that comments at the top of a file may give of its ducts.
FACTS = ("span_mm", "diameter_mm", "wall_mm", "grasp_mm")
MOST_BYTES = 50_000_000
FEWEST_POINTS = 4
# Part of its largest value that the force falls below once the duct is torn.
FALLEN = 0.5


@dataclass(frozen=True, slots=True)
class Curve:
    """One pull: deflections and forces, growing from rest."""

    name: str
    deflections: NDArray[np.float64]  # (N,) of the grasp, mm
    forces: NDArray[np.float64]  # (N,) the grasper's whole force, N
    facts: dict[str, float]  # what its file says of the duct, by the names in `FACTS`
    broke: bool  # whether its last point is the break


def read_curves(path: Path, *, broke: bool = False) -> list[Curve]:
    """Return the curves in a CSV file, in its order; a `ValueError` names the line that is wrong.

    Parameters
    ----------
    path
        Columns `deflection_mm` and `force_N`, or with other units, `deflection [in]`; `curve` names
        the curve of each row where there are several. Between semicolons or tabs numbers may have
        a decimal comma. Lines `# span_mm = 50.8` above the header
        give the duct, `# broke = yes` says that the last point is the break.
    broke
        Whether curves end with the break though the file does not say so.

    Returns
    -------
    list[Curve]

    Raises
    ------
    ValueError
        If it is no such file.
    """
    content = read_bounded(path, MOST_BYTES, "measured curve")
    try:
        lines = content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise ValueError(f"{path} is no text in UTF-8") from None
    facts: dict[str, float] = {}
    header = 0
    for header, line in enumerate(lines):
        if line.lstrip().startswith("#"):
            fact = _fact(line, f"{path}, line {header + 1}")
            if fact is not None and fact[0] == "broke":
                broke = fact[1] > 0.0
            elif fact is not None:
                facts[fact[0]] = fact[1]
        elif line.strip():
            break
    else:
        raise ValueError(f"{path} has no header: a line such as deflection_mm,force_N")
    delimiter = ";" if ";" in lines[header] else "\t" if "\t" in lines[header] else ","
    rows = csv.reader(lines[header:], delimiter=delimiter)
    columns = _columns(next(rows), f"{path}, line {header + 1}")
    points: dict[str, list[tuple[float, float]]] = {}
    for number, row in enumerate(rows, header + 2):
        if not row or not "".join(row).strip() or row[0].lstrip().startswith("#"):
            continue
        values: dict[str, float] = {}
        for kind in ("deflection", "force"):
            at, factor, name = columns[kind]
            text = row[at].strip() if at < len(row) else ""
            if delimiter != "," and "." not in text:
                text = text.replace(",", ".", 1)
            values[kind] = factor * _number(text, f"{path}, line {number}: {name}")
        name = row[columns["curve"][0]].strip() if "curve" in columns else ""
        points.setdefault(name, []).append((values["deflection"], values["force"]))
    if not points:
        raise ValueError(f"{path} has no points below its header")
    return [
        _curve(f"{path.stem} {name}".strip(), np.array(found), facts, broke=broke, path=path)
        for name, found in points.items()
    ]


def _fact(line: str, where: str) -> tuple[str, float] | None:
    """Return what a comment gives of the duct, None if it is only a comment."""
    found = re.match(r"\s*#\s*([A-Za-z_]+)\s*=\s*(\S+)\s*$", line)
    if found is None:
        return None
    name, text = found[1], found[2]
    if name == "broke":
        if text not in ("yes", "no"):
            raise ValueError(f"{where}: broke must be yes or no, got {text!r}")
        return name, float(text == "yes")
    if name not in FACTS:
        raise ValueError(f"{where}: {name} is not known; there are broke, {', '.join(FACTS)}")
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{where}: {name} must be a number of mm, got {text!r}") from None
    low, high, _ = LIMITS.get(name, LIMITS["span_mm"])
    if not low <= value <= high:
        raise ValueError(f"{where}: {name} must be from {low:g} to {high:g} mm, got {text}")
    return name, value


def _columns(header: list[str], where: str) -> dict[str, tuple[int, float, str]]:
    """Return the place, the factor to mm or N and the name of each column."""
    columns: dict[str, tuple[int, float, str]] = {}
    for at, cell in enumerate(header):
        text = normalize("NFKC", cell.strip())  # the sign for micro is a letter
        if text.lower() == "curve":
            columns["curve"] = at, 1.0, text
            continue
        found = re.fullmatch(
            r"([A-Za-z_ ]+?)(?:[ _]*[\[(]\s*([^\W\d_]+)\s*[\])]|[_ ]([^\W\d_]+))?", text
        )
        name = "" if found is None else found[1].strip().lower().replace(" ", "_")
        unit = None if found is None else found[2] or found[3]
        if name not in COLUMNS and text.lower().replace(" ", "_") in COLUMNS:
            name, unit = text.lower().replace(" ", "_"), None
        if name not in COLUMNS:
            continue  # another column, of the time perhaps
        kind, units, times = COLUMNS[name]
        if unit is None:
            raise ValueError(
                f"{where}: the column {text!r} has no unit; write {name}_{next(iter(units))}, or "
                f"one of {', '.join(units)}"
            )
        if unit not in units:
            what = "length" if units is LENGTHS else "force"
            raise ValueError(
                f"{where}: {text!r}: {unit!r} is no unit of a {what} here; there are "
                f"{', '.join(units)}"
            )
        if kind in columns:
            raise ValueError(f"{where}: {columns[kind][2]!r} and {text!r} are both a {kind}")
        columns[kind] = at, units[unit] * times, text
    for kind, example in (("deflection", "deflection_mm"), ("force", "force_N")):
        if kind not in columns:
            raise ValueError(
                f"{where}: there is no column of a {kind} with its unit, such as {example}; the "
                f"columns are {', '.join(repr(cell.strip()) for cell in header)}; lines above the "
                "header begin with #"
            )
    return columns


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        why = "; leave out thousands separators" if "," in text else ""
        raise ValueError(f"{where} must be a finite number, got {text!r}{why}")
    return value


def _curve(
    name: str,
    points: NDArray[np.float64],
    facts: dict[str, float],
    *,
    broke: bool,
    path: Path,
) -> Curve:
    if points[:, 0].sum() < 0.0:  # pulled the other way
        points = -points
    deflections, forces = points[:, 0], points[:, 1]
    if np.corrcoef(deflections, forces)[0, 1] < 0.0 if np.ptp(deflections) * np.ptp(forces) else 0:
        raise ValueError(f"{path}: {name}: the force falls as the deflection grows: wrong signs?")
    # What comes after the tear is no pull any more; a duct that is let go has not torn.
    highest = int(np.argmax(forces))
    fallen = forces[highest:] < FALLEN * forces[highest]
    after = np.flatnonzero(fallen & (deflections[highest:] >= deflections[highest]))
    found = Curve(name, deflections, forces, facts, broke)
    if highest > 0 and after.size:
        found = replace(
            found, deflections=deflections[: highest + 1], forces=forces[: highest + 1], broke=True
        )
    moved = int(np.count_nonzero(found.deflections > 0.0))
    if moved < FEWEST_POINTS or np.ptp(found.deflections) <= 0.0:
        raise ValueError(
            f"{path}: {name} has {moved} points away from rest; a fit needs {FEWEST_POINTS} or more"
        )
    return found
