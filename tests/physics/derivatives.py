"""A network turned as a whole; its tangent as one matrix, and the differences of its energy."""

from typing import Any

import numpy as np
import pytest

from physics.bed import kernels as k


def turned(by: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
    """(N, 4) unit quaternions, w first, turned by one or N others."""
    w, a, b, c = by.T
    p, r, s, t = quaternions.T
    product = [
        w * p - a * r - b * s - c * t,
        w * r + a * p + b * t - c * s,
        w * s + b * p + c * r - a * t,
        w * t + c * p + a * s - b * r,
    ]
    return np.stack(product, axis=1) / np.linalg.norm(by.T, axis=0)[..., None]


def turn_whole(state: k.State) -> None:
    """Turn and move all nodes of a network together."""
    by = np.array([0.5, -0.5, 0.1, 0.7])
    w, a, b, c = by / np.linalg.norm(by)
    turn = np.array(
        [
            [1 - 2 * (b * b + c * c), 2 * (a * b - w * c), 2 * (a * c + w * b)],
            [2 * (a * b + w * c), 1 - 2 * (a * a + c * c), 2 * (b * c - w * a)],
            [2 * (a * c - w * b), 2 * (b * c + w * a), 1 - 2 * (a * a + b * b)],
        ]
    )
    state.x[:] = state.x @ turn.T + [3.0, -2.0, 5.0]
    state.q[:] = turned(by, state.q)


def full_tangent(state: k.State) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(6 N, 6 N) the tangent of the last assembly."""
    nodes = state.x.shape[0]
    full = np.zeros((nodes, 6, nodes, 6))
    for n in range(nodes):
        low = np.tril(state.diagonal[n])
        full[n, :, n] = low + np.tril(low, -1).T
    for block, (i, j) in zip(state.block, state.blocks[:2].T, strict=True):
        full[i, :, j] = block
        full[j, :, i] = block.T
    return full.reshape(6 * nodes, 6 * nodes)


def assert_derivatives(state: k.State, kind: int) -> None:
    nodes = state.x.shape[0]
    size = 6 * nodes
    k.assemble(state, kind, 0.0)
    gradient = state.g.ravel().copy()
    tangent = full_tangent(state)
    x, q = state.x.copy(), state.q.copy()

    def energy(step: np.ndarray) -> float:
        turn = np.concatenate([np.ones((nodes, 1)), 0.5 * step.reshape(nodes, 6)[:, 3:]], axis=1)
        state.x[:] = x + step.reshape(nodes, 6)[:, :3]
        state.q[:] = turned(turn, q)
        return k.assemble(state, kind, 0.0)

    h = 1e-3
    one = h * np.eye(size)
    differences = np.array(
        [8 * (energy(v) - energy(-v)) - (energy(2 * v) - energy(-2 * v)) for v in one]
    ) / (12 * h)
    assert differences == pytest.approx(gradient, abs=1e-8 * np.abs(gradient).max())

    def mixed(a: np.ndarray, b: np.ndarray) -> float:
        return energy(a + b) - energy(a - b) - energy(b - a) + energy(-a - b)

    second = np.array(
        [[(16 * mixed(a, b) - mixed(2 * a, 2 * b)) / (48 * h * h) for b in one] for a in one]
    )
    # A strand may pass from slack to taut within the differences: those terms are of order h.
    assert second == pytest.approx(tangent, abs=2e-8 * np.abs(tangent).max())
