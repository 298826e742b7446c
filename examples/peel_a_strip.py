"""The force that peels a thin strip straight up off its bed, beside Kendall's closed form."""

import math

import matplotlib.pyplot as plt
import numpy as np

from physics.bed import Bed, Hand, SpaceBeam, pull
from physics.bed.peel_theory import peel_force

AXIAL, TOUGHNESS = 8.0, 0.12  # E A, N; mJ to part a mm of strip

stiffness = np.array([AXIAL, 50.0, 50.0, 1.5, 1.5, 1.5])  # E A, 2 G A; G J, 2 E I: N, N mm2
strip = SpaceBeam.from_axis(span=160.0, elements=240, stiffness=stiffness, ends=("clamped", "free"))
bed = Bed(to_mm=130.0, strands=500, stiffness=0.3, toughness=TOUGHNESS, floor=2.0)
# It holds the end in height only, so that its force is straight up.
hook = Hand(at=160.0, path=((0.0, 0.0, 60.0),), along=(False, False, True), steps=200)
history = pull(strip, bed, [hook], plane=True)

lift, force = history.hands[:, 0, 2], history.forces[:, 0, 2]
steady, theory = force[-60:].mean(), peel_force(math.pi / 2, TOUGHNESS, AXIAL)
print(f"steady force {steady:.4f} N, Kendall's {theory:.4f} N")

figure, axes = plt.subplots(figsize=(8.0, 4.0), layout="constrained")
axes.plot(lift, force, label="beam on its bed")
axes.axhline(theory, color="k", linestyle="--", label="Kendall 1975, steady")
axes.set(xlabel="lift of the end, mm", ylabel="force, N", title="A strip peeled at 90 degrees")
axes.legend()
figure.savefig("peel_a_strip.png", dpi=120)
