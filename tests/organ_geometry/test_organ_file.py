"""Organ files give back what was written, and nothing else passes for one."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from any_code import any_code
from contours import bent_tube, cylinder
from hypothesis import given, settings
from hypothesis import strategies as st
from organ_decoder import crc16, decode

from organ_geometry.encoder.encode import encoded_organ
from organ_geometry.organ import Organ
from organ_geometry.organ_file import (
    LARGEST_FILE_BYTES,
    OrganFileError,
    code_bytes,
    code_from_bytes,
    organ_from_bytes,
    read_organ,
    write_organ,
)
from organ_geometry.organ_file.coefficients import signals_to_rows
from organ_geometry.organ_file.organ_code import OrganCode
from organ_geometry.organ_file.symbol_coder import SymbolReader, SymbolWriter

# Sums of a few hundred products; the spline's length is a sum of a thousand chords.
ROUNDING = 1e-9


def assert_same(one: Organ | OrganCode, other: Organ | OrganCode) -> None:
    """Two organs are the same to the bit."""
    for field in dataclasses.fields(one):
        first, second = getattr(one, field.name), getattr(other, field.name)
        if isinstance(first, np.ndarray):
            assert first.dtype == second.dtype
            assert first.tobytes() == second.tobytes(), field.name
        else:
            assert first == second, field.name


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), hollow=st.booleans())
def test_numbers_come_back(seed: int, hollow: bool) -> None:
    code = any_code(seed, hollow=hollow)
    assert_same(code_from_bytes(code_bytes(code)), code)


@pytest.mark.slow
@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), hollow=st.booleans())
def test_a_reader_made_from_the_document_alone_gives_the_same_organ(
    seed: int, hollow: bool
) -> None:
    data = code_bytes(any_code(seed, hollow=hollow))
    organ, other = organ_from_bytes(data), decode(data)
    size = np.abs(organ.axis).max()
    np.testing.assert_allclose(other.points, organ.axis, atol=ROUNDING * size)
    np.testing.assert_allclose(other.frames, organ.frames, atol=1e-6)
    np.testing.assert_array_equal(
        np.array(other.keys) * ((len(organ.axis) - 1) // other.pieces), organ.keys
    )
    np.testing.assert_allclose(signals_to_rows(other.outer), organ.outer, atol=ROUNDING)
    everywhere = organ.rows_at(organ.stations)
    np.testing.assert_allclose(
        signals_to_rows(other.everywhere(other.outer)), everywhere, atol=ROUNDING
    )
    assert (other.units, other.tolerance) == (organ.units, organ.tolerance_mm)
    if hollow:
        assert other.lumen is not None
        assert organ.lumen is not None
        np.testing.assert_allclose(signals_to_rows(other.lumen), organ.lumen, atol=ROUNDING)
    # The two curves at a key section, by the definition of the polynomials.
    u = np.linspace(-0.99, 0.99, 9)
    x, bottom, top = other.outline(other.outer[0], u)
    first, station = organ.axis[0], np.zeros(9)
    for y, sign in ((bottom, 1.0), (top, -1.0)):
        angles = sign * np.arccos(u)
        expected = first + np.outer(x, organ.frames[0, :, 0]) + np.outer(y, organ.frames[0, :, 1])
        np.testing.assert_allclose(organ.surface(station, angles), expected, atol=ROUNDING * size)


@pytest.mark.slow
def test_the_file_gives_back_what_was_written(tmp_path: Path) -> None:
    organ = encoded_organ(bent_tube(lumen=0.6), 0.08, hollow=True).organ
    path = tmp_path / "duct.organ"
    size = write_organ(organ, path)
    assert_same(read_organ(path), dataclasses.replace(organ, name="duct"))
    assert size == path.stat().st_size == len(organ.encoded)
    other = encoded_organ(cylinder(), 0.05).organ
    write_organ(other, path)
    assert not read_organ(path).hollow
    assert [file.name for file in tmp_path.iterdir()] == ["duct.organ"]


def test_an_organ_that_was_changed_or_never_built_is_not_written(tmp_path: Path) -> None:
    organ = encoded_organ(cylinder(), 0.05).organ
    longer = dataclasses.replace(organ, axis=organ.axis * 1.1)
    with pytest.raises(OrganFileError, match="the organ's axis is not what was built"):
        write_organ(longer, tmp_path / "duct.organ")
    with pytest.raises(OrganFileError, match="only an organ that was built from images"):
        write_organ(dataclasses.replace(organ, encoded=b""), tmp_path / "duct.organ")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_every_truncation_is_refused() -> None:
    data = encoded_organ(bent_tube(), 0.05).organ.encoded
    for length in range(len(data)):
        with pytest.raises(OrganFileError, match=r"truncated|not an organ file"):
            organ_from_bytes(data[:length])
    for more in (b"\0", b"\1", b"\0" * 9):
        with pytest.raises(OrganFileError, match="truncated or damaged"):
            organ_from_bytes(data + more)


@pytest.mark.slow
def test_every_flipped_bit_is_refused() -> None:
    data = encoded_organ(bent_tube(), 0.05).organ.encoded
    for place in range(8 * len(data)):
        flipped = bytearray(data)
        flipped[place // 8] ^= 1 << place % 8
        with pytest.raises(OrganFileError):
            organ_from_bytes(bytes(flipped))


def signed(packed: bytes) -> bytes:
    """Packed numbers in a file whose checksum fits."""
    start = b"\x89\xe3"
    return start + crc16(start + packed).to_bytes(2, "big") + packed


@pytest.mark.slow
@settings(deadline=None, max_examples=300)
@given(packed=st.binary(max_size=200))
def test_no_bytes_do_more_than_be_refused(packed: bytes) -> None:
    try:
        organ = organ_from_bytes(signed(packed))
    except OrganFileError:
        return
    assert organ.encoded == signed(packed)


def test_no_bytes_make_an_organ_of_many_sections_from_nothing() -> None:
    # Depths above the limit, and an axis of no length.
    for wrong, message in (
        ({"candidates": 2**13}, "out of its range"),
        ({"start_axis": 3}, "out of its range"),
        ({"ends": np.zeros((2, 3), dtype=np.int64)}, "ends of the axis must be apart"),
        ({"outer": np.zeros((2, 16), dtype=np.int64), "keys": np.array([0, 128])}, "half width"),
    ):
        code = dataclasses.replace(any_code(3, hollow=False), **wrong)
        if "outer" in wrong:
            code = dataclasses.replace(code, candidates=128)
        if "candidates" in wrong:
            code = dataclasses.replace(
                code, keys=np.array([0, 2**13]), outer=np.ones((2, 16), dtype=np.int64)
            )
        with pytest.raises(OrganFileError, match=message):
            organ_from_bytes(code_bytes(code))
    with pytest.raises(OrganFileError, match="larger than an organ file may be"):
        organ_from_bytes(b"\x89\xe3" + bytes(LARGEST_FILE_BYTES))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not an organ file"),
        (b"PK\x03\x04 not an organ", "not an organ file"),
        (b"\x89\xe3\x00", "truncated: 3 bytes, the header alone has 4"),
        (b"\x89organ\r\n\x01\x00rest", "of version 1; this program reads version 3: build it"),
        (b"\x89o\x02\x00rest", "of version 2; this program reads version 3: build it"),
        (b"\x89\xe4rest", "organ file of version 4; this program reads version 3"),
    ],
)
def test_foreign_and_other_versions_are_named(data: bytes, message: str, tmp_path: Path) -> None:
    with pytest.raises(OrganFileError, match=message):
        organ_from_bytes(data)
    path = tmp_path / "duct.organ"
    path.write_bytes(data)
    with pytest.raises(OrganFileError, match=f"duct.organ: .*{message}"):
        read_organ(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(OrganFileError, match=r"cannot read .*missing\.organ: No such file"):
        read_organ(tmp_path / "missing.organ")


@settings(deadline=None, max_examples=100)
@given(st.lists(st.integers(-(2**31) + 1, 2**31 - 1) | st.integers(-3, 3), max_size=60))
def test_whole_numbers_come_back_from_as_few_bytes_as_there_are(numbers: list[int]) -> None:
    writer = SymbolWriter()
    for number in numbers:
        writer.integer("any", "size", number)
    data = writer.as_bytes()
    reader = SymbolReader(data)
    assert [reader.integer("any", "size", 0) for _ in numbers] == numbers
    assert not data.endswith(b"\0")


def test_bits_cost_what_their_odds_say() -> None:
    # 2000 bits of which one in ten is 1: 0.469 bits each, and little to learn that.
    rng = np.random.default_rng(1)
    writer = SymbolWriter()
    for bit in rng.random(2000) < 0.1:
        writer.bit("often no", int(bit))
    assert len(writer.as_bytes()) < 1.05 * 2000 * 0.469 / 8


@pytest.mark.slow
@pytest.mark.parametrize(
    ("radius", "scale", "output"),
    [
        (2.5, 174.0, "is 10,... mm long and the most is 10,000 mm"),
        (60.0, 18.0, r"reaches 1,[01].. mm from its axis and the most is 1,000 mm"),
    ],
)
def test_an_organ_of_a_size_that_none_has_is_refused(
    radius: float, scale: float, output: str
) -> None:
    def built(size: float) -> Organ:
        tube = [
            dataclasses.replace(each, outer=size * each.outer) for each in cylinder(radius=radius)
        ]
        return encoded_organ(tube, 0.02 * size * radius).organ

    with pytest.raises(OrganFileError, match=output):
        built(scale)
    assert built(0.9 * scale).length == pytest.approx(0.9 * scale * 60.0, rel=0.02)
