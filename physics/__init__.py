"""Beams under a pull: deflection, stress and rupture, in mm, N, MPa and rad."""
