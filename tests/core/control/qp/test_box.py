import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from shared_control_env.core.control.qp.box import solve_box_qp


@given(st.integers(1, 8), st.integers(0, 10_000))
@settings(max_examples=200)
def test_meets_the_optimality_conditions_and_scipy(n, seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n + 2, n))
    H = root.T @ root + 1e-3 * np.eye(n)
    g = 3.0 * rng.normal(size=n)
    low, high = -rng.uniform(0.0, 1.0, n), rng.uniform(0.0, 1.0, n)
    x = np.empty(n)
    solve_box_qp(n, H, g, low, high, x, np.empty((n, n)), np.empty(n), np.empty(n, dtype=np.int64))
    gradient = H @ x + g
    assert (x >= low - 1e-12).all()
    assert (x <= high + 1e-12).all()
    np.testing.assert_allclose(x, np.clip(x - gradient, low, high), atol=1e-8)
    factor = np.linalg.cholesky(H).T
    oracle = lsq_linear(factor, -np.linalg.solve(factor.T, g), (low - 1e-12, high + 1e-12), tol=1e-13).x
    value = lambda q: 0.5 * q @ H @ q + g @ q
    assert value(x) <= value(np.clip(oracle, low, high)) + 1e-7
