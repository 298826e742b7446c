"""A second reader of organ files, written from docs/organ-format.md and from nothing else."""

import math
from dataclasses import dataclass
from typing import Any

import constriction
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline

# The library's own stubs leave its submodules out.
STREAM: Any = vars(constriction)["stream"]
HALF_CIRCLE = np.array([0.8551, 0.0, -0.1680, 0.0, -0.0235, 0.0, -0.0079])

KINDS = (0, 1, 2, 3, 4, 5, 5, 6, 6, 2, 3, 4, 5, 5, 6, 6)
STARTS = ((2, 2), (2, 2), (2, 3), (3, 2), (4, 2), (6, 1), (10, 1))
FIRST_STARTS = ((1, 5), (2, 2), (2, 3), (2, 2), (3, 2), (5, 2), (9, 1))
BEND_STARTS = [[(2, 4), (2, 3), (3, 2), (5, 2)], [(1, 5), (1, 6), (1, 4), (3, 2)]]
BEND_RUNS = [(1, 4), (1, 4), (2, 3), (3, 2)]


def crc16(data: bytes) -> int:
    register = 0xFFFF
    for byte in data:
        register ^= byte << 8
        for _ in range(8):
            register = (register << 1) ^ (0x1021 if register & 0x8000 else 0)
            register &= 0xFFFF
    return register


class Bits:
    def __init__(self, packed: bytes) -> None:
        words = packed + bytes(-len(packed) % 4) + bytes(16)
        numbers = [int.from_bytes(words[i : i + 4], "big") for i in range(0, len(words), 4)]
        self.coder = STREAM.queue.RangeDecoder(np.array(numbers, dtype=np.uint32))
        self.counts: dict[Any, list[int]] = {}

    def even(self) -> int:
        return int(self.coder.decode(STREAM.model.Bernoulli(0.5, perfect=False)))

    def bit(self, *contexts: Any, start: tuple[int, int] = (2, 2)) -> int:
        counts = [self.counts.setdefault(context, [*start]) for context in contexts]
        odds = sum(n1 for _, n1 in counts) / sum(n0 + n1 for n0, n1 in counts)
        value = int(self.coder.decode(STREAM.model.Bernoulli(odds, perfect=False)))
        for one in counts:
            one[value] += 4
        return value

    def uniform(self, bits: int) -> int:
        return sum(self.even() << place for place in reversed(range(bits)))

    def signed(self, bits: int) -> int:
        return self.uniform(bits + 1) - 2**bits

    def rare(self, context: str) -> int:
        return self.bit(context, start=(14, 2))

    def escaped(self, context: str, first: int, few: int, many: int) -> int:
        return self.uniform(many) if self.rare(context) else first + self.uniform(few)

    def integer(
        self,
        zeros: list[Any],
        sizes: list[Any],
        start: tuple[int, int] = (2, 2),
        runs: tuple[int, int] = (2, 2),
    ) -> int:
        if not self.bit(*(("zero", context) for context in zeros), start=start):
            return 0
        negative = self.even()
        power = 0
        while self.bit(*(("run", context, min(power, 3)) for context in sizes), start=runs):
            power += 1
        size = 2**power + self.uniform(power)
        return -size if negative else size


@dataclass
class Decoded:
    units: str
    tolerance: float
    points: NDArray[np.float64]
    frames: NDArray[np.float64]
    turn: float
    stations: NDArray[np.float64]
    keys: list[int]
    pieces: int
    outer: NDArray[np.float64]
    lumen: NDArray[np.float64] | None

    def everywhere(self, signals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signals at all points of the axis, from those at the key sections."""
        last = len(self.points) - 1
        p = np.array(self.keys) * (last // self.pieces)
        lines = [(signals[i + 1] - signals[i]) / (p[i + 1] - p[i]) for i in range(len(p) - 1)]
        slopes = [lines[0] for _ in p]
        for i in range(1, len(p) - 1):
            left, right = p[i] - p[i - 1], p[i + 1] - p[i]
            slopes[i] = (right * lines[i - 1] + left * lines[i]) / (left + right)
        if len(p) > 2:
            slopes[0] = (3 * lines[0] - slopes[1]) / 2
            slopes[-1] = (3 * lines[-1] - slopes[-2]) / 2
        return CubicHermiteSpline(p, signals, np.array(slopes))(np.arange(last + 1))

    def outline(self, signals: NDArray[np.float64], u: NDArray[np.float64]) -> Any:
        """x, y of both curves of one key section at u."""
        width, aside, s, d = signals[0], signals[1], signals[2:9], signals[9:16]
        angle = np.arccos(u)
        basis = np.array([np.sin((k + 1) * angle) / np.sin(angle) for k in range(7)])
        half = s + width * HALF_CIRCLE
        return aside + width * u, (d + half) @ basis, (d - half) @ basis


def decode(data: bytes) -> Decoded:
    assert data[:2] == b"\x89\xe3"
    assert crc16(data[:2] + data[4:]) == int.from_bytes(data[2:4], "big")
    packed = Bits(data[4:])
    uniform, integer, rare, escaped = packed.uniform, packed.integer, packed.rare, packed.escaped
    hollow, left = rare("hollow"), rare("left-handed")
    units = bytes(uniform(8) for _ in range(uniform(4))).decode() if rare("units") else "mm"

    def scaled(number: int) -> float:
        return tolerance * (4 + number % 4) * 2.0 ** (number // 4 - 16)

    number = uniform(12)
    tolerance = (1 + number % 64 / 64) * 2.0 ** (number // 64 - 32)
    axis_step = scaled(escaped("scale", 44, 4, 6))
    start_axis, roll = uniform(2), uniform(8)
    turn = uniform(5) * math.pi / 32 if rare("turned") else 0.0
    finest = 8 * 2 ** uniform(2)
    tilts = np.array([integer(["tilt"], ["tilt"]) for _ in range(4)]).reshape(2, 2) / finest
    ends = []
    for _ in range(2):
        bits = escaped("width", 7, 3, 5)
        ends.append([packed.signed(bits) for _ in range(3)])
    axis_depth = uniform(3)
    bends: dict[int, list[tuple[int, list[int]]]] = {}
    for level in range(1, axis_depth + 1):
        bends[level] = [
            (
                key,
                [
                    integer(
                        [("bend", int(direction > 0), min(level, 4))],
                        [("bend", min(level, 4))],
                        BEND_STARTS[direction > 0][min(level, 4) - 1],
                        BEND_RUNS[min(level, 4) - 1],
                    )
                    for direction in range(3)
                ],
            )
            for key in range(
                2 ** (axis_depth - level), 2**axis_depth, 2 ** (axis_depth - level + 1)
            )
        ]
    section_step = scaled(escaped("scale", 44, 4, 6))
    pieces = 2 ** uniform(4)
    keys, before = [0], 1
    for place in range(1, pieces):
        before = packed.bit(("key", before))
        keys += [place] * before
    keys.append(pieces)
    outer = signals(packed, "outer", keys, section_step)
    lumen = outer + signals(packed, "lumen", keys, section_step) if hollow else None

    first, chord = (np.array(end) * axis_step for end in ends)
    c = chord / np.linalg.norm(chord)
    u = np.eye(3)[list(np.abs(chord)).index(min(np.abs(chord)))]
    u = u - (u @ c) * c
    u /= np.linalg.norm(u)
    v = np.cross(c, u)
    offsets = {0: np.zeros(3), 2**axis_depth: np.zeros(3)}
    for level in range(1, axis_depth + 1):
        known = sorted(offsets)
        spline = CubicSpline(known, [offsets[k] for k in known], bc_type="natural")
        for key, bend in bends[level]:
            step = axis_step * (4 * bend[0] * c + bend[1] * u + bend[2] * v)
            offsets[key] = spline(key) + step
    places = np.array(sorted(offsets)) / 2**axis_depth
    curve = CubicSpline(
        places,
        [
            first + place * chord + offsets[k]
            for k, place in zip(sorted(offsets), places, strict=True)
        ],
        bc_type="natural",
    )
    count = max(256, 2 * pieces)
    fine = np.linspace(0, 1, 4 * count + 1)
    lengths = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(curve(fine), axis=0), axis=1))])
    at = np.interp(np.linspace(0, lengths[-1], count + 1), lengths, fine)
    points, tangents = curve(at), curve(at, 1)
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    frames = frames_along(points, tangents, start_axis, roll, tilts, -1.0 if left else 1.0)
    x, y = frames[:, :, 0].copy(), frames[:, :, 1].copy()
    frames[:, :, 0] = x * math.cos(turn) + y * math.sin(turn)
    frames[:, :, 1] = y * math.cos(turn) - x * math.sin(turn)
    return Decoded(units, tolerance, points, frames, turn, lengths, keys, pieces, outer, lumen)


def signals(packed: Bits, wall: str, keys: list[int], step: float) -> NDArray[np.float64]:
    last = len(keys) - 1
    steps = np.array([2.0, 2.0] + [1.0] * 14) * step
    values = np.zeros((last + 1, 16))
    for n in range(16):
        kind, width = KINDS[n], int(n == 0)
        runs = (1, 5) if width else (2, 2)
        values[0, n] = packed.integer(
            [("first", kind)], [("first", width)], FIRST_STARTS[kind], runs
        )

    def difference(n: int, level: int) -> int:
        kind = KINDS[n]
        return packed.integer(
            [(wall, n), ("kind", kind, min(level, 4))],
            [("size", min(level, 3)), ("size of", kind)],
            STARTS[kind],
        )

    for n in range(16):
        values[last, n] = values[0, n] + difference(n, 1)
    levels = {0: 0, last: 0}
    for power in reversed(range(keys[-1].bit_length())):
        for m in range(1, last):
            if keys[m] % 2**power or not keys[m] % 2 ** (power + 1):
                continue
            i = max(k for k in levels if k < m)
            j = min(k for k in levels if k > m)
            levels[m] = 1 + max(levels[i], levels[j])
            fraction = (keys[m] - keys[i]) / (keys[j] - keys[i])
            for n in range(16):
                line = values[i, n] + fraction * (values[j, n] - values[i, n])
                values[m, n] = line + difference(n, levels[m])
    return values * steps


def frames_along(
    points: NDArray[np.float64],
    tangents: NDArray[np.float64],
    start_axis: int,
    roll: int,
    tilts: NDArray[np.float64],
    sign: float,
) -> NDArray[np.float64]:
    def across(x: NDArray[np.float64], n: NDArray[np.float64]) -> NDArray[np.float64]:
        x = x - (x @ n) * n
        return x / np.linalg.norm(x)

    def mirrored(x: NDArray[np.float64], by: NDArray[np.float64]) -> NDArray[np.float64]:
        return x if not by.any() else x - 2 * (x @ by) / (by @ by) * by

    x = across(np.eye(3)[start_axis], tangents[0])
    angle = 2 * math.pi * roll / 256
    x = x * math.cos(angle) + np.cross(tangents[0], x) * math.sin(angle)
    rows = [x]
    for i in range(len(points) - 1):
        step = points[i + 1] - points[i]
        by = tangents[i + 1] - mirrored(tangents[i], step)
        x = across(mirrored(mirrored(x, step), by), tangents[i + 1])
        rows.append(x)
    frames = []
    for i, (x, t) in enumerate(zip(rows, tangents, strict=True)):
        y, n = sign * np.cross(t, x), t
        for tilt, d in ((tilts[0], i / (len(points) - 1)), (tilts[1], 1 - i / (len(points) - 1))):
            r = max(0.0, 1 - 4 * d)
            n = n + r * r * (3 - 2 * r) * (tilt[0] * x + tilt[1] * y)
        n = n / np.linalg.norm(n)
        x = across(x, n)
        frames.append(np.stack([x, sign * np.cross(n, x), n], axis=1))
    return np.array(frames)
