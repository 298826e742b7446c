"""The method of the geometrically exact beam, and the symbols of its kernels.

Everything here is without units: lengths are parts of the span S, forces parts of E A and moments
parts of E A S (A the mean area), so that one set of tolerances serves every beam.

Symbols: ``h`` and ``p`` the force in the beam along the clamp line and along the pull, constant
over a part between a clamp and the grasp; ``theta`` rotation of the section, ``kappa`` its
derivative along the axis at rest; ``n = h cos + p sin`` tension and ``q = p cos - h sin`` shear;
``lam`` and ``gam`` stretch and shear strain, with x' = lam cos - gam sin and
y' = lam sin + gam cos; ``m`` moment, with m' = -(lam q - gam n).

Method. psi(kappa, n, q) is the energy of a section less n lam + q gam, minimised over the strains
(a Legendre transform), so that its derivatives are m, -lam and -gam. The equilibrium makes
sum psi + h X + p Y stationary in the rotations and in h and p, where X and Y are the lengths that
a part has to span. Rotations are quadratic over an element (its two ends and a bubble between)
and psi is summed at its two Gauss points: of fourth order, symmetric, and with forces that are
the derivatives of the summed energy to the last digit. Bubbles are condensed; what is left is
tridiagonal with a border of h and p. By Sylvester's law of inertia the pivots count the ways in
which the energy can fall: an equilibrium is stable when there are as many negative pivots as
unknown forces. `newton` draws an element's equations.

A beam may be grasped at a second place: three parts, each with its p. A grip with compliance c, a
spring between the beam and what leads it, has the term - c (pull)^2 / 2 in the forces.

A section whose centroid lies off the axis by e, towards the pull, has the energy of the same
section on the axis at the stretch lam - e kappa of its centroid: psi gets a term - e n kappa,
whatever the law.

The strains of the neo-Hookean section have no closed form. Each Gauss point keeps them and their
derivatives, updates them by one Newton step whenever the rotations have moved, and condenses the
residual that this step leaves into the beam's equations: the whole converges as one Newton method.
"""

BY_FORCE, BY_DEFLECTION = 0, 1
"""What is prescribed: the pull, or the place of the grip, whose compliance is in between."""

FOUND, LOST, UNSTABLE, NO_STIFFNESS, SQUEEZED, OUT_OF_REACH = 0, 1, 2, 3, 4, 5
"""Outcomes: an equilibrium; Newton's method did not converge; an unstable equilibrium; a section
has no stiffness left; a fibre has almost no length left; no force as large within `FARTHEST`."""

# Rows of `nodes`, a column per node: its rotation, then what the elimination needs to go back.
ROTATION, PIVOT, OFF, DOWN_R, DOWN_H, DOWN_P, DOWN_Q, DOWN_S = range(8)
NODE_ROWS = 8

# Rows of `elements`: length, height of the bubble, and the bubble's row divided by its pivot.
LENGTH, BUBBLE, BUBBLE_R, BUBBLE_A, BUBBLE_D, BUBBLE_H, BUBBLE_P = range(7)
ELEMENT_ROWS = 7

# Rows of `points`, two columns per element: rotation, sine, cosine and curvature; moment and the
# derivatives of psi by theta (T), h, p and kappa (K), where X = -psi_h and Y = -psi_p; the section.
ANGLE, SIN, COS, KAPPA = range(4)
MOMENT, T, X, Y, TT, TH, TP, HH, HP, PP, KK, KT, KH, KP = range(4, 18)
OFFSET = 18
BENDING, STRETCHING, SHEARING = range(19, 22)
LINEAR_ROWS = 22
# The same for a neo-Hookean section, and its strains, their derivatives, and what the law makes
# of them.
AREA, REACH, WEIGHT, DEFICIT = range(19, 23)
LAM, GAM, LAM_N, LAM_Q, GAM_Q, LAM_K, GAM_K, LAW_N, LAW_Q, LAW_K, STIFFNESS = range(23, 34)
FIBRE_LAW_ROWS = 34

# Rows of `fibres`: three blocks of as many columns as `points`, the middle and the two outer ones.
STRETCH, SHEAR, VOLUME, PULL, PULL_S, PULL_G, CROSS, CROSS_G = range(8)
FIBRE_ROWS = 8

# Entries of `line`: the unknown forces (of the parts across), loads, negative pivots too many;
# constants of the material; the last equilibrium before a failure; whether a centroid is off axis;
# the compliance of the grips; the node of the second grasp (the last one when there is none), what
# is prescribed there and how much; the length of the shorter part; the exponential law's constant,
# below zero by the neo-Hookean one; room for the equations of the
# forces.
H, P1, P2, P3, FORCE, DEFLECTION, FORCE_2, DEFLECTION_2, NEGATIVE = range(9)
SHEAR_MODULUS, RATIO, SHRINK, POISSON, LAST_FORCE, LAST_DEFLECTION = range(9, 15)
ECCENTRIC, COMPLIANCE, COMPLIANCE_2, SECOND, CONTROL_2, TARGET_2 = range(15, 21)
SHORTER_PIECE, STIFFENING, EQUATIONS = 21, 22, 23
LINE_SIZE = EQUATIONS + 20

GAUSS = 0.5 / 3.0**0.5
"""Distance of a Gauss point from the middle of its element, in lengths of the element."""
SLOPE = 4.0 / 3.0**0.5
"""Slope of a bubble of height 1 at the Gauss points, per length of the element."""
BULGE = 2.0 / 3.0
"""Height of a bubble of height 1 at the Gauss points."""

WARM, TIGHT = 1e-6, 1e-9
"""Updates relative to the rotations and forces; Newton leaves about the square of the last one."""
LARGEST_TURN, FARTHEST_TURN = 1.0, 3.0
"""Update of a rotation, and rotation, beyond which Newton's method diverges, rad."""
PAST = 1e-2
"""Shear of the wrong sign, relative to the force, that is taken for an error of the mesh."""
FLOOR, FLAT = 1e-5, 1e-4
"""Force, in E A, and rotation, rad, below which updates are held against these: strains are
differences from 1, so that the last digits of what is smaller are rounding."""
LEAST_STRETCH = 0.02
"""Stretch of a fibre of the section below which laws of fibres are not followed."""
MOST_STEPS = 14
"""Newton steps before a shorter move is tried."""
FIRST_STEP = 0.05
"""First deflection of a pull from rest, in lengths of the shorter part; steps double from there."""
LONGEST_MOVE = 0.5
"""Largest change, relative to the last load, that is tried in one go."""
FARTHEST = 1000.0
"""Deflection, in spans, beyond which a force is not sought."""
