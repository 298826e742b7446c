"""Organ files give back what was written, and nothing else passes for one."""

import dataclasses
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from organ_geometry import organ_file
from organ_geometry.organ import Organ
from organ_geometry.organ_file import (
    OrganFileError,
    organ_bytes,
    organ_from_bytes,
    read_organ,
    stored_organ,
    write_organ,
)

Tube = Callable[..., Organ]

# float32 has 24 binary digits.
FLOAT32_SHARE = 2.0**-24
# Half a step of 2^-15 in each quaternion component, doubled by the angle and by the left-out one.
FRAME_STEP = 2.0**-13


def rotations(count: int, seed: int) -> NDArray[np.float64]:
    """Random rotation matrices, from QR factors."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(count, 3, 3)))
    q = q * np.sign(np.einsum("nii->ni", r))[:, np.newaxis, :]
    return q * np.sign(np.linalg.det(q))[:, np.newaxis, np.newaxis]


def wild_organ(seed: int, *, hollow: bool, turning: bool, mirrored: bool) -> Organ:
    rng = np.random.default_rng(seed)
    sections = int(rng.integers(2, 40))
    between = np.flatnonzero(rng.random(sections - 2) < 0.3) + 1
    keys = np.concatenate([[0], between, [sections - 1]])
    frames = rotations(sections if turning else 1, seed)
    if mirrored:
        frames = frames * [1.0, 1.0, -1.0]
    rows = rng.normal(size=(2, len(keys), 16))
    rows[:, :, 1] = rng.uniform(0.1, 5.0, (2, len(keys)))
    return Organ(
        axis=rng.normal(0.0, 1000.0, (sections, 3)),
        frames=np.broadcast_to(frames, (sections, 3, 3)),
        keys=keys,
        outer=rows[0],
        lumen=rows[1] if hollow else None,
        units="mm",
        tolerance_mm=0.123456789,
        name="Gallengang ∅",
    )


def assert_same(one: Organ, other: Organ) -> None:
    """Two organs are the same to the bit."""
    for field in dataclasses.fields(Organ):
        first, second = getattr(one, field.name), getattr(other, field.name)
        if isinstance(first, np.ndarray):
            assert first.dtype == second.dtype
            assert first.tobytes() == second.tobytes(), field.name
        else:
            assert first == second, field.name


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    hollow=st.booleans(),
    turning=st.booleans(),
    mirrored=st.booleans(),
)
def test_what_is_stored_is_near_and_storing_it_again_changes_nothing(
    seed: int, hollow: bool, turning: bool, mirrored: bool
) -> None:
    organ = wild_organ(seed, hollow=hollow, turning=turning, mirrored=mirrored)
    stored = stored_organ(organ)
    np.testing.assert_allclose(stored.axis, organ.axis, rtol=FLOAT32_SHARE)
    np.testing.assert_allclose(stored.outer, organ.outer, rtol=FLOAT32_SHARE, atol=1e-30)
    np.testing.assert_allclose(stored.frames, organ.frames, atol=FRAME_STEP)
    np.testing.assert_array_equal(stored.keys, organ.keys)
    assert stored.hollow == hollow
    assert stored.handedness == organ.handedness
    assert (stored.name, stored.units, stored.tolerance_mm) == ("Gallengang ∅", "mm", 0.123456789)
    assert_same(stored_organ(stored), stored)
    assert organ_bytes(stored) == organ_bytes(organ)


def test_the_file_gives_back_what_was_written(tmp_path: Path) -> None:
    organ = stored_organ(wild_organ(1, hollow=True, turning=True, mirrored=False))
    path = tmp_path / "duct.organ"
    size = write_organ(organ, path)
    assert_same(read_organ(path), organ)
    assert size == path.stat().st_size == len(organ_bytes(organ))
    write_organ(stored_organ(wild_organ(2, hollow=False, turning=True, mirrored=False)), path)
    assert not read_organ(path).hollow
    assert [file.name for file in tmp_path.iterdir()] == ["duct.organ"]


def test_frames_with_two_largest_components_are_stored_once_and_for_all(make_tube: Tube) -> None:
    # Which component is left out is here a matter of the last step, so rounding could change it.
    count = 5000
    rng = np.random.default_rng(8)
    quaternions = rng.normal(size=(count, 4))
    every, first = np.arange(count), np.abs(quaternions).argmax(axis=1)
    second = (first + rng.integers(1, 4, count)) % 4
    nearly = quaternions[every, first] * (1.0 + rng.uniform(-3e-5, 3e-5, count))
    quaternions[every, second] = nearly * rng.choice([-1.0, 1.0], count)
    w, *vector = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    xyz = np.stack(vector, axis=1)
    turned = [
        axis + 2.0 * np.cross(xyz, np.cross(xyz, axis) + w[:, np.newaxis] * axis)
        for axis in np.eye(3)
    ]
    axis = np.zeros((count, 3))
    axis[:, 0] = np.arange(count)
    organ = dataclasses.replace(
        make_tube([1.0, 1.0]), axis=axis, keys=np.array([0, count - 1]), frames=np.stack(turned, 2)
    )
    stored = stored_organ(organ)
    np.testing.assert_allclose(stored.frames, organ.frames, atol=2 * FRAME_STEP)
    assert_same(stored_organ(stored), stored)


# All components of the quaternion are equally large, or two of them: which one is left out is then
# a matter of the last digit.
@pytest.mark.parametrize("mirrored", [False, True])
def test_frames_along_the_axes_of_space_stay_exact(make_tube: Tube, mirrored: bool) -> None:
    organ = make_tube([1.0, 1.0])
    eye = np.eye(3)
    for order in ([0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1]):
        for signs in ([1, 1], [1, -1], [-1, 1], [-1, -1]):
            frame = eye[:, order] * [*signs, 1.0]
            if mirrored:
                frame = frame * [1.0, 1.0, -1.0]
            one = dataclasses.replace(organ, frames=np.stack([frame, frame]))
            stored = stored_organ(one)
            # sqrt(1/2) is no whole number of steps.
            np.testing.assert_allclose(stored.frames, one.frames, atol=FRAME_STEP)
            assert_same(stored_organ(stored), stored)
    stacked = make_tube([1.0, 1.0])
    np.testing.assert_array_equal(stored_organ(stacked).frames, stacked.frames)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(OrganFileError, match=r"cannot read .*duct.organ: No such file"):
        read_organ(tmp_path / "duct.organ")
    with pytest.raises(OrganFileError, match="cannot read"):
        read_organ(tmp_path)


def test_truncated_at_every_byte() -> None:
    data = organ_bytes(wild_organ(3, hollow=True, turning=True, mirrored=True))
    for length in range(len(data)):
        with pytest.raises(OrganFileError, match=r"truncated|not an organ file"):
            organ_from_bytes(data[:length])
    with pytest.raises(OrganFileError, match="damaged"):
        organ_from_bytes(data + b"\0")


WILD = organ_bytes(wild_organ(4, hollow=True, turning=True, mirrored=False))


@settings(deadline=None, max_examples=300)
@given(flips=st.sets(st.integers(0, 8 * len(WILD) - 1), min_size=1, max_size=8))
def test_flipped_bits(flips: set[int]) -> None:
    data = bytearray(WILD)
    for flip in flips:
        data[flip // 8] ^= 1 << flip % 8
    with pytest.raises(OrganFileError) as error:
        organ_from_bytes(bytes(data))
    assert "\n" not in str(error.value)


@settings(deadline=None)
@given(data=st.binary(max_size=200))
def test_foreign_bytes(data: bytes) -> None:
    with pytest.raises(OrganFileError):
        organ_from_bytes(data)
    with pytest.raises(OrganFileError):
        organ_from_bytes(WILD[:10] + data)


def test_a_newer_version_is_named(tmp_path: Path) -> None:
    path = tmp_path / "duct.organ"
    path.write_bytes(WILD[:8] + struct.pack("<H", organ_file.VERSION + 1) + WILD[10:])
    with pytest.raises(OrganFileError, match=r"duct.organ: organ file of version 2; .* version 1"):
        read_organ(path)


def sealed(packed: bytes, length: int) -> bytes:
    """A file whose checksum fits, whatever is in it."""
    start = WILD[:10]
    lengths = struct.pack("<II", len(packed), length)
    checksum = zlib.crc32(packed, zlib.crc32(lengths, zlib.crc32(start)))
    return start + struct.pack("<I", checksum) + lengths + packed


def sealed_fields(**changes: object) -> bytes:
    """The sample file with some fields changed and a checksum that fits."""
    content = zstandard.ZstdDecompressor().decompress(WILD[22:])
    names = organ_file._Content.__struct_fields__
    fields = dict(zip(names, msgspec.msgpack.decode(content), strict=True)) | changes
    content = msgspec.msgpack.encode(list(fields.values()))
    return sealed(zstandard.compress(content), len(content))


def test_the_forger_itself_makes_files_that_are_read() -> None:
    assert_same(organ_from_bytes(sealed_fields()), organ_from_bytes(WILD))
    assert organ_from_bytes(sealed_fields(name="other")).name == "other"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sections": 2**40}, r"has 1099511627776 sections; 2 to 65535"),
        ({"sections": -1}, "has -1 sections"),
        ({"sections": 1}, "has 1 sections"),
        ({"key_count": 10**9}, "has 1000000000 key sections"),
        ({"key_count": -5}, "has -5 key sections"),
        ({"frame_count": 3}, "has 3 frames for"),
        ({"frame_count": 10**12}, "has 1000000000000 frames"),
        ({"axis": b""}, "axis take 0 bytes"),
        ({"axis": b"\0"}, "axis take 1 bytes"),
        ({"rotation_largest": b"\7" * 3}, "frames take 3 bytes"),
        ({"outer": None}, "damaged: Expected `bytes`, got `None`"),
        ({"name": 5}, "damaged: Expected `str`, got `int`"),
        ({"tolerance_mm": float("nan")}, "does not hold an organ: tolerance_mm must be"),
        ({"extra": 1}, "damaged: "),
    ],
)
def test_forged_counts_and_fields(changes: dict[str, object], message: str) -> None:
    with pytest.raises(OrganFileError, match=message):
        organ_from_bytes(sealed_fields(**changes))


def test_forged_numbers() -> None:
    sections = len(organ_from_bytes(WILD).axis)
    nothing = b"\0" * (12 * sections)
    with pytest.raises(OrganFileError, match=r"does not hold an organ: .* axis must be apart"):
        organ_from_bytes(sealed_fields(axis=nothing))
    not_finite = organ_file._packed(np.full((sections, 3), np.nan, dtype="<f4"))
    with pytest.raises(OrganFileError, match="does not hold an organ: axis must be finite"):
        organ_from_bytes(sealed_fields(axis=not_finite))
    steps = organ_file._packed(np.full((sections, 3), 32767, dtype="<i2"))
    with pytest.raises(OrganFileError, match="a frame is no rotation"):
        organ_from_bytes(sealed_fields(rotation_steps=steps))
    with pytest.raises(OrganFileError, match="a frame is no rotation"):
        organ_from_bytes(sealed_fields(rotation_largest=b"\x04" + b"\0" * (sections - 1)))


def test_a_bomb_is_not_unpacked() -> None:
    bomb = zstandard.compress(b"\0" * (64 * 2**20))
    assert len(bomb) < 10_000
    with pytest.raises(OrganFileError, match="claims 67108864 bytes of content"):
        organ_from_bytes(sealed(bomb, 64 * 2**20))
    with pytest.raises(OrganFileError, match="the content's size does not fit"):
        organ_from_bytes(sealed(bomb, 1000))
    # A frame that does not say its size could become any size.
    silent = zstandard.ZstdCompressor(write_content_size=False).compress(b"\0" * 1000)
    with pytest.raises(OrganFileError, match="the content's size does not fit"):
        organ_from_bytes(sealed(silent, 1000))


def test_a_huge_file_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "huge.organ"
    with path.open("wb") as file:
        file.write(WILD)
        file.truncate(2**34)
    with pytest.raises(OrganFileError, match="larger than an organ file may be"):
        read_organ(path)


def test_what_cannot_be_stored_is_refused(make_tube: Tube) -> None:
    organ = make_tube([1.0, 1.0])
    with pytest.raises(OrganFileError, match="lengths up to 3e38 mm"):
        organ_bytes(dataclasses.replace(organ, axis=np.array([[0, 0, 0], [1e40, 0, 0]])))
    count = organ_file.MOST_SECTIONS + 1
    axis = np.zeros((count, 3))
    axis[:, 0] = np.arange(count)
    many = dataclasses.replace(
        organ,
        axis=axis,
        frames=np.broadcast_to(organ.frames[0], (count, 3, 3)),
        keys=np.array([0, count - 1]),
    )
    with pytest.raises(OrganFileError, match="holds up to 65535 sections, not 65536"):
        organ_bytes(many)
