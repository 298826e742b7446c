"""Converged curves of linear laws to hold the exact beam against; inch, lbf and psi.

Cases A, B and C are the ducts of tables 6.1, 6.2 and 6.3: half span 1, diameter 0.4, 0.1, 0.35,
E 1500, 1500, 45, Poisson's ratio 0.3. Central curves go from P, the force on one half, to the
deflection; the others, grasped at 30 % of the span, from the whole force F.

NO_SHEAR and SHEAR are geometrically exact finite elements of engineering strain, 640 to a half or
to the span, checked against the boundary value problem (relative 2e-6 and 1e-4). Where those with
shear miss that problem by more, at B, F = 10, the solution of the problem itself stands here
(collocation, tolerance 1e-8).
"""

from app.validation.thesis_tables import Curve

DIAMETERS = {"A": 0.4, "B": 0.1, "C": 0.35}
MODULI = {"A": 1500.0, "B": 1500.0, "C": 45.0}

NO_SHEAR: dict[str, Curve] = {
    "A": {
        1: 0.0438248,
        2: 0.085567,
        3: 0.1240047,
        4: 0.158854,
        5: 0.190371,
        6: 0.2189973,
        8: 0.2693174,
        10: 0.3126809,
        12: 0.3510159,
        15: 0.4017502,
        20: 0.4741485,
    },
    "B": {1: 0.5587892, 2: 0.7485511, 3: 0.8974609, 4: 1.0275345, 5: 1.1466204},
    "C": {
        0.01: 0.0250391,
        0.05: 0.1158325,
        0.1: 0.2010572,
        0.2: 0.3165075,
        0.3: 0.3990223,
        0.4: 0.4658919,
        0.5: 0.5236061,
        0.75: 0.645084,
        1: 0.7480704,
        1.5: 0.9259848,
        2: 1.0837185,
        2.5: 1.2301295,
    },
}

NO_SHEAR_OFF_CENTRE: dict[str, Curve] = {
    "A": {2: 0.0261089, 8: 0.0996929, 20: 0.2148685, 40: 0.3477569},
    "B": {2: 0.4597649, 6: 0.7222081, 10: 0.9199587},
    "C": {
        0.02: 0.0148754,
        0.2: 0.1322796,
        0.4: 0.2235007,
        0.8: 0.3478301,
        2: 0.5818389,
        5: 0.9812239,
    },
}

SHEAR: dict[str, Curve] = {
    "A": {
        1: 0.0587031,
        2: 0.1121879,
        3: 0.1588291,
        4: 0.1993891,
        5: 0.2351336,
        6: 0.2671492,
        8: 0.3230407,
        10: 0.3713217,
        12: 0.4143701,
        15: 0.4721055,
        20: 0.5563165,
    },
    "B": {1: 0.5737063, 2: 0.7740739, 3: 0.9345, 4: 1.0807354, 5: 1.2593294},
    "C": {
        0.01: 0.0316882,
        0.05: 0.1404169,
        0.1: 0.2345071,
        0.2: 0.3602282,
        0.3: 0.4521862,
        0.4: 0.5285307,
        0.5: 0.5958054,
        0.75: 0.7418859,
        1: 0.8716017,
        1.5: 1.1202001,
        2: 1.398961,
        2.5: 1.7149329,
    },
}

SHEAR_OFF_CENTRE: dict[str, Curve] = {
    "A": {2: 0.0393391, 8: 0.1431798, 20: 0.2872096, 40: 0.4484382},
    "B": {2: 0.47663, 6: 0.7697594, 10: 1.1310543},
    "C": {
        0.02: 0.0207026,
        0.2: 0.171996,
        0.4: 0.2790272,
        0.8: 0.4250248,
        2: 0.7311436,
        5: 1.4734882,
    },
}
