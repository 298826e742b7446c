"""The exponential stress of tissue, of + - * alone: the same bits on every processor.

sigma/E = (e^(b eps) - 1)/b, eps >= 0, and its energy (sigma/E - eps)/b, at b = 0 their limits eps
and eps^2/2. With eps_0 = eps/256, T_0 by the exponential's series and D_0 = (T_0 - eps_0)/b by it
too, eight doublings

    eps -> 2 eps,  D -> 2 D + T^2,  T -> T (2 + b T)

are exact but for rounding, with nothing lost where eps or b is small.
"""

from kernel_cache import njit

MOST = 20.0
"""b eps from which on the stress goes on in a straight line, e^20 = 5e8."""


@njit(cache=True, inline="always", error_model="numpy")
def exponential_stress(strain: float, b: float, most: float) -> tuple[float, float, float]:
    """Return stress, its slope and energy at a strain of 0 or more, in E; to 1e-14 of each."""
    # `most` is MOST/b, the strain from which on it is straight; any large one where b is 0.
    beyond = max(strain - most, 0.0)
    e = 0.00390625 * min(strain, most)
    r = b * e
    # The series of (e^r - 1 - r)/r^2 to r^7, next term r^8/10!: r is 0.08 at most.
    series = 1.0 / 40320.0 + r * (1.0 / 362880.0)
    series = 1.0 / 720.0 + r * (1.0 / 5040.0 + r * series)
    series = 0.5 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * series)))
    d = e * e * series
    t = e + b * d
    for _ in range(8):
        d = 2.0 * d + t * t
        t = t * (2.0 + b * t)
    slope = 1.0 + b * t
    return t + slope * beyond, slope, d + beyond * (t + 0.5 * slope * beyond)
