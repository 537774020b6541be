"""What highway-env's base offers either acts or says why not; objects travel; types other than Python's are taken."""

import contextlib
import copy
import gc
import inspect
import os
import pickle
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_match import check_environments_match
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import RecordVideo
from highway_env.envs.common.abstract import AbstractEnv

from shared_control_env.controllers.allocators import FixedAuthority
from shared_control_env.controllers.automation import Automation
from shared_control_env.controllers.solution import Solution
from shared_control_env.envs import SharedControlEnv, TwoLaneEnv
from shared_control_env.registration import ENVIRONMENTS
from shared_control_env.wrappers import AuthorityLimiter, DriverModel

TWO_LANE = "SharedControl/TwoLane-v1"
NOTHING = {"driver": np.zeros(2), "authority": np.ones(1)}

# Public members of highway-env's base, and what becomes of each: arguments with which it acts, or words that refuse it.
ACTS = {
    "close": (),
    "configure": ({"duration": 5.0},),
    "default_config": (),
    "define_spaces": (),
    "render": (),
    "reset": (),
    "simplify": (),
    "step": (NOTHING,),
    "update_metadata": (),
    "set_vehicle_field": (("speed", 3.0),),
    "get_wrapper_attr": ("config",),
    "has_wrapper_attr": ("config",),
    "set_wrapper_attr": ("own", 1),
}
REFUSES = {
    "call_vehicle_method": ((("fly", ()),), "no attribute of all"),
    "change_vehicles": (("highway_env.vehicle.behavior.IDMVehicle",), "other_vehicles_type"),
    "get_available_actions": ((), "continuous"),
    "randomize_behavior": ((), "IDMVehicle"),
    "set_preferred_lane": ((1,), "IDMVehicle"),
    "set_record_video_wrapper": ((None,), "RecordVideo"),
    "set_route_at_intersection": (("o1",), "IDMVehicle"),
    "to_finite_mdp": ((), "continuous"),
}


def test_every_public_method_of_the_base_is_looked_at():
    methods = {name for name, _ in inspect.getmembers(AbstractEnv, callable) if not name.startswith("_")}
    assert methods == ACTS.keys() | REFUSES.keys()


@pytest.mark.parametrize("name", ACTS)
def test_it_acts(name):
    env = TwoLaneEnv(render_mode="rgb_array")
    env.reset(seed=0)
    getattr(env, name)(*ACTS[name])


@pytest.mark.parametrize("name", REFUSES)
def test_it_is_refused_in_words(name):
    env = TwoLaneEnv()
    env.reset(seed=0)
    arguments, words = REFUSES[name]
    with pytest.raises(ValueError, match=words):
        getattr(env, name)(*arguments)


def test_highway_envs_own_vehicles_take_its_own_methods():
    env = TwoLaneEnv({"other_vehicles_type": "highway_env.vehicle.behavior.IDMVehicle"})
    env.reset(seed=0)
    assert env.randomize_behavior().step(NOTHING)[0].shape == env.observation.shape
    assert env.simplify().step(NOTHING)[0].shape == env.observation.shape


def test_the_time_is_that_of_the_drive():
    env = TwoLaneEnv({"simulation_frequency": 40})
    env.reset(seed=0)
    for _ in range(30):
        env.step(NOTHING)
    assert env.time == pytest.approx(1.5)
    env.reset()
    assert env.time == 0.0


class Own(TwoLaneEnv):
    def _reward(self, action):
        return 42.0 + super()._reward(action)

    def _rewards(self, action):
        return {"own": 1.0, **super()._rewards(action)}

    def _is_terminated(self):
        return self.steps >= 3

    def _is_truncated(self):
        return self.steps >= 5

    def _info(self, obs, action=None):
        return {**super()._info(obs, action), "mine": True}


def test_overridden_methods_of_a_subclass_act():
    own, plain = AuthorityLimiter(Own()), AuthorityLimiter(TwoLaneEnv())
    assert own.reset(seed=0)[1]["mine"]
    plain.reset(seed=0)
    for k in range(1, 6):
        _, reward, terminated, truncated, info = own.step(np.zeros(2))
        assert reward == 42.0 + plain.step(np.zeros(2))[1]
        assert (terminated, truncated) == (k >= 3, k >= 5)
        assert info["rewards"]["own"] == 1.0
        assert info["mine"]


def test_an_automation_that_is_put_in_stays_over_resets():
    class Coasting:
        def __init__(self):
            self.resets = self.calls = 0

        def reset(self):
            self.resets += 1

        def act(self, scene):
            self.calls += 1
            return Solution(np.array([0.0, 9.0]), True, 0, 0, 0.0, 0.0, 0.0)

    env = gym.make(TWO_LANE, config={"faults": []})
    own = Coasting()
    env.unwrapped.automation = own
    for _ in range(2):
        env.reset(seed=0)
        info = env.step(np.zeros(2))[4]
    assert own.resets == 2
    assert own.calls == 4
    np.testing.assert_allclose(info["u_a_des"], [0.0, np.pi / 6])  # within the limits
    for wrong in (Automation, object()):
        with pytest.raises(ValueError, match=r"reset\(\) and act\(scene\)"):
            env.unwrapped.automation = wrong


def test_an_automation_that_gives_no_command_is_named():
    class Broken:
        def reset(self):
            pass

        def act(self, scene):
            return Solution(np.array([np.nan, 0.0]), True, 0, 0, 0.0, 0.0, 0.0)

    env = TwoLaneEnv()
    env.automation = Broken()
    with pytest.raises(ValueError, match=r"automation: act\(\) gave"):
        env.reset(seed=0)


@pytest.mark.parametrize("answer", [None, np.zeros(2), "left"])
def test_an_automation_that_gives_no_solution_is_named(answer):
    class Odd:
        def reset(self):
            pass

        def act(self, scene):
            return answer

    env = TwoLaneEnv()
    env.automation = Odd()
    with pytest.raises(ValueError, match=r"automation.act\(\) gave .* no controllers.solution.Solution"):
        env.reset(seed=0)


class Scribbles:
    """Writes into all that it is given."""

    def reset(self, seed=None):
        pass

    def act(self, observation, scene):
        scene["z"][:] = 0.0
        observation[:] = 0.0
        return np.zeros(2)

    def allocate(self, scene, signals):
        signals["u_a_f"][:] = 0.0
        scene["z"][:] = 0.0
        return 1.0


def test_what_others_write_into_scenes_and_signals_does_not_reach_the_drive():
    config = {"authority": {"law": "proportional"}}
    quiet = DriverModel(AuthorityLimiter(TwoLaneEnv(config), FixedAuthority(1.0)), Gives(np.zeros(2)))
    loud = DriverModel(AuthorityLimiter(TwoLaneEnv(config), Scribbles()), Scribbles())
    for env in (quiet, loud):
        env.reset(seed=0)
    for _ in range(30):
        np.testing.assert_array_equal(quiet.step(0)[4]["state"], loud.step(0)[4]["state"])
    many = gym.make_vec(TWO_LANE, num_envs=2).unwrapped
    many.reset(seed=0)
    with pytest.raises(ValueError, match="read-only"):
        many.scenes["z"][:] = 0.0


def test_a_driver_who_asks_for_more_than_the_limits_is_clipped_without_a_word():
    env = DriverModel(gym.make(TWO_LANE), Gives([-8.0, 0.0]))
    env.reset(seed=0)
    for _ in range(30):
        info = env.step(0)[4]
    assert info["u_h_des"][0] == -5.0


class Empty:
    """A driver and an automation that counts as nothing where it is asked whether it is."""

    def __bool__(self):
        return False

    def reset(self, seed=None):
        pass

    def act(self, observation, scene=None):
        if scene is not None:
            return np.array([0.5, 0.0])
        return Solution(np.array([0.25, 0.0]), True, 0, 0, 0.0, 0.0, 0.0)


def test_what_counts_as_nothing_is_taken_all_the_same():
    env = DriverModel(gym.make(TWO_LANE, automation=Empty()), Empty())
    env.reset(seed=0)
    info = env.step(0)[4]
    assert info["u_h_des"][0] == 0.5
    assert info["u_a_des"][0] == 0.25


def test_a_person_beside_another_driver_is_refused():
    config = {"person": {"active": True}}
    with pytest.raises(ValueError, match="would not act: another driver is given"):
        DriverModel(gym.make(TWO_LANE, config=config), Gives(np.zeros(2)))
    with pytest.raises(ValueError, match="needs driver=True"):
        gym.make_vec(TWO_LANE, num_envs=2, config=config)
    options = {"config": config}
    with pytest.raises(ValueError, match="would not act: another driver is given"):
        DriverModel(gym.make(TWO_LANE), Gives(np.zeros(2))).reset(options=options)
    many = gym.make_vec(TWO_LANE, num_envs=2)
    for change in (lambda: many.reset(options=options), lambda: many.set_config([{}, config])):
        with pytest.raises(ValueError, match="needs driver=True"):
            change()


def test_numbers_of_numpy_do_not_keep_a_spec_from_json():
    env = gym.make(TWO_LANE, config={"duration": np.float64(3.0), "centering_position": np.array([0.4, 0.5])})
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.config["duration"] == 3.0


def test_a_step_interrupted_in_the_automation_leaves_the_scene_true():
    class Interrupted(Automation):
        def act(self, scene):
            raise KeyboardInterrupt

    env = TwoLaneEnv({"faults": [{"kind": "lane_offset", "onset": 0.0, "size": 1.0}]})
    env.reset(seed=0)
    env.automation = Interrupted(env.parameters)
    with pytest.raises(KeyboardInterrupt):
        env.step(NOTHING)
    assert abs(env.scene["z"][1]) < 0.5


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_environments_travel(name):
    """Pickled, copied, rendered before or not, bare or with a driver, an environment goes on as the original does."""
    for env in (gym.make(name, render_mode="rgb_array"), DriverModel(gym.make(name))):
        env.reset(seed=3)
        action = 0 if isinstance(env.action_space, gym.spaces.Discrete) else np.array([0.1, 0.05])
        for _ in range(8):
            env.step(action)
        if env.render_mode:
            env.render()
        twins = [pickle.loads(pickle.dumps(env)), copy.deepcopy(env)]
        for _ in range(20):
            state = env.step(action)[4]["state"]
            for twin in twins:
                np.testing.assert_array_equal(twin.step(action)[4]["state"], state)


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_a_spec_makes_the_same_environment(name):
    env = gym.make(name, config={"duration": 1.0})
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    check_environments_match(env, again, 12, seed=5, info_comparison="equivalence")


def test_a_long_drive_of_the_predictive_driver_is_copied_too(monkeypatch):
    monkeypatch.setattr("shared_control_env.controllers.driver.KEPT", 15)
    env = DriverModel(gym.make(TWO_LANE))
    env.reset(seed=0)
    for _ in range(40):
        env.step(0)
    twin = copy.deepcopy(env)
    for _ in range(20):
        np.testing.assert_array_equal(env.step(0)[4]["u_h_des"], twin.step(0)[4]["u_h_des"])
    assert len(env.driver._problems) <= 15


WINDOWS = """
import numpy as np, pygame, gymnasium as gym, shared_control_env
first, second = (gym.make("SharedControl/TwoLane-v1", render_mode="human") for _ in range(2))
for env in (first, second):
    env.reset(seed=0)
    env.step(np.zeros(2))
first.close()
assert pygame.display.get_init()
second.step(np.zeros(2))
second.close()
assert not pygame.display.get_init()
hidden = gym.make("SharedControl/TwoLane-v1", render_mode="human", config={"offscreen_rendering": True})
hidden.reset(seed=0)
hidden.step(np.zeros(2))
assert not pygame.display.get_init()
"""


def test_windows_are_closed_by_the_last_that_draws():
    environment = {**os.environ, "SDL_VIDEODRIVER": "dummy"}
    subprocess.run([sys.executable, "-c", WINDOWS], check=True, env=environment, capture_output=True, timeout=120)


def test_a_new_screen_is_drawn_after_a_reset():
    env = TwoLaneEnv(render_mode="rgb_array")
    env.reset(seed=0)
    assert env.render().shape == (452, 1000, 3)
    env.reset(options={"config": {"screen_width": 400, "screen_height": 300}})
    assert env.render().shape == (300, 400, 3)


def test_the_frame_rate_that_a_recorder_was_told_stays():
    env = TwoLaneEnv(render_mode="rgb_array")
    with pytest.raises(ValueError, match=r"'policy_frequency'\] = 5 Hz: pictures"):
        env.reset(options={"config": {"policy_frequency": 5}})
    TwoLaneEnv().reset(options={"config": {"policy_frequency": 5}})


def test_a_recorder_that_is_set_takes_every_simulation_step(tmp_path):
    env = RecordVideo(gym.make(TWO_LANE, render_mode="rgb_array", config={"policy_frequency": 5}), str(tmp_path / "v"))
    env.unwrapped.set_record_video_wrapper(env)
    assert env.frames_per_sec == 20
    env.reset(seed=0)
    for _ in range(5):
        env.step(np.zeros(2))
    assert len(env.recorded_frames) == 1 + 5 * 4
    env.close()


def numbers_of_other_types():
    torch = pytest.importorskip("torch")
    return {
        "numpy": {"duration": np.float64(3.0), "road": {"lanes": np.int64(3)}, "policy_frequency": np.int32(10)},
        "whole floats": {"policy_frequency": 10.0, "ego": {"lane": 0.0}},
        "tuples": {"vehicles": ({"lane": 0, "position": 30.0, "speed": 10.0},), "centering_position": (0.4, 0.5)},
        "arrays": {"centering_position": np.array([0.4, 0.5]), "duration": np.array(3.0)},
        "tensors": {"duration": torch.tensor(3.0), "centering_position": torch.tensor([0.5, 0.5])},
        "texts": {"authority": {"law": np.str_("none")}, "real_time_rendering": np.bool_(True)},
    }


@pytest.mark.parametrize("kind", ["numpy", "whole floats", "tuples", "arrays", "tensors", "texts"])
def test_settings_of_other_types_are_taken(kind):
    config = numbers_of_other_types()[kind]
    env = gym.make(TWO_LANE, config=config)
    env.reset(seed=0)
    gym.make_vec(TWO_LANE, num_envs=np.int64(2), config=config)
    env.spec.copy() if hasattr(env.spec, "copy") else copy.copy(env.spec)


@pytest.mark.parametrize("seed", [np.int64(3), np.array(3), np.uint8(3)])
def test_seeds_of_other_types(seed):
    env, many = gym.make(TWO_LANE), gym.make_vec("SharedControl/Bend-v1", num_envs=2)
    np.testing.assert_array_equal(env.reset(seed=seed)[0], env.reset(seed=3)[0])
    np.testing.assert_array_equal(many.reset(seed=seed)[0], many.reset(seed=3)[0])
    np.testing.assert_array_equal(many.reset(seed=np.array([3, 4]))[0], many.reset(seed=(3, 4))[0])


@pytest.mark.parametrize("seed", [-1, 2.5, "3", True, np.array([1, 2, 3])])
def test_what_is_no_seed_is_refused(seed):
    for env in (gym.make(TWO_LANE), gym.make_vec(TWO_LANE, num_envs=2)):
        with pytest.raises(ValueError, match="seed"):
            env.reset(seed=seed)


@pytest.mark.parametrize(
    "mode", [each for mode in AutoresetMode for each in (mode, mode.name, mode.value, mode.name.lower())]
)
def test_autoreset_modes_by_any_name(mode):
    env = gym.make_vec(TWO_LANE, num_envs=2, autoreset_mode=mode)
    assert env.metadata["autoreset_mode"].name.lower().replace("_", "") in str(mode).lower().replace("_", "")


class Gives:
    def __init__(self, value):
        self.value = value

    def reset(self, seed=None):
        pass

    def act(self, observation, scene):
        return self.value

    def allocate(self, scene, signals):
        return self.value


@pytest.mark.parametrize("alpha_a", [0.5, np.float32(0.5), np.array([0.5]), np.array([[0.5]]), [0.5]])
def test_authorities_of_other_types(alpha_a):
    env = AuthorityLimiter(TwoLaneEnv(), Gives(alpha_a))
    env.reset(seed=0)
    assert env.step(np.zeros(2))[4]["alpha_a"] == pytest.approx(0.5)


@pytest.mark.parametrize("alpha_a", [None, np.nan, [0.5, 0.5, 0.5], "much"])
def test_what_is_no_authority_is_named(alpha_a):
    env = AuthorityLimiter(TwoLaneEnv(), Gives(alpha_a))
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"allocate\(\) gave"):
        env.step(np.zeros(2))


@pytest.mark.parametrize("command", [None, [np.nan, 0.0], [1.0], "left"])
def test_what_is_no_command_is_named(command):
    env = DriverModel(gym.make(TWO_LANE), Gives(command))
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"act\(\) gave"):
        env.step(0)


def test_commands_in_other_units_are_told():
    env, many = gym.make(TWO_LANE), gym.make_vec(TWO_LANE, num_envs=3)
    for each in (env, many):
        each.reset(seed=0)
    for _ in range(19):
        env.step([-2.0, 0.01])  # m/s^2 and rad
        many.step(np.array([[0.0, 0.0], [-2.0, 0.0], [0.5, 0.0]]))
    env.step([-0.9, 0.0])
    for _ in range(19):
        env.step([-2.0, 0.01])
    with pytest.warns(UserWarning, match=r"(?s)shares of the limits.*action_of"):
        env.step([-2.0, 0.01])
    with pytest.warns(UserWarning, match="clipped for 20 steps"):
        many.step(np.array([[0.0, 0.0], [-2.0, 0.0], [0.5, 0.0]]))
    env.step([-2.0, 0.01])  # said once


def test_a_command_becomes_an_action():
    env = gym.make(TWO_LANE).unwrapped
    np.testing.assert_allclose(env.action_of([2.5, -np.pi / 12]), [0.5, -0.5])
    with contextlib.closing(gym.make(TWO_LANE)) as driven:
        driven.reset(seed=0)
        np.testing.assert_allclose(driven.step(env.action_of([1.0, 0.1]))[4]["u_h_des"], [1.0, 0.1], rtol=1e-6)


@pytest.mark.parametrize(
    "path",
    [
        "os.system",
        "math.pi",
        "builtins.dict",
        "..",
        "",
        "highway_env.vehicle.objects.Obstacle",
        "nothing.Here",
        "highway_env.vehicles.behavior.IDMVehicle",
        "shared_control_env.envs.highway.vehicles.EgoVehicle",
        "shared_control_env.envs.highway.vehicles.ArrayVehicle",
    ],
)
def test_other_vehicles_are_vehicles(path):
    with pytest.raises(ValueError, match="other_vehicles_type"):
        TwoLaneEnv({"other_vehicles_type": path})


def test_a_setting_imports_nothing(tmp_path, monkeypatch):
    (tmp_path / "intruder_module.py").write_text("raise SystemExit('imported')")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ValueError, match="imported already"):
        TwoLaneEnv({"other_vehicles_type": "intruder_module.Vehicle"})


def test_the_ego_cannot_be_replaced_by_another_kind():
    env = TwoLaneEnv()
    with pytest.raises(ValueError, match="EgoVehicle"):
        env.vehicle = env.road.vehicles[1]


def test_environments_are_freed():
    import weakref

    env = SharedControlEnv(render_mode="rgb_array")
    env.reset(seed=0)
    env.render()
    reference = weakref.ref(env)
    env.close()
    del env
    gc.collect()
    assert reference() is None
