"""The force at which one duct breaks, by three theories, and a figure of their pulls."""

import matplotlib.pyplot as plt

from physics import Beam, Cubic, Exact, Fem, NeoHooke, break_of

duct = Beam.round(span=50.8, diameter=8.89, modulus=0.310264, poisson_ratio=0.3)
theories = {
    "cubic, the thesis's": Cubic(q=0.5),
    "elements, 40 a side": Fem(),
    "exact, neo-Hookean": Exact(law=NeoHooke()),
}
figure, axes = plt.subplots(figsize=(8.0, 4.5), layout="constrained")
for name, theory in theories.items():
    pull = theory.pull(duct, grasp=25.4)
    event = break_of(pull, threshold=0.2)
    assert event is not None  # no force would break it
    print(f"{name:20} breaks at {event.force:.2f} N, pulled by {event.deflection:.2f} mm")
    forces = [event.force * step / 40 for step in range(41)]
    axes.plot([pull.to_force(force).deflection for force in forces], forces, label=name)
    axes.plot(event.deflection, event.force, "kx")
axes.set(xlabel="deflection at the middle, mm", ylabel="force, N", title="To the break, 0.2 MPa")
axes.legend()
figure.savefig("break_by_theory.png", dpi=120)
