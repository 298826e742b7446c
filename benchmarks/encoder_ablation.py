"""Ablation of the encoder: bytes and time of each idea, on the phantom and real organs.

Run from the root of the repository: ``python -m benchmarks.encoder_ablation``, with names of rows
for only these; it prints the table of docs/encoder.md, one row after the other. Each row switches
one idea off by its value in `EncoderSettings`, and says by how much files of default effort grow
without it, and how many processor seconds all of them take.
"""

import sys
import time
from dataclasses import dataclass, replace

from assets import BILE_DUCT_PHANTOM
from benchmarks.organ_sets import DATA, SETS, missing_sets
from organ_geometry import BuiltOrgan, build_organ, read_image_stack
from organ_geometry.encoder.encode import ToleranceTooSmall, encoded_organ
from organ_geometry.encoder.settings import FULL, QUICK, EncoderSettings

# Settings without an idea each.
WITHOUT: dict[str, EncoderSettings] = {
    "levels": replace(QUICK, axis_levels=(0,)),
    "axis steps": replace(QUICK, axis_steps=(1.0,)),
    "tilts": replace(QUICK, tilts=False),
    "rotation": replace(QUICK, rotation_used=0.0),
    "section steps": replace(QUICK, section_steps=QUICK.section_steps[:1]),
    "zeroed keys": replace(QUICK, key_own_bits=-1e6),
    "penalty learned": replace(QUICK, penalty_learned=False),
    "refinement": replace(QUICK, choice_rounds=1, rounds=1),
}


@dataclass(frozen=True)
class Traced:
    """An organ's sections, with bytes and time of its default encoding."""

    built: BuiltOrgan
    left_handed: bool

    def encoded(self, settings: EncoderSettings) -> tuple[int, float] | None:
        """Return the bytes with some settings, and processor seconds; None if it is refused."""
        organ = self.built.organ
        started = time.process_time()
        try:
            encoded = encoded_organ(
                self.built.contours,
                organ.tolerance_mm,
                hollow=organ.hollow,
                left_handed=self.left_handed,
                settings=settings,
                units=organ.units,
            )
        except ToleranceTooSmall:
            return None
        return len(encoded.organ.encoded), time.process_time() - started


def traced_sets() -> dict[str, Traced]:
    """Return the organs that are there: the phantom, and the real sets."""
    folders = {"phantom": BILE_DUCT_PHANTOM}
    folders |= {name: DATA / name / "masks" for name in SETS if name not in missing_sets()}
    found: dict[str, Traced] = {}
    for name, folder in folders.items():
        built = build_organ(read_image_stack(folder))
        found[name] = Traced(built, built.organ.handedness < 0)
    return found


def main() -> None:
    """Print the table."""
    rows = WITHOUT | {"full effort": FULL}
    wanted = sys.argv[1:] or [*rows]
    unknown = [name for name in wanted if name not in rows]
    if unknown:
        sys.exit(f"rows are {', '.join(rows)}, not {', '.join(unknown)}")
    organs = traced_sets()
    whole = {name: one.encoded(QUICK) for name, one in organs.items()}
    print("| without |", " | ".join(organs), "| s |")
    print("|---" * (len(organs) + 2) + "|")
    print("| nothing |", " | ".join(_cells(whole, None)), f"| {_seconds(whole)} |", flush=True)
    for row in wanted:
        found = {name: one.encoded(rows[row]) for name, one in organs.items()}
        print(f"| {row} |", " | ".join(_cells(found, whole)), f"| {_seconds(found)} |", flush=True)


Encoded = dict[str, tuple[int, float] | None]


def _cells(found: Encoded, whole: Encoded | None) -> list[str]:
    """Return bytes, or how many per cent more than with all ideas."""
    cells: list[str] = []
    for name, one in found.items():
        before = None if whole is None else whole[name]
        if one is None:
            cells.append("refused")
        elif before is None:
            cells.append(f"{one[0]}")
        else:
            cells.append(f"{100.0 * (one[0] / before[0] - 1.0):+.1f} %")
    return cells


def _seconds(found: Encoded) -> str:
    return f"{sum(one[1] for one in found.values() if one is not None):.1f}"


if __name__ == "__main__":
    main()
