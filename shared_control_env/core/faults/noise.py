"""Random numbers for compiled steps, as functions of a seed and a counter, so that no state needs to be carried."""

from __future__ import annotations

from math import cos, exp, log, pi, sqrt

import numpy as np

from shared_control_env.core.compile.jit import jit

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1, _MIX_2 = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_SHIFTS = (np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11))
_UNIT = 2.0**-53


@jit
def uniform(seed: int, counter: int) -> float:
    """Uniform random number in [0, 1): entry ``counter`` of the SplitMix64 sequence of a seed.

    SplitMix64 is given by Steele, Lea & Flood, Fast Splittable Pseudorandom Number Generators, OOPSLA 2014, Fig. 16.

    Args:
        seed: seed of the sequence.
        counter: index of the entry.
    """
    z = np.uint64(seed) + np.uint64(counter + 1) * _GOLDEN
    z = (z ^ (z >> _SHIFTS[0])) * _MIX_1
    z = (z ^ (z >> _SHIFTS[1])) * _MIX_2
    z = z ^ (z >> _SHIFTS[2])
    return np.float64(z >> _SHIFTS[3]) * _UNIT


@jit
def standard_normal(seed: int, counter: int) -> float:
    """Standard normal random number by the Box-Muller transform of two entries of :func:`uniform`.

    Args:
        seed: seed of the sequence.
        counter: index of the number; it uses the entries 2 counter and 2 counter + 1 of the sequence.
    """
    radius = sqrt(-2.0 * log(1.0 - uniform(seed, 2 * counter)))
    return radius * cos(2.0 * pi * uniform(seed, 2 * counter + 1))


@jit
def coloured(previous: float, seed: int, counter: int, k: int, time_constant: float, dt: float) -> float:
    """Coloured noise: value x_k of a stationary first-order process of unit variance.

    ::

        x_0 = n_0,   x_k = phi x_k-1 + sqrt(1 - phi^2) n_k,   phi = exp(-dt / time_constant)

    Args:
        previous: x_k-1 [-]; not used at k = 0.
        seed, counter: seed and index of n_k, see :func:`standard_normal`.
        k: index of the time step.
        time_constant: correlation time of the process [s].
        dt: duration of a time step [s].

    Returns:
        x_k [-].
    """
    n = standard_normal(seed, counter)
    if k == 0:
        return n
    phi = exp(-dt / time_constant)
    return phi * previous + sqrt(1.0 - phi * phi) * n
