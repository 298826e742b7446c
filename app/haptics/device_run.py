"""A run by devices as a small file: what its loop was given, period by period."""

import base64
import binascii
import hashlib
import zlib

import msgspec
import numpy as np
from msgspec import Struct
from msgspec.structs import replace
from numpy.typing import NDArray

from app.anatomy import Anatomy, first_edition
from app.bounded_file import decoded
from app.haptics.device import DeviceLimits
from app.haptics.servo_loop import LoopSettings
from app.simulation import TheoryChoice

FORMAT = "bluntdissect-device-run"
VERSION = 1
MOST_PERIODS = 40_000_000
MOST_BYTES = 500_000_000
CHUNK = 65_536


class DeviceRun(Struct, frozen=True, forbid_unknown_fields=True):
    """All that the course of a run depends on."""

    preset: str  # that ships
    organ_sha256: str | None  # of one's own organ that the duct was on, if any
    theory: TheoryChoice
    grasps_mm: tuple[float, ...]
    threshold_MPa: float  # noqa: N815
    coupling_N_per_mm: float  # noqa: N815
    rate: int  # this and the next three: as `LoopSettings`
    scale: float
    hold: bool
    stale_seconds: float
    # this and the next two: the device's bounds
    force_N: float  # noqa: N815
    force_rate_N_per_s: float  # noqa: N815
    added_damping_N_s_per_m: float  # noqa: N815
    assist_mm: float  # where a second hook without a device was left, along the pull; 0 for none
    periods: int
    inputs: str  # places and bits of the hands: second differences, packed by zlib, in base64
    forces_sha256: str  # of the forces given
    bed: str | None = None  # that ships; None for a duct that nothing holds
    bed_seed: int = 1
    anatomy: str | Anatomy | None = None  # of several tubes, the name of one that ships, or whole
    tube: str | None = None  # of them, which was felt
    tear_mm_per_s: float | None = None  # how fast a tear crosses the wall; at once when None
    clear_strands: bool = False  # of tubes that they do not hold; older runs' led through some
    joint_faces: bool = False  # of the shipped anatomies; older runs name their first edition
    format: str = FORMAT
    version: int = VERSION

    @property
    def settings(self) -> LoopSettings:
        """How the loop ran."""
        return LoopSettings(self.rate, self.scale, self.hold, self.stale_seconds)

    @property
    def limits(self) -> DeviceLimits:
        """The bounds of its forces."""
        return DeviceLimits(
            self.force_N, self.force_rate_N_per_s, 0.0, self.added_damping_N_s_per_m
        )

    def unpacked(self) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
        """Return places and bits."""
        try:
            content = zlib.decompress(base64.b64decode(self.inputs, validate=True))
        except (zlib.error, binascii.Error) as error:
            raise ValueError(f"the inputs of this device run cannot be unpacked: {error}") from None
        rows = np.frombuffer(content, dtype="<i4" if len(content) % 4 == 0 else "u1")
        if not 0 < self.periods <= MOST_PERIODS or rows.size % (4 * self.periods):
            raise ValueError(
                f"the inputs of this device run are not those of {self.periods} periods"
            )
        table = rows.reshape(4, -1, self.periods).astype(np.int64)
        places = np.cumsum(np.cumsum(table[:3], axis=2), axis=2)
        return np.ascontiguousarray(places.transpose(2, 1, 0)), table[3].T.astype(np.uint8)


class Recorder:
    """Keeps the inputs that a loop is given, of so many hands."""

    def __init__(self, hands: int) -> None:
        self._chunks: list[tuple[NDArray[np.int32], NDArray[np.uint8]]] = []
        self._hands = hands
        self._room = self._count = 0
        self._digest = hashlib.sha256()

    @property
    def periods(self) -> int:
        """How many are kept."""
        return self._count

    @property
    def forces_sha256(self) -> str:
        """Digest of the forces so far."""
        return self._digest.hexdigest()

    def keep(self, units: NDArray[np.int64], inputs: list[int], given: NDArray[np.float64]) -> None:
        """Keep a period."""
        place = self._count % CHUNK
        if place == 0:
            places = np.empty((CHUNK, self._hands, 3), np.int32)
            self._chunks.append((places, np.empty((CHUNK, self._hands), np.uint8)))
        places, bits = self._chunks[-1]
        places[place], bits[place] = units, inputs
        self._digest.update(given.tobytes())
        self._count += 1

    def packed(self) -> str:
        """Return the inputs for a `DeviceRun`."""
        table = np.zeros((4, self._hands, self._count), "<i4")
        if self._chunks:
            places = np.concatenate([chunk[0] for chunk in self._chunks])[: self._count]
            bits = np.concatenate([chunk[1] for chunk in self._chunks])[: self._count]
            rows = places.transpose(2, 1, 0).astype(np.int64)
            for _ in range(2):
                rows = np.diff(rows, axis=2, prepend=0)
            table[:3], table[3] = rows, bits.T
        return base64.b64encode(zlib.compress(table.tobytes(), 9)).decode()


def read_device_run(content: bytes) -> DeviceRun:
    """Return the run in a file."""
    run = decoded(msgspec.json.decode, content, DeviceRun, "this is no device run")
    if (run.format, run.version) != (FORMAT, VERSION):
        raise ValueError(f"this is a {run.format} of version {run.version}, not {FORMAT} {VERSION}")
    if isinstance(run.anatomy, str) and not run.joint_faces:
        run = replace(run, anatomy=first_edition(run.anatomy))
    return run
