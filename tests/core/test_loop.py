"""The loop's halves by themselves: what each signal is, computed by hand from those before it."""

import numpy as np
import pytest

from shared_control_env.core import loop
from shared_control_env.core.authority.laws import LAWS
from shared_control_env.core.batch import Sizes, empty_batch, environment
from shared_control_env.core.compile.jit import jit
from shared_control_env.core.faults.command import PLACES
from shared_control_env.core.feedback.info import INFO, as_batch, as_dict
from shared_control_env.core.parameters import AuthorityParameters, DriverLagParameters, Parameters, TaskParameters
from shared_control_env.core.records import pack
from tests.core.faults.test_command import fault_of, faults_of

PHI = np.exp(-0.05 / 0.2)


@jit
def act(u_h_des, alpha_a, batch):
    e = environment(0, batch)
    e.signals.alpha[0] = e.signals.alpha[1] = alpha_a
    loop.act(u_h_des, e)


@jit
def degrade(batch):
    loop.degrade_command(environment(0, batch))


@jit
def evaluate(batch, steps):
    return loop.evaluate(environment(0, batch), steps)


def batch_of(law="none", fault_at="command", *entries, **task):
    batch = empty_batch(1, Sizes(max(1, len(entries)), 1, 0))
    authority = AuthorityParameters(law=LAWS.index(law), fault_at=PLACES.index(fault_at))
    values = Parameters(authority=authority, lag=DriverLagParameters(0.9, 0.2), task=TaskParameters(**task))
    batch.parameters[0] = pack(values)[()]
    if entries:
        batch.faults[0] = faults_of(*entries)
    return batch


def signal(batch, name):
    return batch.signals[name][0]


@pytest.mark.parametrize(
    ("law", "expected"), [("none", (2.0, 0.1)), ("proportional", (1.0, 0.05)), ("driver_only", (0.0, 0.0))]
)
def test_second_half_under_each_law(law, expected):
    batch = batch_of(law)
    batch.signals["u_a_des"][0], batch.signals["u_a_f"][0] = (1.0, 0.0), (2.0, 0.1)
    batch.memories["u_h_act"][0] = 0.5, -0.02
    act(np.array([1.0, 0.03]), 0.5, batch)
    np.testing.assert_allclose(signal(batch, "u_a_act"), expected)
    np.testing.assert_allclose(signal(batch, "u_h_act"), [0.5, -0.02])  # what was decided before
    np.testing.assert_allclose(signal(batch, "u"), np.array(expected) + [0.5, -0.02])
    lagged = PHI * np.array([0.5, -0.02]) + 0.9 * (1.0 - PHI) * (np.array([1.0, 0.03]) - expected)
    np.testing.assert_allclose(batch.memories["u_h_act"][0], lagged)
    np.testing.assert_allclose(batch.scenes["felt"][0], expected)
    assert (batch.scenes["displayed"][0], signal(batch, "alpha_a")) == (0.5, 0.5)


def test_the_sum_is_kept_within_the_limits():
    batch = batch_of()
    batch.signals["u_a_f"][0], batch.memories["u_h_act"][0] = (4.0, -0.4), (3.0, -0.3)
    act(np.zeros(2), 1.0, batch)
    np.testing.assert_allclose(signal(batch, "u"), [5.0, -np.radians(30.0)])


BIAS = {"size": 0.1, "steering": True}


@pytest.mark.parametrize("place", PLACES)
def test_where_a_bias_of_the_steering_is_seen(place):
    batch = batch_of("proportional", place, fault_of("bias", **BIAS))
    batch.signals["u_a_des"][0] = 1.0, 0.02
    degrade(batch)
    at_actuator = place == "actuator"
    np.testing.assert_allclose(signal(batch, "u_a_f"), [1.0, 0.02 if at_actuator else 0.12])
    np.testing.assert_allclose(signal(batch, "u_a_des"), [1.0, 0.12 if place == "planner" else 0.02])
    act(np.zeros(2), 0.5, batch)
    np.testing.assert_allclose(signal(batch, "u_a_act"), [0.5, 0.5 * 0.02 + 0.1 if at_actuator else 0.06])
    np.testing.assert_allclose(signal(batch, "fault"), [0.0, 0.1])


@pytest.mark.parametrize(
    ("y", "crashed", "k", "s", "ends"),
    [
        (0.0, False, 3, 10.0, (False, False)),
        (0.0, True, 3, 10.0, (True, False)),
        (-2.1, False, 3, 10.0, (True, False)),
        (6.1, False, 3, 10.0, (True, False)),
        (0.0, False, 20, 10.0, (False, True)),
        (0.0, False, 3, 500.0, (False, True)),
        (np.nan, False, 3, 10.0, (True, False)),
    ],
)
def test_how_a_step_ends(y, crashed, k, s, ends):
    batch = batch_of(road_end=400.0)
    batch.scenes["z"][0] = batch.scenes["state"][0] = [s, y, 0.0, 15.0, 0.0, 0.0]
    batch.scenes["k"][0], batch.transitions["crashed"][0] = k, crashed
    _, terminated, truncated = evaluate(batch, 20)
    assert (terminated, truncated) == ends
    assert bool(batch.transitions["failed"][0]) is ends[0]


def test_leaving_the_lane_is_counted_once_each_time():
    batch = batch_of()
    batch.memories["in_lane"], batch.scenes["lane_width"] = True, 4.0
    for y in (0.0, 2.1, 2.5, 1.9, -2.1, 0.0):
        batch.scenes["z"][0, 1] = y
        evaluate(batch, 20)
    assert batch.memories["lane_departures"][0] == 2


def test_info_as_a_dict_and_as_a_batch():
    infos = np.zeros(3, INFO)
    infos["k"], infos["u"][1], infos["rewards"][:, 1], infos["automation"]["failures"][2] = (
        (4, 5, 6),
        (1.0, 2.0),
        (7, 8, 9),
        3,
    )
    one = as_dict(infos[1:2].reshape(()), ("progress", "lane"))
    assert (one["k"], one["rewards"], one["crashed"]) == (5, {"progress": 0.0, "lane": 8.0}, False)
    np.testing.assert_array_equal(one["u"], [1.0, 2.0])
    mask = np.array([True, False, True])
    many = as_batch(infos, mask, ("progress", "lane"))
    assert many["_k"] is mask
    np.testing.assert_array_equal(many["rewards"]["lane"], [7, 8, 9])
    np.testing.assert_array_equal(many["automation"]["failures"], [0, 0, 3])
    assert set(one) | {f"_{name}" for name in one} == set(many)
