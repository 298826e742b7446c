"""The organ file: an organ in few bytes, checked when it is read (docs/organ-format.md).

Four bytes, magic, version and CRC-16, and then the integers of an `OrganCode` through the binary
arithmetic coder (`symbol_coder`), in the order of `_pass_code`: header, axis, key places, outer
boundary, lumen. `_pass_code` and the functions that it calls both write and read: a writer codes
what it is passed, a reader ignores that and returns what it decodes, so the two cannot disagree.

What the names in them mean:

    flag      a bit that is rarely 1; it begins with counts (14, 2), odds of one in eight
    escaped   a number that mostly lies in a short range: a flag, the escape, says whether it does
              not; then it follows in few bits from the range's first on, or in more bits from 0
    uniform   bits at even odds (`symbol_coder`)
    integer   a signed integer with odds learned in contexts (`symbol_coder`)
    kind      group of coefficients that share odds: a, e, and s_k, d_k by their order
    start     counts of zeros and ones that a context begins with
    level     generation of a key in bisection order (`key_order`)

All start values are part of the format and may not change without another version. A file is
canonical: a reader encodes what it has read and refuses data that are not those bytes.
"""

import binascii
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from organ_geometry.atomic_file import write_atomic
from organ_geometry.curves.axis_curve import key_depth, key_levels
from organ_geometry.organ import Organ
from organ_geometry.organ_file.coefficients import SIGNALS, WIDTH
from organ_geometry.organ_file.key_order import known_order
from organ_geometry.organ_file.organ_code import (
    LARGEST_KEY_DEPTH,
    OrganCode,
)
from organ_geometry.organ_file.symbol_coder import (
    EVEN_START,
    SymbolError,
    SymbolReader,
    SymbolWriter,
)

# Not ASCII, as of PNG: no text file begins with it.
MAGIC = 0x89
FILE_VERSION = 3
# The second byte's high half; its low half is the version.
_VERSION_MARK = 0xE0
# Organs have hundreds of bytes; files beyond a MiB are refused unread.
LARGEST_FILE_BYTES = 2**20
# Bytes of a unit's name: four bits say how many.
LONGEST_UNITS = 15
# Length of an organ, mm: the gut has seven metres; more is a slip of the unit.
LONGEST_MM = 10_000.0
# How far its surface is from its axis at most, mm.
WIDEST_MM = 1_000.0

# How files of versions 1 and 2 began.
_FIRST_MAGICS = (b"\x89organ\r\n", b"\x89o\x02")
_START = bytes([MAGIC, _VERSION_MARK | FILE_VERSION])
_HEADER_BYTES = len(_START) + 2


class OrganFileError(ValueError):
    """An organ file that cannot be read or written, with one line saying what is wrong."""


def write_organ(organ: Organ, path: Path) -> int:
    """Write an organ to a file, complete or not at all, and return its size in bytes."""
    if not organ.encoded:
        raise OrganFileError("only an organ that was built from images can be written")
    stored = organ_from_bytes(organ.encoded)
    for field in ("axis", "frames", "keys", "outer", "lumen"):
        if not np.array_equal(getattr(stored, field), getattr(organ, field)):
            raise OrganFileError(f"the organ's {field} is not what was built: build it again")
    write_atomic(Path(path), organ.encoded)
    return len(organ.encoded)


def read_organ(path: Path) -> Organ:
    """Return the organ of a file, called what the file is."""
    source = Path(path)
    try:
        with source.open("rb") as file:
            data = file.read(LARGEST_FILE_BYTES + 1)
    except OSError as error:
        raise OrganFileError(f"cannot read {source}: {error.strerror or error}") from error
    try:
        return organ_from_bytes(data, name=source.stem)
    except OrganFileError as error:
        raise OrganFileError(f"{source}: {error}") from error


def organ_from_bytes(data: bytes, name: str = "") -> Organ:
    """Return the organ of a file's content."""
    code = code_from_bytes(data)
    try:
        organ = code.organ(name, data)
    except ValueError as error:
        raise OrganFileError(f"does not hold an organ: {error}") from error
    _check_size(organ)
    return organ


def _check_size(organ: Organ) -> None:
    """Refuse an organ of a size that no organ has: meshes of it would fill the memory."""
    for what, size, most in (
        ("is {:,.0f} mm long", organ.length, LONGEST_MM),
        ("reaches {:,.0f} mm from its axis", organ.largest_radius, WIDEST_MM),
    ):
        if not size <= most:
            raise OrganFileError(
                f"the organ {what.format(size)} and the most is {most:,.0f} mm: are the sizes of "
                f"its images in mm?"
            )


def code_bytes(code: OrganCode) -> bytes:
    """Return the content of the file of an organ in integers."""
    writer = SymbolWriter()
    try:
        _pass_code(writer, code)
    except SymbolError as error:
        raise OrganFileError(f"an organ file cannot hold this organ: {error}") from error
    packed = writer.as_bytes()
    return _START + _checksum(packed) + packed


def code_from_bytes(data: bytes) -> OrganCode:
    """Return the integers of a file's content."""
    if len(data) > LARGEST_FILE_BYTES:
        raise OrganFileError(f"larger than an organ file may be, {LARGEST_FILE_BYTES} bytes")
    for number, magic in enumerate(_FIRST_MAGICS, start=1):
        if len(data) > 2 and magic[: len(data)] == data[: len(magic)]:
            raise OrganFileError(
                f"organ file of version {number}; this program reads version {FILE_VERSION}: "
                "build it again from its images"
            )
    if not data or data[0] != MAGIC or (len(data) > 1 and data[1] & 0xF0 != _VERSION_MARK):
        raise OrganFileError("not an organ file")
    if len(data) < _HEADER_BYTES:
        raise OrganFileError(f"truncated: {len(data)} bytes, the header alone has {_HEADER_BYTES}")
    version = data[1] & 0x0F
    if version != FILE_VERSION:
        raise OrganFileError(
            f"organ file of version {version}; this program reads version {FILE_VERSION}"
        )
    packed = data[_HEADER_BYTES:]
    if _checksum(packed) != data[len(_START) : _HEADER_BYTES]:
        raise OrganFileError("truncated or damaged: the checksum does not fit")
    try:
        code = _pass_code(SymbolReader(packed), None)
        again = code_bytes(code)
    except SymbolError as error:
        raise OrganFileError(f"damaged: {error}") from error
    # Sixteen bits of checksum let one damage in 65,536 pass. Hardly any of those is what a writer
    # would make of the numbers read.
    if again != data:
        raise OrganFileError("truncated or damaged: its numbers are not written like this")
    return code


def _checksum(packed: bytes) -> bytes:
    return binascii.crc_hqx(packed, binascii.crc_hqx(_START, 0xFFFF)).to_bytes(2, "big")


def _pass_code(numbers: SymbolWriter | SymbolReader, given: OrganCode | None) -> OrganCode:
    """Write an organ's integers, or read them if none are given."""
    # A reader ignores what it is passed, so that one order of numbers serves both ways.
    code = _BLANK if given is None else given
    hollow = _pass_flag(numbers, "hollow", code.lumen is not None)
    left_handed = _pass_flag(numbers, "left-handed", code.left_handed)
    units = _pass_units(numbers, code.units)
    tolerance = numbers.uniform(code.tolerance, 12)
    axis_scale = _pass_escaped(numbers, "scale", code.axis_scale, _SHORT_SCALES)
    start_axis = numbers.uniform(code.start_axis, 2)
    roll = numbers.uniform(code.roll, 8)
    turn = numbers.uniform(code.turn, 5) if _pass_flag(numbers, "turned", code.turn != 0) else 0
    tilt_scale = numbers.uniform(code.tilt_scale, 2)
    tilts = np.array(
        [[numbers.integer(("tilt",), ("tilt",), int(lean)) for lean in end] for end in code.tilts]
    )
    ends = np.stack([_pass_point(numbers, point) for point in code.ends])
    axis_depth = numbers.uniform(key_depth(len(code.bends)), 3)
    bends = code.bends if given else np.zeros((2**axis_depth + 1, 3), dtype=np.int64)
    bends = _pass_bends(numbers, bends, axis_depth)
    section_scale = _pass_escaped(numbers, "scale", code.section_scale, _SHORT_SCALES)
    depth = numbers.uniform(code.candidates.bit_length() - 1, 4)
    if depth > LARGEST_KEY_DEPTH or start_axis > 2:
        raise SymbolError("a number is out of its range")
    keys = _pass_keys(numbers, code.keys, 2**depth)
    blank = np.zeros((len(keys), SIGNALS), dtype=np.int64)
    outer = _pass_signals(numbers, keys, code.outer if given else blank, "outer")
    lumen = None
    if hollow:
        lumen = _pass_signals(numbers, keys, blank if code.lumen is None else code.lumen, "lumen")
    return OrganCode(
        units=units,
        left_handed=left_handed,
        tolerance=tolerance,
        axis_scale=axis_scale,
        start_axis=start_axis,
        roll=roll,
        turn=turn,
        tilt_scale=tilt_scale,
        tilts=tilts,
        ends=ends,
        bends=bends,
        section_scale=section_scale,
        candidates=2**depth,
        keys=keys,
        outer=outer,
        lumen=lumen,
    )


def _pass_flag(numbers: SymbolWriter | SymbolReader, name: str, flag: bool) -> bool:
    return bool(numbers.bit(((name,),), int(flag), _RARE))


def _pass_escaped(
    numbers: SymbolWriter | SymbolReader, name: str, number: int, short: tuple[int, int, int]
) -> int:
    """Pass a number that is mostly in a range [first, first + 2^few), otherwise in more bits."""
    first, few, more = short
    if _pass_flag(numbers, name, not first <= number < first + 2**few):
        return numbers.uniform(number, more)
    return first + numbers.uniform(number - first, few)


def _pass_units(numbers: SymbolWriter | SymbolReader, units: str) -> str:
    """Pass the name of the unit of length: mm, or a word of up to fifteen bytes."""
    if not _pass_flag(numbers, "units", units != "mm"):
        return "mm"
    letters = units.encode()
    if len(letters) > LONGEST_UNITS:
        raise SymbolError(f"units of more than {LONGEST_UNITS} bytes")
    count = numbers.uniform(len(letters), 4)
    word = bytes(numbers.uniform(letters[i] if i < len(letters) else 0, 8) for i in range(count))
    try:
        return word.decode()
    except UnicodeDecodeError as error:
        raise SymbolError("its units are no text") from error


def _pass_point(
    numbers: SymbolWriter | SymbolReader, point: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Pass three numbers in as many bits each as the largest needs."""
    width = max(int(abs(number)).bit_length() for number in point)
    if width >= 2 ** _SHORT_WIDTHS[2]:
        raise SymbolError("the axis ends too far away for its step")
    bits = _pass_escaped(numbers, "width", width, _SHORT_WIDTHS)
    return np.array([numbers.uniform_signed(int(number), bits) for number in point], dtype=np.int64)


def _pass_bends(
    numbers: SymbolWriter | SymbolReader, bends: NDArray[np.int64], depth: int
) -> NDArray[np.int64]:
    """Pass the axis's bends, coarse levels first: those are the largest and learn apart."""
    passed = np.zeros_like(bends)
    levels = key_levels(depth)
    for level in range(1, depth + 1):
        for key in np.flatnonzero(levels == level):
            for direction in range(3):
                across, row = int(direction > 0), min(level, 4)
                passed[key, direction] = numbers.integer(
                    (("bend", across, row),),
                    (("bend", row),),
                    int(bends[key, direction]),
                    BEND_STARTS[across][row - 1],
                    BEND_RUN_STARTS[row - 1],
                )
    return passed


def _pass_keys(
    numbers: SymbolWriter | SymbolReader, keys: NDArray[np.intp], candidates: int
) -> NDArray[np.intp]:
    """Pass which candidates are key sections."""
    kept = np.zeros(candidates + 1, dtype=np.bool_)
    kept[keys[keys <= candidates]] = True
    kept[[0, -1]] = True
    before = 1
    for place in range(1, candidates):
        before = numbers.bit((("key", before),), int(kept[place]))
        kept[place] = bool(before)
    return np.flatnonzero(kept)


def _pass_signals(
    numbers: SymbolWriter | SymbolReader,
    keys: NDArray[np.intp],
    stored: NDArray[np.int64],
    wall: str,
) -> NDArray[np.int64]:
    """Pass the stored differences of one boundary's shape coefficients, key by key."""
    # Whether one is zero is learned in two contexts together: that of this very coefficient of this
    # wall, and that of its kind at its level. Sizes are learned by level and by kind. The first key
    # is stored whole, not as a difference, and has contexts of its own.
    passed = np.zeros_like(stored)
    last = len(stored) - 1
    inner = ((key, level) for key, _, _, level in known_order(keys))
    for key, level in ((0, 0), (last, 1), *inner):
        for signal in range(SIGNALS):
            kind = KINDS[signal]
            number = int(stored[key, signal])
            if key == 0:
                width = signal == WIDTH
                passed[key, signal] = numbers.integer(
                    (("first", kind),),
                    (("first", width),),
                    number,
                    FIRST_STARTS[kind],
                    WIDTH_RUN_START if width else EVEN_START,
                )
                continue
            passed[key, signal] = numbers.integer(
                ((wall, signal), ("kind", kind, min(level, 4))),
                (("size", min(level, 3)), ("size of", kind)),
                number,
                KIND_STARTS[kind],
            )
    return passed


KINDS = (0, 1, 2, 3, 4, 5, 5, 6, 6, 2, 3, 4, 5, 5, 6, 6)
"""Kind of each coefficient: a, e, then s_0 to s_6 and d_0 to d_6 by their order."""
# Counts of zeros and others that a kind's odds begin with: high orders are mostly zero.
KIND_STARTS = ((2, 2), (2, 2), (2, 3), (3, 2), (4, 2), (6, 1), (10, 1))
FIRST_STARTS = ((1, 5), (2, 2), (2, 3), (2, 2), (3, 2), (5, 2), (9, 1))
"""The same for the first key section, whose width is hardly ever zero."""
# Counts of zeros and ones that the odds of the first width's size begin with.
WIDTH_RUN_START = (1, 5)
BEND_STARTS = (((2, 4), (2, 3), (3, 2), (5, 2)), ((1, 5), (1, 6), (1, 4), (3, 2)))
"""Counts of zeros and others of the axis's bends, along and across, by level."""
# Counts of zeros and ones of their sizes, by level.
BEND_RUN_STARTS = ((1, 4), (1, 4), (2, 3), (3, 2))
# Counts of zeros and ones that a rare flag begins with: unset takes 0.19 bits, set takes 3.
_RARE = (14, 2)
# (first, bits in the range, bits of any). Scales 44 to 59 are steps of 1/8 to 1.75 tolerances;
# widths 7 to 14 are axes of up to 128 to 16,384 steps.
_SHORT_SCALES, _SHORT_WIDTHS = (44, 4, 6), (7, 3, 5)
_BLANK = OrganCode(
    units="mm",
    left_handed=False,
    tolerance=0,
    axis_scale=0,
    start_axis=0,
    roll=0,
    turn=0,
    tilt_scale=0,
    tilts=np.zeros((2, 2), dtype=np.int64),
    ends=np.zeros((2, 3), dtype=np.int64),
    bends=np.zeros((2, 3), dtype=np.int64),
    section_scale=0,
    candidates=1,
    keys=np.array([0, 1]),
    outer=np.zeros((2, SIGNALS), dtype=np.int64),
    lumen=None,
)
