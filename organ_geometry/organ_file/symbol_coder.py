"""Integers as bytes: adaptive binary arithmetic coding, by constriction's range coder.

Every integer is binarised: split into bits (here also "answers" to yes-or-no questions). A bit is
coded with the probability P(1) = n1 / (n0 + n1) of the contexts that it is given, whose counts of
zeros and ones, n0 and n1, begin with a start value and grow by 4 with each bit coded. A bit of
probability p takes -log2 p bits of the file. There are three forms:

    plain     k bits at even odds, highest first: uniform numbers, of which nothing is foretold
    bit       one bit with learned odds; a rare flag begins with (14, 2), an eighth for yes
    whole     an adaptive signed integer: is it zero; its sign, at even odds; its size s as the
              Elias-gamma code has it, e = floor(log2 s) in unary ("runs" of ones, with learned
              odds), then the e lower binary digits of s, plainly

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
"""Counts of no and yes that a context begins with."""
# What a bit adds to its count: as much as most starts have together. Files are short and must learn
# fast.
_ANSWER = 4
# Unary digits from the fourth on share a context: few sizes are that large.
_MOST_RUNS = 3
# Sizes stay below 2^48, so that all arithmetic on them is exact in 64 bits, and in doubles.
_MOST_DIGITS = 47
# Bytes end in zeros without end, and a damaged file could be read for ever: more bits than this no
# organ has (4097 keys of two walls' 16 coefficients, about 20 bits each).
_MOST_QUESTIONS = 4_000_000
_STREAM: Any = vars(constriction)["stream"]
_FAMILY: Any = _STREAM.model.Bernoulli(perfect=False)
# Odds of bits that nothing foretells: constriction codes them in the same stream.
_EVEN = 0.5


class SymbolError(ValueError):
    """Bytes that no writer has written."""


class _Contexts:
    """The odds of a yes in each context."""

    def __init__(self) -> None:
        self._counts: dict[Hashable, list[int]] = {}

    def odds(self, contexts: Sequence[Hashable], start: tuple[int, int]) -> float:
        no = yes = 0
        for context in contexts:
            counts = self._counts.setdefault(context, [*start])
            no, yes = no + counts[0], yes + counts[1]
        return yes / (no + yes)

    def learn(self, contexts: Sequence[Hashable], answer: int) -> None:
        for context in contexts:
            self._counts[context][answer] += _ANSWER


class _Numbers:
    """Integers made of bits: the forms that writer and reader share."""

    def bit(
        self, contexts: Sequence[Hashable], answer: int, start: tuple[int, int] = EVEN_START
    ) -> int:
        """Pass one answer, with odds learned in its contexts, which begin with some counts."""
        raise NotImplementedError

    def even_bit(self, answer: int) -> int:
        """Pass one answer at even odds."""
        raise NotImplementedError

    def plain(self, number: int, bits: int) -> int:
        """Pass an unsigned number of some bits at even odds, highest bit first."""
        value = 0
        for place in range(bits - 1, -1, -1):
            value = 2 * value + self.even_bit(number >> place & 1)
        return value

    def plain_signed(self, number: int, bits: int) -> int:
        """Pass a number from -2^bits to 2^bits - 1 at even odds."""
        return self.plain(number + (1 << bits), bits + 1) - (1 << bits)

    def whole(
        self,
        contexts: Sequence[Hashable],
        runs: Sequence[Hashable],
        number: int,
        start: tuple[int, int] = EVEN_START,
        run_start: tuple[int, int] = EVEN_START,
    ) -> int:
        """Pass a signed integer with odds learned: whether it is zero, its sign, and its size."""
        # `contexts` learn whether it is zero, `runs` how many binary digits its size has; the two
        # starts are counts of no and yes.
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
        size = (1 << passed) + self.plain(size - (1 << passed) if size else 0, passed)
        return -size if negative else size


class SymbolWriter(_Numbers):
    """Encodes numbers; `as_bytes` gives what a `SymbolReader` decodes."""

    def __init__(self) -> None:
        self._contexts = _Contexts()
        self._answers: list[int] = []
        self._odds: list[float] = []

    def bit(
        self, contexts: Sequence[Hashable], answer: int, start: tuple[int, int] = EVEN_START
    ) -> int:
        """Write one answer, with odds learned in its contexts."""
        self._answers.append(answer)
        self._odds.append(self._contexts.odds(contexts, start))
        self._contexts.learn(contexts, answer)
        return answer

    def even_bit(self, answer: int) -> int:
        """Write one answer at even odds."""
        self._answers.append(answer)
        self._odds.append(_EVEN)
        return answer

    def as_bytes(self) -> bytes:
        """Return the fewest bytes from which a reader gets the same numbers."""
        answers = np.array(self._answers, dtype=np.int32)
        odds = np.array(self._odds, dtype=np.float64)
        encoder = _STREAM.queue.RangeEncoder()
        encoder.encode(answers, _FAMILY, odds)
        whole: bytes = encoder.get_compressed().astype(">u4").tobytes()
        number = int.from_bytes(whole, "big")
        shortest = whole.rstrip(b"\0")
        # Any number in the coder's last interval gives the answers; one may have fewer digits.
        for length in range(len(shortest) - 1, max(-1, len(shortest) - 9), -1):
            shift = 8 * (len(whole) - length)
            for head in (number >> shift, (number >> shift) + 1):
                if head >> (8 * length):
                    continue
                candidate = head.to_bytes(length, "big") if length else b""
                if _gives(candidate, odds, answers):
                    shortest = candidate
                    break
            else:
                return shortest.rstrip(b"\0")
        return shortest.rstrip(b"\0")


class SymbolReader(_Numbers):
    """Decodes the numbers of a `SymbolWriter`'s bytes."""

    def __init__(self, data: bytes) -> None:
        self._contexts = _Contexts()
        self._decoder = _decoder(data)
        self._questions = 0

    def bit(
        self, contexts: Sequence[Hashable], answer: int = 0, start: tuple[int, int] = EVEN_START
    ) -> int:
        """Read one answer, with odds learned in its contexts."""
        read = self._read(self._contexts.odds(contexts, start))
        self._contexts.learn(contexts, read)
        return read

    def even_bit(self, answer: int = 0) -> int:
        """Read one answer at even odds."""
        return self._read(_EVEN)

    def _read(self, odds: float) -> int:
        self._questions += 1
        if self._questions > _MOST_QUESTIONS:
            raise SymbolError("it does not end")
        try:
            return int(self._decoder.decode(_STREAM.model.Bernoulli(odds, perfect=False)))
        except (AssertionError, ValueError) as error:
            raise SymbolError("no writer has written it") from error


def _gives(data: bytes, odds: NDArray[np.float64], answers: NDArray[np.int32]) -> bool:
    """Return whether bytes are read as the answers."""
    try:
        return bool(np.array_equal(_decoder(data).decode(_FAMILY, odds), answers))
    except AssertionError:  # how the coder says that no answers have such bytes
        return False


def _decoder(data: bytes) -> Any:
    """Return a decoder of bytes that go on as zeros."""
    padded = data + bytes(8 + -len(data) % 4)
    return _STREAM.queue.RangeDecoder(np.frombuffer(padded, dtype=">u4").astype(np.uint32))
