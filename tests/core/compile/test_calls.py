"""Calls by address, and the count that threads share."""

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError

from shared_control_env.core.compile.atomics import fetch_add
from shared_control_env.core.compile.calls import Interface
from shared_control_env.core.records import SCENE
from shared_control_env.core.risk.finding import FINDING, TRIANGULATE, triangulate


def test_a_solver_checks_what_it_is_called_with():
    call = TRIANGULATE.call

    @njit
    def right(address, scenes, works):
        return call(address, scenes[0], 0, works[0])

    @njit
    def wrong(address, scenes, works):
        return call(address, works[0], 0, scenes[0])

    scenes, works = np.zeros(1, SCENE), np.zeros(1, FINDING)
    scenes[0]["region"] = [0.0, 100.0, -2.0, 6.0]
    assert right(TRIANGULATE.address(triangulate), scenes, works) == 2
    with pytest.raises(TypingError, match="compiled for"):
        wrong(TRIANGULATE.address(triangulate), scenes, works)


def test_what_numba_cannot_compile_is_refused_by_name():
    def half(u):
        return u.no_such_thing

    with pytest.raises(ValueError, match="half cannot be compiled"):
        Interface(float, float).address(half)


def test_a_function_that_raises_is_refused():
    def positive(x):
        if x < 0.0:
            raise ValueError
        return x

    with pytest.raises(ValueError, match="positive raises errors"):
        Interface(float, float).address(positive)


def test_a_function_is_compiled_once_and_called_by_its_address():
    interface = Interface(float, float)
    call = interface.call

    def double(x):
        return 2.0 * x

    @njit
    def through(address, x):
        return call(address, x)

    assert interface.address(double) == interface.address(double) != 0
    assert through(interface.address(double), 1.5) == 3.0


def test_threads_take_every_piece_once():
    together = Barrier(2)

    @njit(nogil=True)
    def take(taken, pieces, thread):
        piece = fetch_add(taken, 1, 1)
        while piece < pieces.shape[0]:
            pieces[piece] += thread
            piece = fetch_add(taken, 1, 1)

    take(np.full(2, 9), np.zeros(1, dtype=np.int8), 1)
    taken, pieces = np.zeros(2, dtype=np.int64), np.zeros(20_000_000, dtype=np.int8)

    def take_as(thread):
        together.wait()  # or the first would have taken all before the second begins
        take(taken, pieces, thread)

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(take_as, (1, 10)))
    assert set(np.unique(pieces)) <= {1, 10}
    assert list(taken) == [0, len(pieces) + 2]
