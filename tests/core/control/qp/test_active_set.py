"""The dual active-set solver: optimality certificates, and agreement with OSQP, SLSQP and known solutions."""

from __future__ import annotations

import numpy as np
import osqp
import pytest
from numpy.random import Generator
from scipy import sparse
from scipy.optimize import minimize

from shared_control_env.core import entries
from shared_control_env.core.control.driver import DRIVERS, SLACKS
from shared_control_env.core.control.qp.active_set import (
    FAILED,
    ITERATION_LIMIT,
    MAX_ROWS,
    MAX_VARIABLES,
    SOLVED,
    UNBOUNDED,
    WORKSPACE,
)
from shared_control_env.core.parameters import InternalModelParameters, Parameters
from shared_control_env.core.records import SCENE, pack
from shared_control_env.core.risk.triangulation import triangulate_any
from tests import compiled

Program = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]

ACCURACY = 1e-8
"""Largest scaled residual that a certificate allows."""


def solve(program: Program) -> tuple[int, int, float, float, np.ndarray, np.ndarray]:
    """Status, iterations, primal and dual residual, x and multipliers."""
    P, q, A, low, high = program
    m, n = A.shape
    x, multipliers = np.full(n, np.nan), np.full(m, np.nan)
    work = np.zeros((), WORKSPACE)
    return *compiled.solve_qp_array(n, m, P, q, A, low, high, x, multipliers, work), x, multipliers


def certificate(program: Program, x: np.ndarray, multipliers: np.ndarray) -> float:
    """Largest scaled violation of the optimality conditions, which hold at the minimum alone."""
    P, q, A, low, high = program
    value = A @ x
    size = np.abs(A).sum(axis=1) * max(1.0, np.abs(x).max())
    primal = np.maximum(value - high, low - value) / np.maximum(size, 1e-300)
    terms = np.abs(P) @ np.abs(x) + np.abs(q) + np.abs(A.T) @ np.abs(multipliers)
    dual = np.abs(P @ x + q + A.T @ multipliers) / max(1.0, terms.max())
    # A positive multiplier needs the upper bound and a negative one the lower: sign and slackness at once.
    to_bound = np.where(multipliers > 0.0, high - value, value - low)
    slackness = np.where(multipliers != 0.0, np.abs(to_bound) / np.maximum(size, 1e-300), 0.0)
    return max(primal.max(initial=0.0), dual.max(), slackness.max(initial=0.0))


def assert_solved(program: Program) -> np.ndarray:
    """Solve, check status, certificate and the residuals reported; return x."""
    P, q, A, low, high = program
    status, _, primal, dual, x, multipliers = solve(program)
    assert status == SOLVED
    assert certificate(program, x, multipliers) <= ACCURACY
    value = A @ x
    scale = 1.0 + np.abs(P).sum() * np.abs(x).max() + np.abs(A).sum() * np.abs(multipliers).max(initial=0.0)
    assert primal == pytest.approx(np.maximum(value - high, low - value).max(initial=0.0), abs=1e-13 * scale)
    assert dual == pytest.approx(np.abs(P @ x + q + A.T @ multipliers).max(), abs=1e-13 * scale)
    return x


def definite(rng: Generator, n: int, condition: float) -> np.ndarray:
    """Random symmetric matrix with eigenvalues from 1 down to 1 / condition."""
    basis = np.linalg.qr(rng.normal(size=(n, n)))[0]
    P = basis * np.logspace(0.0, -np.log10(condition), n) @ basis.T
    return 0.5 * (P + P.T)


def program_with_solution(rng: Generator, n: int, m: int, active: int, condition: float) -> tuple[Program, np.ndarray]:
    """Random program built around its minimum, at which the given number of rows is active.

    Some of the other rows have one bound, some none; some of the active ones are equations.
    """
    P, x, A = definite(rng, n, condition), rng.normal(size=n), rng.normal(size=(m, n))
    value = A @ x
    low, high = value - rng.uniform(0.01, 2.0, m), value + rng.uniform(0.01, 2.0, m)
    low[rng.random(m) < 0.3], high[rng.random(m) < 0.3] = -UNBOUNDED, UNBOUNDED
    multipliers = np.zeros(m)
    for i in rng.choice(m, active, replace=False):
        multipliers[i] = rng.uniform(0.1, 3.0) * rng.choice([-1.0, 1.0])
        if multipliers[i] > 0.0:
            high[i] = value[i]
        else:
            low[i] = value[i]
        if rng.random() < 0.2:
            low[i] = high[i] = value[i]
    return (P, -P @ x - A.T @ multipliers, A, low, high), x


@pytest.mark.parametrize("condition", [1.0, 1e3, 1e6])
def test_programs_built_around_their_solution(condition: float) -> None:
    rng = np.random.default_rng(int(condition))
    for _ in range(1500):
        n = int(rng.integers(1, MAX_VARIABLES + 1))
        m = int(rng.integers(n, 3 * n + 5))
        program, x = program_with_solution(rng, n, m, int(rng.integers(0, n + 1)), condition)
        # The program's own rounding moves its minimum by up to the condition times the rounding.
        np.testing.assert_allclose(assert_solved(program), x, rtol=0.0, atol=1e-12 * condition + 1e-8)


def test_box_programs_of_the_drivers_shape() -> None:
    rng = np.random.default_rng(1)
    for _ in range(1500):
        n, rows = 7, 20
        A = np.vstack([rng.normal(size=(rows, n)), np.eye(n)])
        low = np.concatenate([rng.uniform(-2.0, -0.01, rows), -np.ones(n)])
        high = np.concatenate([rng.uniform(0.01, 2.0, rows), np.ones(n)])
        assert_solved((definite(rng, n, 1e4), rng.normal(size=n), A, low, high))


def test_equations() -> None:
    rng = np.random.default_rng(2)
    for _ in range(500):
        n, equations = 8, int(rng.integers(1, 9))
        P, q = definite(rng, n, 1e3), rng.normal(size=n)
        A, b = rng.normal(size=(equations, n)), rng.normal(size=equations)
        x = assert_solved((P, q, A, b, b))
        system = np.block([[P, A.T], [A, np.zeros((equations, equations))]])
        expected = np.linalg.solve(system, np.concatenate([-q, b]))[:n]
        np.testing.assert_allclose(x, expected, rtol=1e-7, atol=1e-7)


def test_rows_repeated_and_redundant() -> None:
    """Repeats, negatives, multiples and sums of rows, with the bounds that follow: the minimum stays."""
    rng = np.random.default_rng(3)
    for _ in range(1000):
        n, m = 6, 8
        (P, q, A, low, high), x = program_with_solution(rng, n, m, int(rng.integers(0, n + 1)), 1e3)
        low[low == -UNBOUNDED], high[high == UNBOUNDED] = -np.inf, np.inf
        scale = rng.uniform(0.1, 10.0)
        i, j = rng.choice(m, 2, replace=False)
        extended = (
            P,
            q,
            np.vstack([A, A, -A, scale * A, A[i] + A[j], np.zeros(n)]),
            np.concatenate([low, low, -high, scale * low, [low[i] + low[j]], [0.0]]),
            np.concatenate([high, high, -low, scale * high, [high[i] + high[j]], [0.0]]),
        )
        np.testing.assert_allclose(assert_solved(extended), x, atol=1e-8)


def test_degenerate_vertex() -> None:
    """Many more active rows than variables, most with a multiplier of zero."""
    rng = np.random.default_rng(4)
    for _ in range(500):
        n, m = 5, 20
        P, x, A = definite(rng, n, 1e3), rng.normal(size=n), rng.normal(size=(m, n))
        multipliers = np.where(rng.random(m) < 0.3, rng.uniform(0.0, 2.0, m), 0.0)
        high = A @ x
        low = np.where(rng.random(m) < 0.2, high, -UNBOUNDED)
        found = assert_solved((P, -P @ x - A.T @ multipliers, A, low, high))
        np.testing.assert_allclose(found, x, atol=1e-8)


def test_scaled_data() -> None:
    """Units of the cost and of the rows change nothing but the multipliers."""
    rng = np.random.default_rng(5)
    for _ in range(200):
        (P, q, A, low, high), x = program_with_solution(rng, 7, 20, 4, 1e3)
        cost, rows = 10.0 ** rng.uniform(-6, 6), 10.0 ** rng.uniform(-6, 6, 20)
        low = np.where(low > -UNBOUNDED, rows * low, -UNBOUNDED)
        high = np.where(high < UNBOUNDED, rows * high, UNBOUNDED)
        program = cost * P, cost * q, rows[:, None] * A, low, high
        status, _, _, _, found, _ = solve(program)
        assert status == SOLVED
        np.testing.assert_allclose(found, x, atol=1e-8)


def test_projection_on_a_box() -> None:
    """With P = I and simple bounds the minimum is the clipped point."""
    rng = np.random.default_rng(6)
    for _ in range(200):
        point = rng.normal(scale=2.0, size=10)
        low, high = -rng.uniform(0.0, 1.0, 10), rng.uniform(0.0, 1.0, 10)
        status, iterations, _, _, x, multipliers = solve((np.eye(10), -point, np.eye(10), low, high))
        assert status == SOLVED
        assert iterations == np.count_nonzero((point < low) | (point > high))
        np.testing.assert_allclose(x, np.clip(point, low, high), atol=1e-14)
        np.testing.assert_allclose(multipliers, point - np.clip(point, low, high), atol=1e-14)


def test_unconstrained_takes_no_iterations() -> None:
    status, iterations, primal, dual, x, _ = solve(
        (2.0 * np.eye(3), np.ones(3), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    )
    assert (status, iterations, primal, dual) == (SOLVED, 0, 0.0, 0.0)
    np.testing.assert_array_equal(x, -0.5)


def test_agrees_with_slsqp() -> None:
    rng = np.random.default_rng(7)
    for _ in range(50):
        n, m = 4, 6
        P, q = definite(rng, n, 10.0), rng.normal(scale=3.0, size=n)
        A, b = rng.normal(size=(m, n)), rng.uniform(0.1, 1.0, m)
        x = assert_solved((P, q, A, -b, b))
        expected = minimize(
            lambda v, P=P, q=q: 0.5 * v @ P @ v + q @ v,
            np.zeros(n),
            jac=lambda v, P=P, q=q: P @ v + q,
            method="SLSQP",
            constraints={
                "type": "ineq",
                "fun": lambda v, A=A, b=b: np.concatenate([b - A @ v, b + A @ v]),
                "jac": lambda v, A=A: np.vstack([-A, A]),
            },
            options={"ftol": 1e-12, "maxiter": 500},
        )
        assert expected.success
        np.testing.assert_allclose(x, expected.x, atol=1e-5)


def infeasible_programs() -> list[Program]:
    """Programs whose rows contradict one another."""
    rng = np.random.default_rng(8)
    P, q = definite(rng, 5, 1e3), rng.normal(size=5)
    a = rng.normal(size=5)
    none = np.full(2, UNBOUNDED)
    A = rng.normal(size=(12, 5))
    weights = rng.uniform(0.1, 1.0, 11)
    A[11] = -weights @ A[:11]  # the rows <= -1 sum, with these weights, to 0 <= -1
    return [
        (P, q, np.vstack([a, a]), np.array([-UNBOUNDED, 1.0]), np.array([0.0, UNBOUNDED])),
        (P, q, np.vstack([a, 3.0 * a]), np.array([1.0, 1.0]), np.array([1.0, 1.0])),
        (P, q, np.zeros((1, 5)), np.ones(1), np.full(1, 2.0)),
        (P, q, a[None], np.ones(1), np.zeros(1)),
        (P, q, np.vstack([a, -a]), np.array([1e-6, 1e-6]), none),
        (P, q, A, np.full(12, -UNBOUNDED), np.full(12, -1.0)),
        (P, q, rng.normal(size=(6, 5)), np.arange(6.0), np.arange(6.0)),
    ]


@pytest.mark.parametrize("program", infeasible_programs())
def test_infeasible_rows_are_not_solved(program: Program) -> None:
    status, iterations, *_ = solve(program)
    assert status == FAILED
    assert iterations <= 4 * sum(program[2].shape)


def test_random_infeasible_rows_are_not_solved() -> None:
    rng = np.random.default_rng(9)
    for _ in range(1000):
        n = int(rng.integers(1, 12))
        m = n + int(rng.integers(1, 12))
        A = rng.normal(size=(m, n))
        A[-1] = -rng.uniform(0.0, 1.0, m - 1) @ A[:-1]
        status, *_ = solve((definite(rng, n, 1e6), rng.normal(size=n), A, np.full(m, -UNBOUNDED), np.full(m, -0.01)))
        assert status in (FAILED, ITERATION_LIMIT)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("part", range(5))
def test_data_that_is_not_finite_fails(part: int, value: float) -> None:
    rng = np.random.default_rng(10)
    for _ in range(20):
        program, _ = program_with_solution(rng, 5, 9, 3, 10.0)
        poisoned = program[part].reshape(-1)
        entry = int(rng.integers(poisoned.size))
        poisoned[entry] = value
        free = (part, value) in [(3, -np.inf), (4, np.inf)]  # an infinite bound on its own side is none
        status, *_ = solve(program)
        assert status == SOLVED if free else status == FAILED


@pytest.mark.parametrize("P", [np.zeros((2, 2)), -np.eye(2), np.ones((2, 2)), np.diag([1.0, -1.0])])
def test_not_strictly_convex_fails(P: np.ndarray) -> None:
    status, iterations, primal, dual, x, multipliers = solve((P, np.ones(2), np.eye(2), -np.ones(2), np.ones(2)))
    assert (status, iterations, primal, dual) == (FAILED, 0, np.inf, np.inf)
    assert not x.any()
    assert not multipliers.any()


def test_sizes_beyond_capacity_fail() -> None:
    n = MAX_VARIABLES + 1
    assert solve((np.eye(n), np.ones(n), np.eye(n), -np.ones(n), np.ones(n)))[0] == FAILED
    m = MAX_ROWS + 1
    assert solve((np.eye(2), np.ones(2), np.ones((m, 2)), -np.ones(m), np.ones(m)))[0] == FAILED


def test_full_capacity() -> None:
    rng = np.random.default_rng(11)
    for _ in range(100):
        program, x = program_with_solution(rng, MAX_VARIABLES, MAX_ROWS, int(rng.integers(22)), 1e4)
        np.testing.assert_allclose(assert_solved(program), x, atol=1e-7)


def test_arrays_may_be_longer_and_the_workspace_is_reused() -> None:
    """Neither the entries beyond n and m nor what an earlier program left behind are read."""
    rng = np.random.default_rng(12)
    work = np.zeros((), WORKSPACE)
    for name in WORKSPACE.names:
        work[name] = np.nan if WORKSPACE[name].base.kind == "f" else 7
    for _ in range(50):
        n, m = int(rng.integers(1, 8)), int(rng.integers(8, 20))
        program, _ = program_with_solution(rng, n, m, int(rng.integers(n + 1)), 10.0)
        longer = [np.full((30, 30), np.nan) if part.ndim == 2 else np.full(30, np.nan) for part in program]
        longer[0][:n, :n], longer[1][:n], longer[2][:m, :n], longer[3][:m], longer[4][:m] = program
        x, multipliers = np.full(30, np.nan), np.full(30, np.nan)
        found = compiled.solve_qp_array(n, m, *longer, x, multipliers, work)
        expected = solve(program)
        assert found == expected[:4]
        np.testing.assert_array_equal(x[:n], expected[4])
        np.testing.assert_array_equal(multipliers[:m], expected[5])
        assert np.isnan(x[n:]).all()
        assert np.isnan(multipliers[m:]).all()


def driver_program(rng: Generator, H_c: int, H_p: int, internal: bool = False) -> Program:
    """The driver's program of a random scene in a lane of 4 m; where |y| > 2 the car is outside, and slack is needed."""
    parameters = Parameters(internal_model=InternalModelParameters(active=internal))
    parameters = pack(parameters._replace(driver=parameters.driver._replace(H_c=H_c, H_p=H_p)))
    scene = np.zeros((), SCENE)
    y, psi = rng.uniform(-2.5, 2.5), rng.uniform(-0.1, 0.1)
    scene["z"] = [0.0, y, psi, rng.uniform(0.0, 30.0), rng.uniform(-0.3, 0.3), rng.uniform(-0.2, 0.2)]
    scene["kappa"][:] = rng.uniform(-1.0, 1.0) / 60.0
    scene["v_target"] = rng.uniform(0.0, 30.0)
    scene["region"] = [0.0, 40.0, -2.0, 2.0]
    compiled.search(triangulate_any(np.array([0.0, 40.0, -2.0, 2.0]), np.empty((0, 4, 2))), parameters, scene)
    scene["felt"] = rng.uniform([-2.0, -0.1], [2.0, 0.1])
    n, rows = 2 * H_c + SLACKS, 2 * H_p + 1
    P, q, A = np.zeros((n, n)), np.zeros(n), np.zeros((rows + n, n))
    low, high = np.zeros(rows + n), np.zeros(rows + n)
    u_last = rng.uniform([-5.0, -0.1], [5.0, 0.1])
    work = np.zeros((), DRIVERS)
    entries.build_program(scene.reshape(1), u_last, 0.5 * u_last, parameters, work, P, q, A, low, high)
    return P, q, A, low, high


def osqp_solution(program: Program) -> np.ndarray | None:
    """Polished minimum by OSQP at a tight tolerance, or None where it does not get there."""
    P, q, A, low, high = program
    solver = osqp.OSQP()
    solver.setup(
        P=sparse.triu(P, format="csc"),
        q=q,
        A=sparse.csc_matrix(A),
        l=low,
        u=high,
        eps_abs=1e-8,
        eps_rel=1e-8,
        max_iter=100_000,
        polishing=True,
        adaptive_rho_interval=50,
        verbose=False,
    )
    result = solver.solve(raise_error=False)
    return result.x if result.info.status_val == osqp.SolverStatus.OSQP_SOLVED else None


@pytest.mark.parametrize(
    ("H_c", "H_p", "count", "unsolved"),
    [(3, 10, 300, 0), (1, 1, 30, 0), (5, 20, 50, 2), (10, 10, 30, 2), (10, 30, 30, 2)],
)
def test_driver_programs_agree_with_osqp(H_c: int, H_p: int, count: int, unsolved: int) -> None:
    """Beyond the default horizons OSQP stops at its iteration limit now and then; the certificate covers those."""
    rng = np.random.default_rng(100 * H_c + H_p)
    slack = []
    for _ in range(count):
        program = driver_program(rng, H_c, H_p)
        x = assert_solved(program)
        expected = osqp_solution(program)
        slack.append(x[-SLACKS])
        if expected is None:
            unsolved -= 1
        else:
            np.testing.assert_allclose(x, expected, rtol=0.0, atol=1e-6)
    assert unsolved >= 0
    assert np.min(slack) < 1e-9
    assert np.max(slack) > 1e-3


def test_driver_programs_have_certificates() -> None:
    rng = np.random.default_rng(13)
    for i in range(2000):
        assert_solved(driver_program(rng, 3, 10, internal=i % 2 == 1))
