"""Calls by address, and the count that threads share."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError

from shared_control_env.core.records import SCENE
from shared_control_env.vector import solvers
from shared_control_env.vector.intrinsics import fetch_add
from shared_control_env.vector.records import WORKSPACE


def test_a_solver_checks_what_it_is_called_with():
    call = solvers.TRIANGULATE.call

    @njit
    def right(address, scenes, works):
        return call(address, scenes[0], 0, works[0])

    @njit
    def wrong(address, scenes, works):
        return call(address, works[0], 0, scenes[0])

    scenes, works = np.zeros(1, SCENE), np.zeros(1, WORKSPACE)
    scenes[0]["region"] = [0.0, 100.0, -2.0, 6.0]
    assert right(solvers.TRIANGULATE.address, scenes, works) == 2
    with pytest.raises(TypingError, match="other types"):
        wrong(solvers.TRIANGULATE.address, scenes, works)


def test_threads_take_every_piece_once():
    @njit(nogil=True)
    def take(taken, pieces, thread):
        piece = fetch_add(taken, 1, 1)
        while piece < pieces.shape[0]:
            pieces[piece] += thread
            piece = fetch_add(taken, 1, 1)

    take(np.full(2, 9), np.zeros(1), 1.0)
    taken, pieces = np.zeros(2, dtype=np.int64), np.zeros(1_000_000)
    with ThreadPoolExecutor(3) as pool:
        list(pool.map(lambda thread: take(taken, pieces, thread), (1.0, 10.0, 100.0)))
    assert set(np.unique(pieces)) <= {1.0, 10.0, 100.0}
    assert list(taken) == [0, len(pieces) + 3]
