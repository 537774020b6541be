import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

import shared_control_env  # noqa: F401
from shared_control_env.controllers.allocators import FixedAuthority
from shared_control_env.controllers.solution import Solution
from shared_control_env.core.authority.fuzzy import OPERATORS, authority
from shared_control_env.envs import TwoLaneEnv
from shared_control_env.wrappers import AuthorityLimiter, DriverModel, open_slots


class Steady:
    """A driver that holds one command and counts its calls."""

    def __init__(self, command=(0.5, 0.02)):
        self.command, self.seeds, self.observations = np.array(command), [], []

    def reset(self, seed=None):
        self.seeds.append(seed)

    def act(self, observation, scene):
        self.observations.append(observation)
        return self.command


def test_slots_of_every_combination():
    bare = TwoLaneEnv()
    assert set(bare.action_space) == {"driver", "authority"}
    limited, driven = AuthorityLimiter(TwoLaneEnv()), DriverModel(TwoLaneEnv())
    both = DriverModel(AuthorityLimiter(TwoLaneEnv()))
    assert open_slots(limited) == ("driver",)
    assert open_slots(driven) == ("authority",)
    assert open_slots(both) == ()
    assert limited.action_space == spaces.Box(-1.0, 1.0, (2,), np.float32)
    assert driven.action_space == spaces.Box(0.0, 1.0, (1,), np.float32)
    assert both.action_space == spaces.Discrete(1)


def test_order_of_the_wrappers_does_not_matter():
    one = DriverModel(AuthorityLimiter(TwoLaneEnv()))
    other = AuthorityLimiter(DriverModel(TwoLaneEnv()))
    for env in (one, other):
        env.reset(seed=0)
    for _ in range(50):
        a, b = one.step(0), other.step(0)
        np.testing.assert_array_equal(a[0], b[0])
        assert a[1] == b[1]
        np.testing.assert_array_equal(a[4]["u"], b[4]["u"])


def test_limiter_is_the_fuzzy_inference_of_the_assessed_risk():
    env = DriverModel(gym.make("SharedControl/TwoLane-v1"))
    env.reset(seed=0)
    values = []
    for _ in range(60):
        info = env.step(0)[4]
        assert info["alpha_a"] == authority(info["r_x"], info["r_y"], 0)
        values.append(info["alpha_a"])
    assert max(values) == pytest.approx(1.0)
    assert min(values) < 0.4


@pytest.mark.parametrize("operators", OPERATORS)
def test_none_in_the_slot_is_the_fuzzy_inference_of_the_settings(operators):
    bare, given = TwoLaneEnv({"authority": {"operators": operators}}), TwoLaneEnv()
    bare.reset(seed=0)
    given.reset(seed=0)
    steering = np.array([0.0, 0.05])
    seen = set()
    for _ in range(30):
        alpha = authority(float(given.signals["r_x"]), float(given.signals["r_y"]), OPERATORS.index(operators))
        seen.add(alpha)
        expected = given.step({"driver": steering, "authority": [alpha]})
        found = bare.step({"driver": steering, "authority": None})
        assert found[4]["alpha_a"] == expected[4]["alpha_a"]
        np.testing.assert_array_equal(found[0], expected[0])
    assert len(seen) > 5


def test_the_allocator_in_use_is_shown_and_cannot_be_assigned():
    limited = AuthorityLimiter(TwoLaneEnv({"authority": {"operators": OPERATORS[1]}}))
    assert limited.allocator.operators == OPERATORS[1]
    given = FixedAuthority(0.5)
    assert AuthorityLimiter(TwoLaneEnv(), given).allocator is given
    with pytest.raises(AttributeError):
        limited.allocator = given


def test_allocators_action_is_alpha():
    env = DriverModel(TwoLaneEnv({"authority": {"law": "proportional"}}))
    env.reset(seed=0)
    info = env.step(np.array([0.25], dtype=np.float32))[4]
    assert info["alpha_a"] == 0.25
    np.testing.assert_allclose(info["u_a_act"], 0.25 * info["u_a_f"])


def test_any_driver_plugs_in():
    driver = Steady()
    env = DriverModel(gym.make("SharedControl/TwoLane-v1"), driver)
    observation, _ = env.reset(seed=0)
    _, _, _, _, info = env.step(0)
    np.testing.assert_allclose(info["u_h_des"], driver.command)
    np.testing.assert_array_equal(driver.observations[0], observation)
    assert "driver" not in info


def test_drivers_seed_comes_from_the_environments_generator():
    seeds = []
    for seed in (1, 1, 2):
        driver = Steady()
        DriverModel(gym.make("SharedControl/TwoLane-v1"), driver).reset(seed=seed)
        seeds.append(driver.seeds[-1])
    assert seeds[0] == seeds[1] != seeds[2]


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: AuthorityLimiter(AuthorityLimiter(TwoLaneEnv())), "bound already"),
        (lambda: DriverModel(DriverModel(TwoLaneEnv())), "bound already"),
        (lambda: DriverModel(TwoLaneEnv(), driver=object()), "must be an object with reset"),
        (lambda: DriverModel(TwoLaneEnv(), driver=Steady), "must be an object with reset"),
        (lambda: AuthorityLimiter(TwoLaneEnv(), allocator=FixedAuthority), "must be an object with reset"),
        (lambda: AuthorityLimiter(gym.make("CartPole-v1")), "SharedControlEnv"),
    ],
)
def test_refused(build, message):
    with pytest.raises(ValueError, match=message):
        build()


@pytest.mark.parametrize("command", [(np.nan, 0.0), (0.0, 0.0, 0.0)])
def test_a_drivers_malformed_command_moves_nothing(command):
    env = DriverModel(gym.make("SharedControl/TwoLane-v1"), Steady(command))
    env.reset(seed=0)
    state = env.unwrapped.vehicle.array.copy()
    with pytest.raises(ValueError, match=r"driver: act\(\) gave"):
        env.step(0)
    np.testing.assert_array_equal(env.unwrapped.vehicle.array, state)


def test_the_limiter_can_be_left_out():
    env = gym.make("SharedControl/TwoLane-v1", limiter=False)
    assert open_slots(env) == ("driver", "authority")
    limited = AuthorityLimiter(env)
    plain = gym.make("SharedControl/TwoLane-v1")
    np.testing.assert_array_equal(limited.reset(seed=0)[0], plain.reset(seed=0)[0])
    np.testing.assert_array_equal(limited.step(np.zeros(2))[0], plain.step(np.zeros(2))[0])
    assert open_slots(gym.make(env.spec)) == ("driver", "authority")
    with pytest.raises(ValueError, match="allocator = 'fuzzy' must be an object"):
        gym.make("SharedControl/TwoLane-v1", limiter="fuzzy")


def test_another_automation_is_made_with_the_environment():
    class Braking:
        def reset(self):
            pass

        def act(self, scene):
            return Solution(np.array([-2.0, 0.0]), True, 0, 0, 0.0, 0.0, 0.0)

    env = gym.make("SharedControl/TwoLane-v1", automation=Braking(), config={"faults": []})
    for _ in range(2):
        env.reset(seed=0)
        np.testing.assert_array_equal(env.step(np.zeros(2))[4]["u_a_des"], [-2.0, 0.0])
    with pytest.raises(ValueError, match=r"reset\(\) and act\(scene\)"):
        gym.make("SharedControl/TwoLane-v1", automation=Braking)
    with pytest.raises(ValueError, match="automation: another one is not in the kernel"):
        gym.make_vec("SharedControl/TwoLane-v1", num_envs=2, automation=Braking())
