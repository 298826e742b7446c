"""Integers as bytes: adaptive binary arithmetic coding, by constriction's range coder.

Every integer is binarised: split into bits. A bit is coded with the probability
P(1) = n1 / (n0 + n1) of the contexts that it is given, whose counts of zeros and ones, n0 and n1,
begin with a start value and grow by 4 with each bit coded. A bit of probability p takes -log2 p
bits of the file. There are three forms:

    uniform   an unsigned integer in k bits at even odds, highest first: nothing of it is foretold
    bit       one bit with learned odds; a rare flag begins with (14, 2), an eighth for 1
    integer   an adaptive signed integer: is it zero; its sign, at even odds; its size s as the
              Elias-gamma code has it, e = floor(log2 s) in unary ("runs" of ones, with learned
              odds), then the e lower binary digits of s, uniform

A bit with several contexts takes the sum of their counts, so that a context with few bits so far
leans on one that has more (a mixture by counts). `SymbolWriter` and `SymbolReader` have the same
methods, so that one function describes a format both ways: what is passed in is written, or is
ignored and read.
"""

from collections.abc import Hashable, Sequence
from typing import Any

import constriction  # pyright: ignore[reportMissingTypeStubs]
import numpy as np
from numpy.typing import NDArray

EVEN_START = (2, 2)
"""Counts of zeros and ones that a context begins with."""
# What a bit adds to its count: as much as most starts have together. Files are short and must learn
# fast.
_COUNT = 4
# Unary digits from the fourth on share a context: few sizes are that large.
_MOST_RUNS = 3
# Sizes stay below 2^48, so that all arithmetic on them is exact in 64 bits, and in doubles.
_MOST_DIGITS = 47
# Bytes end in zeros without end, and a damaged file could be read for ever: more bits than this no
# organ has (4097 keys of two walls' 16 coefficients, about 20 bits each).
_MOST_BITS = 4_000_000
_STREAM: Any = vars(constriction)["stream"]
_FAMILY: Any = _STREAM.model.Bernoulli(perfect=False)
# Odds of bits that nothing foretells: constriction codes them in the same stream.
_EVEN = 0.5


class SymbolError(ValueError):
    """Bytes that no writer has written."""


class _Numbers:
    """Integers made of bits: the forms that writer and reader share."""

    def __init__(self) -> None:
        self._counts: dict[Hashable, list[int]] = {}  # of zeros and ones in each context

    def _pass(self, bit: int, odds: float) -> int:
        """Write a bit with the odds of a one, or read it whatever is passed."""
        raise NotImplementedError

    def bit(
        self, contexts: Sequence[Hashable], bit: int = 0, start: tuple[int, int] = EVEN_START
    ) -> int:
        """Pass one bit, with odds learned in its contexts, which begin with some counts."""
        counts = [self._counts.setdefault(context, [*start]) for context in contexts]
        zeros, ones = (sum(each) for each in zip(*counts, strict=True))
        passed = self._pass(bit, ones / (zeros + ones))
        for one in counts:
            one[passed] += _COUNT
        return passed

    def even_bit(self, bit: int = 0) -> int:
        """Pass one bit at even odds."""
        return self._pass(bit, _EVEN)

    def uniform(self, number: int, bits: int) -> int:
        """Pass an unsigned number of some bits at even odds, highest bit first."""
        value = 0
        for place in range(bits - 1, -1, -1):
            value = 2 * value + self.even_bit(number >> place & 1)
        return value

    def uniform_signed(self, number: int, bits: int) -> int:
        """Pass a number from -2^bits to 2^bits - 1 at even odds."""
        return self.uniform(number + (1 << bits), bits + 1) - (1 << bits)

    def integer(
        self,
        contexts: Sequence[Hashable],
        runs: Sequence[Hashable],
        number: int,
        start: tuple[int, int] = EVEN_START,
        run_start: tuple[int, int] = EVEN_START,
    ) -> int:
        """Pass a signed integer with odds learned: whether it is zero, its sign, and its size."""
        # `contexts` learn whether it is zero, `runs` how many binary digits its size has; the two
        # starts are counts of zeros and ones.
        if not self.bit([("zero", one) for one in contexts], int(number != 0), start):
            return 0
        negative = self.even_bit(int(number < 0))
        size = abs(number)
        digits = max(size, 1).bit_length() - 1
        passed = 0
        while self.bit(
            [("run", one, min(passed, _MOST_RUNS)) for one in runs], int(passed < digits), run_start
        ):
            passed += 1
            if passed > _MOST_DIGITS:
                raise SymbolError("a number is larger than 2^48")
        size = (1 << passed) + self.uniform(size - (1 << passed) if size else 0, passed)
        return -size if negative else size


class SymbolWriter(_Numbers):
    """Encodes numbers; `as_bytes` gives what a `SymbolReader` decodes."""

    def __init__(self) -> None:
        super().__init__()
        self._bits: list[int] = []
        self._odds: list[float] = []

    def _pass(self, bit: int, odds: float) -> int:
        self._bits.append(bit)
        self._odds.append(odds)
        return bit

    def as_bytes(self) -> bytes:
        """Return the fewest bytes from which a reader gets the same numbers."""
        bits = np.array(self._bits, dtype=np.int32)
        odds = np.array(self._odds, dtype=np.float64)
        encoder = _STREAM.queue.RangeEncoder()
        encoder.encode(bits, _FAMILY, odds)
        whole: bytes = encoder.get_compressed().astype(">u4").tobytes()
        number = int.from_bytes(whole, "big")
        shortest = whole.rstrip(b"\0")
        # Any number in the coder's last interval gives the bits; one may have fewer digits.
        for length in range(len(shortest) - 1, max(-1, len(shortest) - 9), -1):
            shift = 8 * (len(whole) - length)
            for head in (number >> shift, (number >> shift) + 1):
                if head >> (8 * length):
                    continue
                candidate = head.to_bytes(length, "big") if length else b""
                if _gives(candidate, odds, bits):
                    shortest = candidate
                    break
            else:
                return shortest.rstrip(b"\0")
        return shortest.rstrip(b"\0")


class SymbolReader(_Numbers):
    """Decodes the numbers of a `SymbolWriter`'s bytes."""

    def __init__(self, data: bytes) -> None:
        super().__init__()
        self._decoder = _decoder(data)
        self._bits_read = 0

    def _pass(self, bit: int, odds: float) -> int:
        self._bits_read += 1
        if self._bits_read > _MOST_BITS:
            raise SymbolError("it does not end")
        try:
            return int(self._decoder.decode(_STREAM.model.Bernoulli(odds, perfect=False)))
        except (AssertionError, ValueError) as error:
            raise SymbolError("no writer has written it") from error


def _gives(data: bytes, odds: NDArray[np.float64], bits: NDArray[np.int32]) -> bool:
    try:
        return bool(np.array_equal(_decoder(data).decode(_FAMILY, odds), bits))
    except AssertionError:  # how the coder says that no bits have such bytes
        return False


def _decoder(data: bytes) -> Any:
    """Return a decoder of bytes that go on as zeros."""
    padded = data + bytes(8 + -len(data) % 4)
    return _STREAM.queue.RangeDecoder(np.frombuffer(padded, dtype=">u4").astype(np.uint32))
