"""The generators in compiled code give NumPy's own numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared_control_env.core import stream

CALLS = st.lists(st.one_of(st.none(), st.integers(1, 2**32 - 1), st.sampled_from([1, 2, 3, 2**31])), max_size=60)


@given(seed=st.integers(0, 2**63), calls=CALLS)
def test_the_numbers_and_the_state_are_numpys(seed, calls):
    generator, row = np.random.default_rng(seed), np.zeros(stream.WORDS, np.uint64)
    stream.state_of(generator, row)
    for n in calls:
        if n is None:
            assert stream.random(row) == generator.random()
        else:
            assert stream.integer(row, n) == generator.integers(n)
    other = np.random.default_rng(0)
    stream.set_state(other, row)
    assert other.bit_generator.state == generator.bit_generator.state


def test_a_range_that_needs_more_than_one_number_is_drawn_as_in_numpy():
    """Lemire's method rejects almost half of the numbers here."""
    n = 2**31 + 1
    generator, row = np.random.default_rng(0), np.zeros(stream.WORDS, np.uint64)
    stream.state_of(generator, row)
    assert [stream.integer(row, n) for _ in range(500)] == generator.integers(n, size=500).tolist()


def test_another_generator_is_refused():
    with pytest.raises(KeyError):
        stream.state_of(np.random.Generator(np.random.MT19937(0)), np.zeros(stream.WORDS, np.uint64))
