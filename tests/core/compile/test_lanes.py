"""Lanes against NumPy's arithmetic on each of them, to the bit."""

import numpy as np
import pytest

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.compile.lanes import (
    WIDTH,
    choose,
    holds_in_any,
    load,
    root,
    spread,
    store,
)


@jit
def arithmetic(x, y, out):
    a, b = load(x), load(y)
    store(out[0], a + b - 2.0 * a * b)
    store(out[1], -a / b + 1 / a)
    store(out[2], choose((a < b) & ~(a == 0.0), a, 7.0))
    store(out[3], choose((a >= b) | (b > 3), spread(1.0), b))
    store(out[4], root(a * a + 1.0))
    store(out[5], 3)


@jit
def truths(x):
    a = load(x)
    return holds_in_any(a < 0.0), holds_in_any(a <= 0.0)


@jit
def scalars(x, y):
    return choose(x < y, x, 7), root(x)


def test_every_operation_is_that_of_the_numbers():
    rng = np.random.default_rng(0)
    for _ in range(50):
        a, b = rng.normal(size=(2, WIDTH)) * 10.0 ** rng.integers(-3, 2)
        a[rng.integers(WIDTH)] = 0.0
        b[rng.integers(WIDTH)] = np.inf
        out = np.full((6, WIDTH), np.nan)
        arithmetic(a, b, out)
        with np.errstate(all="ignore"):
            expected = np.array(
                [
                    a + b - 2.0 * a * b,
                    -a / b + 1.0 / a,
                    np.where((a < b) & (a != 0.0), a, 7.0),
                    np.where((a >= b) | (b > 3.0), 1.0, b),
                    np.sqrt(a * a + 1.0),
                    np.full(WIDTH, 3.0),
                ]
            )
        np.testing.assert_array_equal(out, expected)


@pytest.mark.parametrize("lane", range(WIDTH))
def test_what_holds_in_one_lane_holds_in_any(lane):
    x = np.ones(WIDTH)
    assert truths(x) == (False, False)
    x[lane] = 0.0
    assert truths(x) == (False, True)
    x[lane] = -1.0
    assert truths(x) == (True, True)
    x[lane] = np.nan  # a comparison with it does not hold
    assert truths(x) == (False, False)


def test_the_functions_take_single_numbers_too():
    assert scalars(1.0, 2.0) == (1.0, 1.0)
    assert scalars(4.0, 2.0) == (7.0, 2.0)
