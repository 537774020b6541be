import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from shared_control_env.core.compile.lanes import WIDTH
from tests.compiled import solve_box


def programs(count, n, rng):
    roots = rng.normal(size=(count, n + 2, n))
    H = np.swapaxes(roots, 1, 2) @ roots + 1e-3 * np.eye(n)
    return H, 3.0 * rng.normal(size=(count, n)), -rng.uniform(0.0, 1.0, (count, n)), rng.uniform(0.0, 1.0, (count, n))


@given(st.integers(1, 8), st.integers(1, WIDTH), st.integers(0, 10_000))
@settings(max_examples=60)
def test_meets_the_optimality_conditions_and_scipy(n, count, seed):
    many = programs(count, n, np.random.default_rng(seed))
    for H, g, low, high, x in zip(*many, solve_box(*many), strict=True):
        gradient = H @ x + g
        assert (x >= low - 1e-12).all()
        assert (x <= high + 1e-12).all()
        np.testing.assert_allclose(x, np.clip(x - gradient, low, high), atol=1e-8)
        factor = np.linalg.cholesky(H).T
        oracle = lsq_linear(factor, -np.linalg.solve(factor.T, g), (low - 1e-12, high + 1e-12), tol=1e-13).x
        value = lambda q, H=H, g=g: 0.5 * q @ H @ q + g @ q
        assert value(x) <= value(np.clip(oracle, low, high)) + 1e-7


def test_a_lane_does_not_depend_on_its_neighbours():
    many = programs(WIDTH, 6, np.random.default_rng(0))
    together = solve_box(*many)
    for lane in range(WIDTH):
        np.testing.assert_array_equal(solve_box(*(array[lane : lane + 1] for array in many))[0], together[lane])
