"""Values of the reward's terms, computed by hand."""

import numpy as np
import pytest

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.feedback import reward as rewards
from shared_control_env.core.feedback.reward import STANDARD, TERMS, VALUE
from shared_control_env.core.parameters import Parameters, RewardParameters
from shared_control_env.core.records import MAX_TERMS, SCENE, SIGNALS, TRANSITION, pack


@jit
def evaluate(transition, scene, signals, parameters):
    return rewards.reward(transition[()], scene[()], signals[()], parameters[()])


def parameters_with(**weights):
    addresses, values = np.zeros(MAX_TERMS, dtype=np.int64), np.zeros(MAX_TERMS)
    for i, name in enumerate(STANDARD):
        addresses[i], values[i] = VALUE.address(TERMS[name].value), weights.get(name, 0.0)
    return pack(Parameters(reward=RewardParameters(len(STANDARD), addresses, values)))


def step(
    failed=False,
    last_a=0.0,
    previous_s=0.0,
    z=(0.75, 0.0, 0.0, 15.0, 0.0, 0.0),
    u=(0.0, 0.0),
    u_h=(0.0, 0.0),
    u_a=(0.0, 0.0),
    v=15.0,
):
    transition, scene, signals = np.zeros((), TRANSITION), np.zeros((), SCENE), np.zeros((), SIGNALS)
    transition["failed"], transition["last_a"], transition["previous_s"] = failed, last_a, previous_s
    scene["z"], scene["v_target"], scene["lane_width"] = z, v, 4.0
    signals["u"], signals["u_h_act"], signals["u_a_act"] = u, u_h, u_a
    return transition, scene, signals


DELTA_MAX = np.radians(30.0)
# 15 m/s over 0.05 s is 0.75 m; the lane is 4 m wide, its centre at 0.
CASES = {
    "as fast as wanted": ("progress", {}, 1.0),
    "half as fast": ("progress", {"previous_s": 0.375}, 0.5),
    "backwards at once": ("progress", {"previous_s": 9.0}, -1.0),
    "in the middle": ("lane", {}, 0.0),
    "half way to the line": ("lane", {"z": (0.75, 1.0, 0.0, 15.0, 0.0, 0.0)}, -0.25),
    "far outside": ("lane", {"z": (0.75, -7.0, 0.0, 15.0, 0.0, 0.0)}, -1.0),
    "too slow": ("speed", {"z": (0.75, 0.0, 0.0, 12.0, 0.0, 0.0)}, -0.2),
    "half the pedal": ("effort", {"u_h": (2.5, 0.0)}, -0.25),
    "half the wheel": ("effort", {"u_h": (0.0, -DELTA_MAX / 2)}, -0.25),
    "jerk of 2.5": ("comfort", {"u": (0.125, 0.0)}, -0.125),
    "jerk beyond the limit": ("comfort", {"u": (1.0, 0.0)}, -0.5),
    "1.5 m/s^2 sideways": ("comfort", {"z": (0.75, 0.0, 0.0, 15.0, 0.0, 0.1)}, -0.125),
    "working against it": ("conflict", {"u_h": (2.0, 0.0), "u_a": (-1.0, 0.0)}, -2.0 / 25.0),
    "working with it": ("conflict", {"u_h": (2.0, 0.1), "u_a": (1.0, 0.1)}, 0.0),
    "against its steering": ("conflict", {"u_h": (0.0, 0.1), "u_a": (0.0, -0.2)}, -0.02 / DELTA_MAX**2),
    "no failure": ("failure", {}, 0.0),
    "failure": ("failure", {"failed": True}, -1.0),
}


@pytest.mark.parametrize("case", CASES)
def test_terms(case):
    name, changes, expected = CASES[case]
    transition, scene, signals = step(**changes)
    value = evaluate(transition, scene, signals, parameters_with(**{name: 3.0}))
    assert transition["terms"][STANDARD.index(name)] == pytest.approx(expected, abs=1e-12)
    assert value == pytest.approx(3.0 * expected, abs=1e-12)


def test_every_term_has_a_case():
    assert {name for name, _, _ in CASES.values()} == set(STANDARD)


def test_the_reward_is_the_weighted_sum():
    weights = dict(zip(STANDARD, (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0), strict=True))
    transition, scene, signals = step(
        True, 0.1, 0.5, (1.0, 0.4, 0.0, 13.0, 0.0, 0.05), (0.2, 0.0), (1.0, 0.1), (-1.0, 0.1)
    )
    value = evaluate(transition, scene, signals, parameters_with(**weights))
    assert value == pytest.approx(sum(w * t for w, t in zip(weights.values(), transition["terms"], strict=False)))
