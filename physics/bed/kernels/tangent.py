"""The tangent as a matrix: its held freedoms, shifts of its diagonal, and block Cholesky."""

import math

from kernel_cache import side_by_side
from physics.bed.kernels.state import State
from physics.bed.kernels.vectors import Floats, Ints, inner


@inner
def copy_blocks(to: Floats, of: Floats) -> None:
    """Copy blocks of a matrix."""
    for n in range(of.shape[0]):
        for r in range(6):
            for c in range(6):
                to[n, r, c] = of[n, r, c]


@side_by_side
@inner
def take_product(of: Floats, y: Floats, z: Floats) -> None:
    """Take y^T z from a block."""
    # Six sums side by side, here and below, which the compiler may take several at once. One kernel
    # for all, with the number of rows as an argument, is not unrolled, and as slow as plain loops.
    for r in range(6):
        a, b, c, d, e, f = of[r, 0], of[r, 1], of[r, 2], of[r, 3], of[r, 4], of[r, 5]
        for k in range(6):
            v = y[k, r]
            a -= v * z[k, 0]
            b -= v * z[k, 1]
            c -= v * z[k, 2]
            d -= v * z[k, 3]
            e -= v * z[k, 4]
            f -= v * z[k, 5]
        of[r, 0], of[r, 1], of[r, 2], of[r, 3], of[r, 4], of[r, 5] = a, b, c, d, e, f


@side_by_side
@inner
def divide(y: Floats, low: Floats) -> None:
    """Replace y by L^-1 y, for an L with its diagonal's inverse."""
    for r in range(6):
        a, b, c, d, e, f = y[r, 0], y[r, 1], y[r, 2], y[r, 3], y[r, 4], y[r, 5]
        for k in range(r):
            v = low[r, k]
            a -= v * y[k, 0]
            b -= v * y[k, 1]
            c -= v * y[k, 2]
            d -= v * y[k, 3]
            e -= v * y[k, 4]
            f -= v * y[k, 5]
        v = low[r, r]
        y[r, 0], y[r, 1], y[r, 2] = a * v, b * v, c * v
        y[r, 3], y[r, 4], y[r, 5] = d * v, e * v, f * v


@side_by_side
@inner
def take_transposed(of: Floats, y: Floats, x: Floats) -> None:
    """Take y^T x from six numbers."""
    a, b, c, d, e, f = of[0], of[1], of[2], of[3], of[4], of[5]
    for k in range(6):
        v = x[k]
        a -= y[k, 0] * v
        b -= y[k, 1] * v
        c -= y[k, 2] * v
        d -= y[k, 3] * v
        e -= y[k, 4] * v
        f -= y[k, 5] * v
    of[0], of[1], of[2], of[3], of[4], of[5] = a, b, c, d, e, f


@side_by_side
@inner
def take_times(of: Floats, y: Floats, x: Floats) -> None:
    """Take y x from six numbers."""
    a = b = c = d = e = f = 0.0
    for k in range(6):
        v = x[k]
        a += y[0, k] * v
        b += y[1, k] * v
        c += y[2, k] * v
        d += y[3, k] * v
        e += y[4, k] * v
        f += y[5, k] * v
    of[0] -= a
    of[1] -= b
    of[2] -= c
    of[3] -= d
    of[4] -= e
    of[5] -= f


@inner
def hold_nodes(s: State, fraction: float) -> None:
    """Constrain held freedoms: `step` gets minus their distance to the goal, times `fraction`."""
    n = s.x.shape[0]
    for i in range(n):
        mask = s.held[i]
        if mask == 0:
            continue
        b = s.diagonal[i]
        for r in range(6):
            if not (mask >> r) & 1:
                continue
            displacement = fraction * (s.goal[i, r] - s.x[i, r]) if r < 3 else 0.0
            if displacement != 0.0:
                for c in range(6):
                    s.step[i, c] += displacement * (b[r, c] if c <= r else b[c, r])
                for k in range(s.first_block[0, i], s.first_block[0, i + 1]):
                    for c in range(6):
                        s.step[s.blocks[1, k], c] += displacement * s.block[k, r, c]
                for m in range(s.first_block[1, i], s.first_block[1, i + 1]):
                    k = s.blocks[2, m]
                    for c in range(6):
                        s.step[s.blocks[0, k], c] += displacement * s.block[k, c, r]
            for c in range(6):
                if c < r:
                    b[r, c] = 0.0
                elif c > r:
                    b[c, r] = 0.0
            for k in range(s.first_block[0, i], s.first_block[0, i + 1]):
                for c in range(6):
                    s.block[k, r, c] = 0.0
            for m in range(s.first_block[1, i], s.first_block[1, i + 1]):
                for c in range(6):
                    s.block[s.blocks[2, m], c, r] = 0.0
            b[r, r] = 1.0
            s.hold[i, r] = -displacement
    for i in range(n):
        mask = s.held[i]
        for r in range(6):
            if (mask >> r) & 1:
                s.step[i, r] = s.hold[i, r]


@side_by_side
@inner
def solve(
    first_block: Ints, blocks: Ints, product: Ints, diagonal: Floats, block: Floats, step: Floats
) -> bool:
    """Replace `step` by -K^-1 step, by block Cholesky; False if K is not positive definite."""
    # K = L L^T with K_ii in the lower triangles of `diagonal` and K_ij, j above i, in the full
    # blocks of `block`, all overwritten: L_ii L_ii^T = K_ii less what came before, Y_j = L_ii^-1
    # K_ij, and Y_j^T Y_k is taken from K_jk. The diagonal of L_ii keeps the inverse, so that there
    # is one division for each freedom.
    # A pivot that falls below 1e-14 of its entry is rounding: K is singular or worse.
    first, column = first_block[0], blocks[1]
    n = diagonal.shape[0]
    at = 0
    for i in range(n):
        low = diagonal[i]
        b = step[i]
        for c in range(6):
            v = low[c, c]
            was = v
            for k in range(c):
                v -= low[c, k] * low[c, k]
            if not v > 1e-14 * was:
                return False
            v = math.sqrt(v)
            inverse = 1.0 / v
            low[c, c] = inverse
            for r in range(c + 1, 6):
                v = low[r, c]
                for k in range(c):
                    v -= low[r, k] * low[c, k]
                low[r, c] = v * inverse
        for r in range(6):
            v = b[r]
            for k in range(r):
                v -= low[r, k] * b[k]
            b[r] = v * low[r, r]
        for m in range(first[i], first[i + 1]):
            y = block[m]
            divide(y, low)
            take_product(diagonal[column[m]], y, y)  # above the diagonal nobody looks
            take_transposed(step[column[m]], y, b)
        for m in range(first[i], first[i + 1]):
            for later in range(m + 1, first[i + 1]):
                take_product(block[product[at]], block[m], block[later])
                at += 1
    for i in range(n - 1, -1, -1):
        low = diagonal[i]
        b = step[i]
        for m in range(first[i], first[i + 1]):
            take_times(b, block[m], step[column[m]])
        for r in range(5, -1, -1):
            v = b[r]
            for k in range(r + 1, 6):
                v -= low[k, r] * b[k]
            b[r] = v * low[r, r]
    for i in range(n):
        for r in range(6):
            step[i, r] = -step[i, r]
    return True


@inner
def shift_tangent(s: State, shift: float, length: float) -> None:
    """Add `shift` to the tangent's displacements and length^2 as much to its rotations."""
    turning = shift * length * length
    for n in range(s.x.shape[0]):
        for r in range(3):
            s.diagonal[n, r, r] += shift
            s.diagonal[n, 3 + r, 3 + r] += turning


@inner
def add_drag(s: State, drag: float) -> None:
    """Add a drag, N/mm of a node's displacement, as of a bar that turns as well."""
    for n in range(s.x.shape[0]):
        turning = drag * s.thick[n, 0] * s.thick[n, 0]
        for r in range(3):
            s.diagonal[n, r, r] += drag
            s.diagonal[n, 3 + r, 3 + r] += turning
