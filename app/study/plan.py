# What a TOML file holds is known once it is checked.
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
"""A study's plan: what is fixed, what is drawn from distributions, what is compared on a grid."""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Literal

import msgspec

from app.anatomy import Anatomy, anatomy_named, drawn_anatomy, read_anatomy, shipped_anatomies
from app.bounded_file import read_bounded
from app.older_keys import with_present_keys
from app.simulation import Preset, Script, preset_named, presets, read_preset, read_script
from app.study.correlation import Correlation, copula_factor
from app.study.distribution import Choices, Distribution, distribution_of
from app.study.inputs import (
    ANATOMY,
    ANATOMY_INPUTS,
    BED,
    BED_INPUTS,
    DUCT_INPUTS,
    INPUTS,
    Input,
)
from app.toml_lines import TomlLines
from organ_geometry import Organ, organ_from_bytes

Value = float | str
Sampling = Literal["sobol", "latin-hypercube"]

SAMPLINGS: tuple[Sampling, ...] = ("sobol", "latin-hypercube")
MOST_SAMPLES, MOST_CELLS, MOST_INPUTS = 10_000_000, 10_000, 50
MOST_BYTES = 1_000_000
MOST_CASE = 2**31
"""Seeds of anatomies are below."""
PULL = ("tube", "at_mm", "pull_mm")
"""What a pull at an anatomy needs."""
TOP = {
    "title", "samples", "sampling", "indices", "seed", "duct", "bed", "anatomy", "inputs",
    "correlation",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Plan:
    """A plan with all that it needs, so that any process can carry it out."""

    text: str  # the file, as it was written
    title: str
    samples: int  # draws of the inputs that have distributions
    sampling: Sampling
    # whether each draw is repeated with each input taken from another one, for Sobol indices
    indices: bool
    seed: int
    fixed: Mapping[str, Value]
    drawn: Mapping[str, Distribution | Choices]
    grid: Mapping[str, tuple[Value, ...]]
    # contents of the organ and preset files that it names; anatomies and scripts as JSON
    files: Mapping[str, bytes]
    correlations: tuple[Correlation, ...] = ()  # of inputs that are drawn

    @property
    def varied(self) -> tuple[str, ...]:
        """Names of the inputs that are not the same in all rows."""
        return (*self.drawn, *self.grid)

    @property
    def cells(self) -> int:
        """Number of combinations of the grid's values."""
        return math.prod(len(values) for values in self.grid.values())

    @property
    def mixes(self) -> int:
        """Rows for a draw in each cell: 1, or inputs + 2 for Sobol indices (Saltelli's design)."""
        return len(self.drawn) + 2 if self.indices else 1

    @property
    def rows(self) -> int:
        """Number of ducts to be solved."""
        return self.samples * self.mixes * self.cells

    @property
    def has_bed(self) -> bool:
        """Whether ducts are lifted off a bed instead of being pulled free."""
        return any(name.startswith(BED) for name in (*self.fixed, *self.varied))

    @property
    def has_anatomy(self) -> bool:
        """Whether several tubes are put to a pull or a script instead of a duct."""
        return any(name.startswith(ANATOMY) for name in (*self.fixed, *self.varied))

    def values_of(self, name: str) -> tuple[Value, ...]:
        """Return the discrete values that an input takes, none if it has none."""
        drawn = self.drawn.get(name)
        if isinstance(drawn, Choices):
            return tuple(_value(each) for each in drawn.values)
        if name in self.grid:
            return self.grid[name]
        return (self.fixed[name],) if name in self.fixed else ()

    def organ(self, name: str) -> Organ:
        """Return an organ that the plan names."""
        return _organ(self.files[name], name)

    def preset(self, name: str) -> Preset:
        """Return a preset that the plan names."""
        return preset_named(name) if name in presets() else _preset(self.files[name], name)

    def anatomy(self, name: str | None, seed: int) -> Anatomy:
        """Return an anatomy that is named, its strands by a seed; the case of the seed for None."""
        if name is None:
            return drawn_anatomy(seed)
        if name in shipped_anatomies():
            found = anatomy_named(name)
        else:
            found = msgspec.json.decode(self.files[name], type=Anatomy)
        return msgspec.structs.replace(found, seed=seed)

    def script(self, name: str) -> Script:
        """Return a script that the plan names."""
        return msgspec.json.decode(self.files[name], type=Script)


@lru_cache(maxsize=64)
def _organ(content: bytes, name: str) -> Organ:
    return organ_from_bytes(content, name)


@lru_cache(maxsize=64)
def _preset(content: bytes, name: str) -> Preset:
    return read_preset(content, name)


class _Lines:
    """Errors of a plan's keys, with their lines."""

    def __init__(self, name: str, text: str) -> None:
        self.name, self._lines = name, TomlLines(text)

    def wrong(self, key: str, why: str) -> ValueError:
        """Return the error of a key, with its line or that of the table it is in."""
        line = self._lines.line_of(*key.split("."))
        place = "" if line is None else f", line {line}"
        return ValueError(f"{self.name}{place}: {key} {why}")


def read_plan(path: Path, *, files: bool = True) -> Plan:
    """Return the plan in a file; a `ValueError` names the key and the line that are wrong."""
    # Without `files`, those that it names are not read: it can be looked at, not carried out.
    content = read_bounded(path, MOST_BYTES, "plan")
    try:
        text = content.decode()
        table = with_present_keys(tomllib.loads(text))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ValueError(f"{path} is no TOML file: {error}") from None
    return _plan(table, text, _Lines(str(path), text), path.parent if files else None)


def _plan(table: dict[str, object], text: str, lines: _Lines, folder: Path | None) -> Plan:
    for key in table:
        if key not in TOP:
            raise lines.wrong(key, f"is not known; a plan has {', '.join(sorted(TOP))}")
    fixed: dict[str, Value] = {}
    for section, inputs, prefix in (
        ("duct", DUCT_INPUTS, ""),
        ("bed", BED_INPUTS, BED),
        ("anatomy", ANATOMY_INPUTS, ANATOMY),
    ):
        for key, value in _table(table.get(section, {}), section, lines).items():
            place = f"{section}.{key}"
            fixed[prefix + key] = _checked(inputs, prefix + key, value, place, lines)
    drawn: dict[str, Distribution | Choices] = {}
    grid: dict[str, tuple[Value, ...]] = {}
    for key, value in _varied(_table(table.get("inputs", {}), "inputs", lines), lines).items():
        place = f"inputs.{key}"
        if key not in INPUTS:
            raise lines.wrong(place, f"is no input; there are {', '.join(INPUTS)}")
        if key in fixed:
            raise lines.wrong(place, "is fixed as well; leave out one of them")
        one = _one_varied(INPUTS[key], value, place, lines)
        if isinstance(one, tuple):
            grid[key] = one
        else:
            drawn[key] = one
    sampling = table.get("sampling", "sobol")
    if sampling not in SAMPLINGS:
        raise lines.wrong("sampling", f"must be one of {', '.join(SAMPLINGS)}, got {sampling!r}")
    indices = table.get("indices", False)
    if not isinstance(indices, bool):
        raise lines.wrong("indices", f"must be true or false, got {indices!r}")
    title = table.get("title", "A study of ducts")
    if not isinstance(title, str) or len(title) > 200:
        raise lines.wrong("title", "must be a line of at most 200 characters in quotes")
    cases = any(name.startswith(ANATOMY) for name in (*fixed, *drawn, *grid))
    if (drawn or cases) and "samples" not in table:
        of = "anatomies" if cases else "the inputs"
        raise lines.wrong("samples", f"is missing: how many draws of {of}")
    plan = Plan(
        text=text,
        title=title,
        samples=_whole(table, "samples", 1, MOST_SAMPLES, lines) if drawn or cases else 1,
        sampling=sampling,
        indices=indices,
        seed=_whole(table, "seed", 0, 2**63, lines),
        fixed=fixed,
        drawn=drawn,
        grid=grid,
        files={},
        correlations=_correlations(table.get("correlation", []), drawn, lines),
    )
    if folder is not None:
        plan = replace(plan, files=_files(plan, folder, lines))
    _check_whole(plan, lines)
    if folder is not None:
        _check_files(plan, lines)
    return plan


def _table(value: object, key: str, lines: _Lines) -> dict[str, object]:
    if not isinstance(value, dict):
        raise lines.wrong(key, f"must be a table, [{key}], got {value!r}")
    return value


def _varied(table: dict[str, object], lines: _Lines) -> dict[str, object]:
    """Return the inputs by name: those of a bed and of an anatomy stand in tables of their own."""
    found = dict(table)
    for section in ("bed", "anatomy"):
        own = _table(found.pop(section, {}), f"inputs.{section}", lines)
        found |= {f"{section}.{key}": value for key, value in own.items()}
    return found


def _correlations(
    given: object, drawn: dict[str, Distribution | Choices], lines: _Lines
) -> tuple[Correlation, ...]:
    """Return the rank correlations of inputs with distributions."""
    if not isinstance(given, list) or not all(isinstance(each, dict) for each in given):
        raise lines.wrong("correlation", "must be tables, [[correlation]], with of and rank")
    found: list[Correlation] = []
    for each in given:
        if set(each) != {"of", "rank"}:
            raise lines.wrong("correlation", "must have of, two inputs, and rank, from -1 to 1")
        names, rank = each["of"], each["rank"]
        if not isinstance(names, list) or len(names) != 2 or names[0] == names[1]:
            raise lines.wrong("correlation.of", f"must be two different inputs, got {names!r}")
        for name in names:
            if not isinstance(drawn.get(str(name)), Distribution):
                raise lines.wrong("correlation.of", f"{name!r} is no input with a distribution")
        if isinstance(rank, bool) or not isinstance(rank, int | float) or not -1.0 < rank < 1.0:
            raise lines.wrong("correlation.rank", f"must lie between -1 and 1, got {rank!r}")
        pair = {str(name) for name in names}
        if any(pair == {before.one, before.other} for before in found):
            raise lines.wrong("correlation", f"has {names[0]} and {names[1]} twice")
        found.append(Correlation(str(names[0]), str(names[1]), float(rank)))
    try:
        copula_factor(list(drawn), found)
    except ValueError as error:
        raise lines.wrong("correlation", f"cannot be: {error}") from None
    return tuple(found)


def _whole(table: dict[str, object], key: str, low: int, high: int, lines: _Lines) -> int:
    value = table.get(key, max(low, 1))
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise lines.wrong(key, f"must be a whole number from {low:,} to {high:,}, got {value!r}")
    return value


def _value(value: object) -> Value:
    return value if isinstance(value, str) else float(value)  # pyright: ignore[reportArgumentType]


def _checked(
    inputs: dict[str, Input], name: str, value: object, place: str, lines: _Lines
) -> Value:
    if name not in inputs:
        known = ", ".join(each.rpartition(".")[2] for each in inputs)
        raise lines.wrong(place, f"is not known; there are {known}")
    try:
        inputs[name].check(value)
    except ValueError as error:
        raise lines.wrong(place, str(error)) from None
    return _value(value)


def _one_varied(
    kind: Input, given: object, place: str, lines: _Lines
) -> Distribution | Choices | tuple[Value, ...]:
    table = _table(given, place, lines)
    kinds = [name for name in ("distribution", "choices", "grid") if name in table]
    if len(kinds) != 1:
        raise lines.wrong(place, "must have one of distribution, choices and grid")
    if kinds[0] == "distribution":
        return _distribution(kind, table, place, lines)
    values = table[kinds[0]]
    extra = set(table) - {kinds[0], "weights" if kinds[0] == "choices" else kinds[0]}
    if extra:
        raise lines.wrong(f"{place}.{min(extra)}", f"does not go with {kinds[0]}")
    if not isinstance(values, list) or not values:
        raise lines.wrong(f"{place}.{kinds[0]}", "must be a list of one value or more")
    for each in values:
        try:
            kind.check(each)
        except ValueError as error:
            raise lines.wrong(f"{place}.{kinds[0]}", str(error)) from None
    found = tuple(_value(each) for each in values)
    if len(set(found)) < len(found):
        raise lines.wrong(f"{place}.{kinds[0]}", "has a value twice")
    if kinds[0] == "grid":
        return found
    weights = table.get("weights", [1.0] * len(found))
    if (
        not isinstance(weights, list)
        or len(weights) != len(found)
        or not all(isinstance(each, int | float) and each >= 0 for each in weights)
        or not sum(weights) > 0
    ):
        raise lines.wrong(f"{place}.weights", "must have one number, 0 or more, for each choice")
    return Choices(found, tuple(float(each) for each in weights))


def _distribution(kind: Input, table: dict[str, object], place: str, lines: _Lines) -> Distribution:
    if not kind.is_number or kind.whole:
        raise lines.wrong(place, "has no distribution, only choices or a grid")
    given: dict[str, float] = {}
    for key, value in table.items():
        if key == "distribution":
            continue
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise lines.wrong(f"{place}.{key}", f"must be a number, got {value!r}")
        given[key] = float(value)
    try:
        found = distribution_of(str(table["distribution"]), given)
    except ValueError as error:
        raise lines.wrong(place, f"is no distribution: {error}") from None
    import numpy as np

    least, most = found.at(np.array([0.0, 1.0])).tolist()
    if least < (kind.low or 0.0) or most > kind.high:
        unit = f" {kind.unit}" if kind.unit else ""
        raise lines.wrong(
            place,
            f"reaches from {least:.3g} to {most:.3g}{unit} and must stay from {kind.low:g} to "
            f"{kind.high:g}: cut it off by low and high",
        )
    return found


def _files(plan: Plan, folder: Path, lines: _Lines) -> dict[str, bytes]:
    """Read the organ and preset files that a plan names, from its own folder."""
    found: dict[str, bytes] = {}
    for name in ("preset", "organ"):
        place = _place(plan, name)
        for text in map(str, plan.values_of(name)):
            if name == "preset" and text in presets():
                continue
            if name == "preset" and not text.lower().endswith(".toml"):
                known = ", ".join(presets())
                raise lines.wrong(place, f"must be one of {known}, or a .toml file, got {text!r}")
            try:
                found[text] = (folder / text).read_bytes()
            except OSError as error:
                reason = (error.strerror or str(error)).lower()
                raise lines.wrong(place, f"cannot be read: {folder / text}: {reason}") from None
    for name, read in (("anatomy.name", read_anatomy), ("anatomy.script", read_script)):
        for text in map(str, plan.values_of(name)):
            if name == "anatomy.name" and text in shipped_anatomies():
                continue
            if name == "anatomy.name" and not text.lower().endswith(".toml"):
                known = ", ".join(shipped_anatomies())
                raise lines.wrong(
                    _place(plan, name), f"must be one of {known}, or a .toml file, got {text!r}"
                )
            try:
                found[text] = msgspec.json.encode(read(folder / text))
            except ValueError as error:
                raise lines.wrong(_place(plan, name), f"cannot be read: {error}") from None
    return found


def _check_whole(plan: Plan, lines: _Lines) -> None:
    """Raise where what is given does not go together."""
    given = {*plan.fixed, *plan.varied}

    def refuse(both: tuple[str, str], why: str) -> None:
        if given >= set(both):
            late = both[1] if both[1] not in plan.fixed else both[0]
            raise lines.wrong(_place(plan, late), f"goes not with {both[0]}, {both[1]}: {why}")

    if plan.has_anatomy:
        _check_anatomy(plan, given, lines)
    elif not plan.varied:
        raise lines.wrong("inputs", "is missing: nothing is varied")
    if len(plan.varied) > MOST_INPUTS:
        raise lines.wrong("inputs", f"has {len(plan.varied)} inputs, at most {MOST_INPUTS}")
    if plan.cells > MOST_CELLS:
        raise lines.wrong("inputs", f"has a grid of {plan.cells:,} cells, at most {MOST_CELLS:,}")
    if plan.indices and len(plan.drawn) < 2:
        raise lines.wrong("indices", "needs two inputs or more that are drawn")
    if plan.indices and plan.correlations:
        raise lines.wrong(
            "indices",
            "goes not with correlation: Sobol indices part a variance among inputs that are "
            "independent; leave out one of them",
        )
    refuse(("break_stress_MPa", "break_force_N"), "a strength is given by one of them")
    refuse(("force_N", "deflection_mm"), "a load is one of them")
    refuse(("grasp_mm", "grasp_fraction"), "a grasp is given by one of them")
    refuse(
        ("bed.toughness_J_per_m2", "bed.strength_kPa"), "toughness is strength times failure_mm / 2"
    )
    refuse(("bed.toughness_J_per_m2", "bed.stiffness_kPa_per_mm"), "give strength and stiffness")
    refuse(("bed.yield_mm", "bed.stiffness_kPa_per_mm"), "yield_mm is strength over stiffness")
    if "exponential" in plan.values_of("law") and "stiffening" not in given:
        raise lines.wrong(_place(plan, "law"), "exponential needs stiffening, its constant beta")
    if "organ" in given:
        refuse(("organ", "diameter_mm"), "an organ has its own sections")
    if plan.has_bed:
        for name in ("theory", "q", "force_N", "deflection_mm", "grasp_mm", "grasp_fraction"):
            if name in given:
                raise lines.wrong(
                    _place(plan, name),
                    "goes not with a bed: a duct in its bed is a beam in space with shear, "
                    "lifted by bed.hook_mm and bed.lift_mm",
                )
        if "bed.lift_mm" not in given:
            raise lines.wrong("bed.lift_mm", "is missing: how far the hook is lifted, mm")
        if "bed.hold_s" in given and "bed.step_s" not in given:
            raise lines.wrong("bed.hold_s", "goes with bed.step_s, the time that a step takes, s")


def _check_anatomy(plan: Plan, given: set[str], lines: _Lines) -> None:
    """Raise where what is given of an anatomy does not go together."""
    for name in sorted(given):
        if not name.startswith(ANATOMY):
            why = "goes not with [anatomy], whose tubes and layers have all of their own"
            raise lines.wrong(_place(plan, name), why)
    if plan.indices:
        raise lines.wrong(
            "indices", "goes not with [anatomy]: each draw is a case or has strands of its own"
        )
    pull = [name for name in PULL if ANATOMY + name in given]
    if ("anatomy.script" in given) == bool(pull) or len(pull) not in (0, len(PULL)):
        raise lines.wrong("anatomy", f"needs either script, or all of {', '.join(PULL)}")
    for name in ("azimuth_deg", "elevation_deg", "speed_mm_per_s"):
        if not pull and ANATOMY + name in given:
            raise lines.wrong(_place(plan, ANATOMY + name), "goes with a pull, not with a script")
    if plan.seed + plan.samples > MOST_CASE:
        raise lines.wrong("seed", f"and samples must be below {MOST_CASE:,} together")


def _check_files(plan: Plan, lines: _Lines) -> None:
    """Raise unless the presets and organs are such."""
    anatomies = [str(each) for each in plan.values_of("anatomy.name")]
    for tube in map(str, plan.values_of("anatomy.tube")):
        for name in anatomies or [None]:
            known = [each.name for each in plan.anatomy(name, plan.seed).tube]
            if tube not in known:
                of = f"there is no tube {tube!r} in {name or 'the first case'}"
                raise lines.wrong(_place(plan, "anatomy.tube"), f"{of}: {', '.join(known)}")
    for kind, found in (("preset", plan.preset), ("organ", plan.organ)):
        for name in plan.values_of(kind):
            try:
                found(str(name))
            except ValueError as error:
                raise lines.wrong(_place(plan, kind), str(error)) from None


def _place(plan: Plan, name: str) -> str:
    """Return the key of an input in the plan's file."""
    if name not in plan.fixed:
        return f"inputs.{name}"
    return name if name.startswith((BED, ANATOMY)) else f"duct.{name}"
