"""Organs that no images gave, by their stored numbers."""

import numpy as np

from organ_geometry.organ_file.organ_code import OrganCode


def any_code(seed: int, *, hollow: bool) -> OrganCode:
    """Whole numbers of an organ that no images gave."""
    rng = np.random.default_rng(seed)
    depth, axis_depth = int(rng.integers(0, 8)), int(rng.integers(0, 5))
    between = np.flatnonzero(rng.random(2**depth - 1) < 0.3) + 1
    keys = np.concatenate([[0], between, [2**depth]])
    outer, lumen = rng.integers(-3, 4, (2, len(keys), 16)) * rng.integers(0, 2, (2, 1, 16))
    outer[:, 0] = 0
    outer[0, 0] = 40
    lumen[:, 0] = 0
    bends = rng.integers(-3, 4, (2**axis_depth + 1, 3))
    bends[[0, -1]] = 0
    return OrganCode(
        units=str(rng.choice(["mm", "relative", "µm"])),
        left_handed=bool(rng.integers(2)),
        tolerance=int(rng.integers(1600, 2200)),
        axis_scale=int(rng.integers(54, 62)),
        tilt_scale=int(rng.integers(4)),
        start_axis=int(rng.integers(3)),
        roll=int(rng.integers(256)),
        turn=int(rng.integers(32)),
        tilts=rng.integers(-9, 10, (2, 2)),
        ends=np.array([rng.integers(-(10**6), 10**6, 3), [400, 90, -20]]),
        bends=bends,
        section_scale=int(rng.integers(48, 56)),
        candidates=2**depth,
        keys=keys,
        outer=outer,
        lumen=lumen if hollow else None,
    )
