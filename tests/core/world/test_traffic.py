from math import inf

import numpy as np
import pytest

from shared_control_env.core.parameters import TrafficParameters
from shared_control_env.core.records import ACCELERATION, HEADING, SPEED, YAW_RATE, X, Y, pack
from shared_control_env.core.world import traffic
from shared_control_env.core.world.lane_change import change_progress
from shared_control_env.core.world.road import locate, reference_line
from tests.scenes import STRAIGHT
from tests.scenes import traffic as vehicles

FAR = vehicles((-1000.0, 0.0, 10.0))[0]
NOBODY = vehicles()


def drive(rows, plans, seconds, line=STRAIGHT, ego=FAR, dt=0.05):
    """History of all rows, shape (steps + 1, n, 8)."""
    plans = [pack(plan)[()] for plan in plans]
    history = [rows.copy()]
    for k in range(round(seconds / dt)):
        for row, plan in zip(rows, plans, strict=True):
            traffic.decide_acceleration(row, plan, k * dt, ego, rows, line)
        for row, plan in zip(rows, plans, strict=True):
            traffic.move_along(row, plan, line, k * dt, dt)
        history.append(rows.copy())
    return np.array(history)


def test_idm_equilibrium():
    """At the equilibrium gap (s_0 + v T) / sqrt(1 - (v / v_0)^4) of Treiber et al. the acceleration is 0."""
    for v in (3.0, 8.0, 12.0):
        gap = (traffic.STANDSTILL_GAP + v * traffic.TIME_HEADWAY) / np.sqrt(1.0 - (v / 15.0) ** 4)
        assert traffic.idm_acceleration(v, 15.0, gap, v) == pytest.approx(0.0, abs=1e-12)


def test_idm_free_road_and_limits():
    assert traffic.idm_acceleration(0.0, 15.0, inf, 0.0) == traffic.LARGEST_ACCELERATION
    assert traffic.idm_acceleration(15.0, 15.0, inf, 0.0) == pytest.approx(0.0)
    assert traffic.idm_acceleration(15.0, 15.0, 1.0, 0.0) == -traffic.LARGEST_DECELERATION


def test_idm_follows_the_nearest_ahead_in_its_lane_and_settles():
    rows = vehicles((0.0, 0.0, 10.0), (40.0, 0.0, 8.0), (15.0, 4.0, 1.0))
    plans = [TrafficParameters(follows=True, desired_speed=15.0), TrafficParameters(), TrafficParameters()]
    history = drive(rows, plans, 60.0)
    assert history[-1, 0, SPEED] == pytest.approx(8.0, abs=0.05)
    gap = history[-1, 1, X] - history[-1, 0, X] - 5.0
    assert gap == pytest.approx((2.0 + 8.0 * 1.5) / np.sqrt(1.0 - (8.0 / 15.0) ** 4), abs=0.3)


def test_idm_yields_to_the_ego():
    ego = vehicles((30.0, 0.5, 5.0))[0]
    rows = vehicles((0.0, 0.0, 12.0))
    plan = pack(TrafficParameters(follows=True, desired_speed=15.0))[()]
    traffic.decide_acceleration(rows[0], plan, 0.0, ego, rows, STRAIGHT)
    assert rows[0, ACCELERATION] < -1.0


def test_a_chain_of_followers_never_collides_when_the_first_brakes_to_a_stop():
    rows = vehicles(*[(-25.0 * i, 0.0, 12.0) for i in range(6)])
    plans = [TrafficParameters(brake_onset=1.0, deceleration=5.0)]
    plans += [TrafficParameters(follows=True, desired_speed=13.0)] * 5
    history = drive(rows, plans, 40.0)
    assert (-np.diff(history[:, :, X], axis=1) > 5.0).all()
    assert (history[-1, :, SPEED] < 0.1).all()
    assert (history[:, :, SPEED] >= 0.0).all()


def test_braking_takes_the_distance_it_takes():
    rows = vehicles((0.0, 0.0, 12.0))
    history = drive(rows, [TrafficParameters(brake_onset=1.0, deceleration=4.0)], 8.0)
    assert history[-1, 0, SPEED] == 0.0
    assert history[-1, 0, X] == pytest.approx(12.0 + 12.0**2 / 8.0, abs=1e-6)


@pytest.mark.parametrize("kappa", [0.0, 1 / 80.0, -1 / 80.0])
def test_a_lane_change_ends_in_the_middle_of_the_other_lane(kappa):
    line = reference_line([(400.0, kappa)], lead_in=50.0)
    rows = vehicles((0.0, 0.0, 10.0))
    history = drive(rows, [TrafficParameters(change_onset=1.0, change_duration=3.0, shift=4.0)], 6.0, line=line)
    offsets = np.array([locate(line, row[0, X], row[0, Y])[1] for row in history])
    np.testing.assert_allclose(offsets[:21], 0.0, atol=1e-9)
    np.testing.assert_allclose(offsets[80:], 4.0, atol=1e-9)
    assert (np.diff(offsets) > -1e-9).all()
    speeds = np.hypot(*np.diff(history[:, 0, [X, Y]], axis=0).T) / 0.05
    np.testing.assert_allclose(speeds, 10.0, rtol=0.05)
    if kappa == 0.0:
        assert history[50, 0, HEADING] == pytest.approx(np.arctan2(offsets[50] - offsets[49], 0.5), abs=1e-9)


def test_without_a_plan_it_holds_its_speed_and_turns_with_the_road():
    line = reference_line([(400.0, 1 / 60.0)], lead_in=50.0)
    history = drive(vehicles((0.0, 0.0, 12.0)), [TrafficParameters()], 5.0, line=line)
    assert (history[:, 0, SPEED] == 12.0).all()
    assert locate(line, *history[-1, 0, [X, Y]])[0] == pytest.approx(60.0, abs=1e-9)
    assert history[-1, 0, YAW_RATE] == pytest.approx(12.0 / 60.0)


def test_minimum_jerk_course():
    assert [change_progress(t, 1.0, 2.0) for t in (0.0, 1.0, 2.0, 3.0, 9.0)] == [0.0, 0.0, 0.5, 1.0, 1.0]
    assert change_progress(5.0, inf, 2.0) == 0.0
    t = np.linspace(1.0, 3.0, 400)
    course = np.array([change_progress(x, 1.0, 2.0) for x in t])
    assert (np.diff(course) >= 0.0).all()
    speed = np.gradient(course, t)
    assert speed.max() == pytest.approx(1.875 / 2.0, rel=1e-3)  # 15/8 of the mean
    np.testing.assert_allclose(speed[[0, -1]], 0.0, atol=1e-2)
