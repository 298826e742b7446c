"""Converged curves of solids to hold the theories against; inch, lbf and psi.

Cases A, B and C are the ducts of tables 6.1, 6.2 and 6.3: half span 1, diameter 0.4, 0.1, 0.35,
E 1500, 1500, 45, Poisson's ratio 0.3. Central curves go from P, the force on one half, to the
deflection; the others, grasped at 30 % of the span, from the whole force F. They are of quadratic
bricks (CalculiX C3D20R) of the compressible neo-Hookean law, both ends fixed, converged to 0.07 %.
"""

Curve = dict[float, float]

SOLID: dict[str, Curve] = {
    "A": {
        1: 0.057443,
        2: 0.1114919,
        3: 0.1605019,
        4: 0.2044409,
        5: 0.2439727,
        6: 0.2798742,
        8: 0.343378,
        10: 0.3988946,
        12: 0.44885,
        15: 0.5165439,
        20: 0.6169178,
    },
    "B": {1: 0.6167761, 2: 0.8757878, 3: 1.11278, 4: 1.353486, 5: 1.609278},
    "C": {
        0.01: 0.0309321,
        0.05: 0.1415194,
        0.1: 0.2436907,
        0.2: 0.385092,
        0.3: 0.4910697,
        0.4: 0.5810298,
        0.5: 0.6621228,
        0.75: 0.8451783,
        1: 1.016047,
    },
}

SOLID_OFF_CENTRE: dict[str, Curve] = {
    "A": {2: 0.0382844, 8: 0.1434865, 20: 0.3024795},
    "B": {2: 0.5100739, 6: 0.9251652, 10: 1.394751},
    "C": {
        0.02: 0.0201275,
        0.2: 0.1746807,
        0.4: 0.2934306,
        0.8: 0.4667663,
        2: 0.8428497,
        5: 1.87908,
    },
}

SOLID_HELD_OUT: dict[tuple[float, float], Curve] = {
    (0.25, 0.3): {
        0.01: 0.0968086,
        0.05: 0.288854,
        0.1: 0.4183223,
        0.2: 0.6004313,
        0.4: 0.8841964,
        0.8: 1.408419,
    },
    (0.5, 0.3): {0.05: 0.0451772, 0.2: 0.1727957, 0.5: 0.3741124, 1: 0.614141},
    (0.35, 0.45): {0.01: 0.0305108, 0.1: 0.2420535, 0.4: 0.5784718, 1: 1.003864},
}
"""Central curves of solids with E = 45, not fitted to; by diameter and Poisson's ratio."""
