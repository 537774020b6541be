from math import inf

import numpy as np
import pytest

from shared_control_env.controllers.allocators import (
    Allocator,
    FixedAuthority,
    HardTakeover,
    LinearAuthority,
    SoftmaxAuthority,
    TimeBasedAuthority,
)
from shared_control_env.core.records import SCENE, SIGNALS
from shared_control_env.envs import TwoLaneEnv
from shared_control_env.wrappers import AuthorityLimiter, DriverModel

ALL = (FixedAuthority, LinearAuthority, SoftmaxAuthority, HardTakeover, TimeBasedAuthority)


def situation(r_x=0.0, r_y=0.0, t=0.0):
    scene, signals = np.zeros((), SCENE), np.zeros((), SIGNALS)
    scene["t"], signals["r_x"], signals["r_y"] = t, r_x, r_y
    return scene, signals


@pytest.mark.parametrize("cls", ALL)
def test_is_an_allocator_that_gives_numbers(cls):
    allocator = cls()
    assert isinstance(allocator, Allocator)
    allocator.reset(seed=0)
    assert isinstance(float(allocator.allocate(*situation())), float)


@pytest.mark.parametrize("cls", [LinearAuthority, SoftmaxAuthority])
def test_authority_falls_with_either_risk(cls):
    for risk in ("r_x", "r_y"):
        values = [cls().allocate(*situation(**{risk: r})) for r in np.linspace(0.0, 1.0, 21)]
        assert (np.diff(values) < 0.0).all()
        assert values[0] > 0.99
        assert values[-1] < 0.01


def test_softmax_is_even_at_the_accepted_risk():
    assert SoftmaxAuthority(0.4).allocate(*situation(r_x=0.4)) == pytest.approx(0.5)


def test_takeover_has_hysteresis():
    takeover = HardTakeover(high=0.6, low=0.2, hold=1.0)
    course = [(0.0, 0.5), (0.1, 0.7), (0.2, 0.3), (0.5, 0.1), (1.0, 0.25), (1.2, 0.1), (2.1, 0.1), (2.3, 0.1)]
    decided = [takeover.allocate(*situation(r_y=risk, t=t)) for t, risk in course]
    assert decided == [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    takeover.allocate(*situation(r_y=1.0, t=3.0))
    takeover.reset()
    assert takeover.allocate(*situation(r_y=0.3)) == 1.0


def test_time_based():
    allocator = TimeBasedAuthority(low=0.5, high=2.0, horizon=0.5)
    scene, signals = situation()
    assert allocator.time_to_collision(scene, signals) == inf
    assert allocator.time_to_lane_crossing(scene, signals) == inf
    scene["neighbours"][2], scene["bodies"] = (1.0, 20.0, 0.0, 8.0, 0.0), 5.0
    signals["prediction"][3] = 13.0
    assert allocator.time_to_collision(scene, signals) == pytest.approx(3.0)
    scene["z"][1], signals["prediction_road"][1] = 0.5, 1.0  # 1 m/s to the left, 1.5 m from the edge
    assert allocator.time_to_lane_crossing(scene, signals) == pytest.approx(1.5)
    assert allocator.allocate(scene, signals) == pytest.approx((1.5 - 0.5) / 1.5)
    signals["prediction_road"][1] = 0.0
    assert allocator.time_to_lane_crossing(scene, signals) == pytest.approx(2.5)


def test_the_limiter_takes_any_allocator():
    env = DriverModel(AuthorityLimiter(TwoLaneEnv({"authority": {"law": "proportional"}}), FixedAuthority(0.25)))
    env.reset(seed=0)
    assert env.step(0)[4]["alpha_a"] == 0.25
    with pytest.raises(ValueError, match="allocate"):
        AuthorityLimiter(TwoLaneEnv(), object())
