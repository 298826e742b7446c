"""A hook frees a duct from a firm bed: its force, the length freed, and how near the break is."""

import matplotlib.pyplot as plt
import numpy as np

from app.simulation import bed_named
from physics import Beam
from physics.bed import Hand, SpaceBeam, pull

STRENGTH = 0.17  # of the wall, MPa: what the thesis's break stands for by this beam

bar = Beam.round(span=50.8, diameter=8.89, modulus=0.310264, poisson_ratio=0.3)
duct = SpaceBeam.of(bar, elements=60, nodes_at=[31.0])
bed = bed_named("firm").bed(duct, seed=7)
history = pull(duct, bed, [Hand(at=31.0, path=((0.0, 3.0, 9.0),), steps=60)])

lift = history.hands[:, 0, 2]
force = np.linalg.norm(history.forces[:, 0], axis=1)
assert history.stress is not None  # the bar has a wall
fraction = history.stress / STRENGTH
print(f"freed        {history.freed[-1]:.1f} mm, {history.broken[-1]} strands broken")
print(f"force        {force.max():.2f} N at most")
print(f"to the break {100 * (1 - fraction[-1]):.0f} % left")

figure, axes = plt.subplots(3, figsize=(8.0, 6.0), sharex=True, layout="constrained")
rows = {"force, N": force, "freed, mm": history.freed, "stress, % of strength": 100 * fraction}
for axis, (label, values) in zip(axes, rows.items(), strict=True):
    axis.plot(lift, values)
    axis.set(ylabel=label)
axes[0].set(title="A hook at 31 mm lifts a duct off a firm bed")
axes[-1].set(xlabel="lift, mm", ylim=(0, 100))
figure.savefig("free_a_duct.png", dpi=120)
