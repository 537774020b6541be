import numpy as np
from scipy import stats

from shared_control_env.core.faults.noise import standard_normal, uniform


def test_splitmix64_reference_sequence():
    """First outputs of the reference implementation for the seed 1234567 (Vigna, splitmix64.c)."""
    reference = [6457827717110365317, 3203168211198807973, 9817491932198370423]
    for counter, value in enumerate(reference):
        assert uniform(1234567, counter) == (value >> 11) * 2.0**-53


def test_distributions():
    flat = [uniform(5, i) for i in range(5000)]
    bell = [standard_normal(5, i) for i in range(5000)]
    assert stats.kstest(flat, "uniform").pvalue > 0.01
    assert stats.kstest(bell, "norm").pvalue > 0.01


def test_seeds_are_independent():
    a, b = (np.array([standard_normal(seed, i) for i in range(2000)]) for seed in (1, 2))
    assert abs(np.corrcoef(a, b)[0, 1]) < 0.06
