"""Whole numbers as bytes: bits with learned odds, packed by constriction's range coder.

Every number is split into yes-or-no questions. Each question belongs to contexts, which count the
answers so far; the odds of an answer are their sums. `SymbolWriter` and `SymbolReader` have the
same methods, so that one function describes a format both ways: what is passed in is written, or
is ignored and read.
"""

from collections.abc import Hashable, Sequence
from typing import Any

import constriction  # pyright: ignore[reportMissingTypeStubs]
import numpy as np
from numpy.typing import NDArray

EVEN_START = (2, 2)
"""Counts of no and yes that a context begins with."""
_ANSWER = 4
_MOST_RUNS = 3
_MOST_DIGITS = 47
_MOST_QUESTIONS = 4_000_000
_STREAM: Any = vars(constriction)["stream"]
_FAMILY: Any = _STREAM.model.Bernoulli(perfect=False)
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
    """Numbers made of questions."""

    def bit(
        self, contexts: Sequence[Hashable], answer: int, start: tuple[int, int] = EVEN_START
    ) -> int:
        """Pass one answer, with odds learned in its contexts, which begin with some counts."""
        raise NotImplementedError

    def even_bit(self, answer: int) -> int:
        """Pass one answer at even odds."""
        raise NotImplementedError

    def plain(self, number: int, bits: int) -> int:
        """Pass a number from 0 to 2^bits - 1 at even odds, highest bit first."""
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
        """Pass a whole number: whether it is zero, its sign, and its size."""
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
