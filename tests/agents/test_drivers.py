"""One face for all drivers: each of them drives, is evaluated, and is found by its name or its file."""

import zipfile

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the extra 'train'")

from stable_baselines3 import A2C, DQN, PPO, SAC

from agents.drivers import authority_entry, driver_entry, shipped
from agents.model_driver import ModelDriver
from agents.vec_envs import make_environment
from shared_control_env.controllers.driver import Driver, PredictiveDriver
from shared_control_env.controllers.recorded import RecordedDriver, RecordingDriver
from shared_control_env.core.parameters import Limits
from shared_control_env.core.records import SCENE
from shared_control_env.evaluation import Suite, evaluate
from shared_control_env.learned.history import HISTORY, History
from shared_control_env.learned.policy import LearnedDriver, Policy
from shared_control_env.learned.views import (
    ALLOCATOR_FEATURES,
    DEAD_ZONE,
    DRIVER_FEATURES,
    allocator_view,
    command,
    driver_view,
)
from shared_control_env.wrappers import DriverModel

ID = "SharedControl/TwoLane-v1"
CONFIG = {"duration": 1.0, "authority": {"law": "proportional"}}


def drive(driver, seed=0):
    env = DriverModel(gym.make(ID, config=CONFIG), driver)
    env.reset(seed=seed)
    return np.array([env.step(0)[4]["z"] for _ in range(20)])


def test_a_recording_of_a_drive_drives_the_same_again(tmp_path):
    recording = RecordingDriver(PredictiveDriver())
    first = drive(recording)
    recording.save(tmp_path / "drive.csv")
    entry = driver_entry(str(tmp_path / "drive.csv"))
    np.testing.assert_array_equal(drive(entry.make()), first)
    assert np.abs(drive(RecordedDriver([[0.0, 0.0, 0.0]])) - first).max() > 1e-3
    with pytest.raises(FileExistsError):
        recording.save(tmp_path / "drive.csv")


def test_a_recording_is_read_at_its_own_times():
    driver = RecordedDriver([[0.0, 1.0, 0.0], [1.0, 3.0, -0.2]])
    scene = {"t": 0.25}
    np.testing.assert_allclose(driver.act(None, scene), [1.5, -0.05])
    np.testing.assert_allclose(driver.act(None, {"t": 9.0}), [3.0, -0.2])


@pytest.mark.parametrize(
    ("samples", "message"),
    [
        (np.zeros((0, 3)), r"shape \(0, 3\)"),
        (np.zeros((4, 2)), r"shape \(4, 2\)"),
        ([[0.0, np.nan, 0.0]], "not finite in row 0"),
        ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], "does not rise after row 1"),
    ],
)
def test_what_is_no_recording_is_refused(samples, message):
    with pytest.raises(ValueError, match=message):
        RecordedDriver(samples)


def test_a_file_that_is_no_recording_is_refused(tmp_path):
    (tmp_path / "other.csv").write_text("time,wheel\n0,1\n")
    with pytest.raises(ValueError, match="begins with 't,a,delta'"):
        driver_entry(str(tmp_path / "other.csv"))


@pytest.mark.parametrize("algorithm", [PPO, SAC])
def test_models_of_stable_baselines_drive(tmp_path, algorithm):
    model = algorithm("MlpPolicy", gym.make(ID, config=CONFIG), device="cpu", seed=0)
    model.save(tmp_path / "model.zip")
    entry = driver_entry(str(tmp_path / "model.zip"), trusted=True)
    np.testing.assert_array_equal(drive(entry.make()), drive(ModelDriver(model)))
    assert isinstance(entry.make(), Driver)
    assert len(evaluate({"model": entry}, "proportional", Suite("s", ("two_lane",), (None,)))) == 1


def test_models_that_are_no_drivers_are_refused(tmp_path):
    A2C("MlpPolicy", gym.make("Pendulum-v1"), device="cpu").save(tmp_path / "a2c.zip")
    with pytest.raises(ValueError, match=r"shape \(3,\)"):
        driver_entry(str(tmp_path / "a2c.zip"), trusted=True).make()
    with pytest.raises(ValueError, match="no such file"):
        driver_entry("missing.zip")
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
        archive.writestr("text", "text")
    with pytest.raises(ValueError, match=r"other\.zip.* is no model"):
        driver_entry(str(tmp_path / "other.zip"), trusted=True)
    env = gym.make("CartPole-v1")
    DQN("MlpPolicy", env, buffer_size=10, device="cpu").save(tmp_path / "dqn.zip")
    with pytest.raises(ValueError, match="holds a DQNPolicy"):
        driver_entry(str(tmp_path / "dqn.zip"), trusted=True)


def test_names():
    assert driver_entry("mpc").make is None
    assert driver_entry("scripted").make is not None
    with pytest.raises(ValueError, match="did you mean 'scripted'"):
        driver_entry("scriptd")
    assert authority_entry("fixed").law == "proportional"
    with pytest.raises(ValueError, match="did you mean 'takeover'"):
        authority_entry("takover")


@pytest.mark.parametrize("task", ["driver", "allocator"])
def test_five_policies_of_each_task_ship(task):
    policies = shipped(task)
    assert len(policies) == 5
    assert all(path.stat().st_size < 1_000_000 for path in policies.values())
    make = driver_entry if task == "driver" else authority_entry
    for name in policies:
        make(name).make().reset(seed=0)


def test_history_shows_the_newest_and_the_changes():
    history = History(2, 3)
    rng = np.random.default_rng(0)
    seen = rng.normal(size=(6, 2, 3)).astype(np.float32)
    for k, observations in enumerate(seen):
        if k == 4:
            history.forget(np.array([False, True]))
        would = history.would_see(observations[0], 0)
        found = history.push(observations).reshape(2, HISTORY, 3)
        if k > 0:  # an episode has begun
            np.testing.assert_array_equal(found[0].ravel(), would)
        past = [[seen[max(k - j, 0 if i == 0 or k < 4 else 4), i] for j in range(HISTORY)] for i in range(2)]
        for i in range(2):
            np.testing.assert_array_equal(found[i, 0], past[i][0])
            np.testing.assert_allclose(found[i, 1:], -np.diff(past[i], axis=0), atol=1e-7)


def test_views_hold_what_they_name_and_no_fault():
    env = DriverModel(gym.make(ID, config=CONFIG))
    observation, info = env.reset(seed=0)
    for _ in range(15):
        observation, _, _, _, info = env.step(0)
    scene, signals = env.shared.scene, env.shared.signals
    driver = dict(zip([name for name, _ in DRIVER_FEATURES], driver_view(observation, scene["felt"]), strict=True))
    np.testing.assert_allclose(
        driver["automation's steering as felt [rad]"], info["u_a_act"][1] / np.radians(30.0), rtol=1e-6
    )
    gap = 100.0 * observation[19] - 5.0
    assert driver["gap to the preceding vehicle, ln(1 + gap / 1 m) [-]"] == pytest.approx(np.log(1 + gap) / np.log(96))
    view = dict(zip([name for name, _ in ALLOCATOR_FEATURES], allocator_view(scene, signals), strict=True))
    assert view["lateral risk r_y [-]"] == pytest.approx(float(signals["r_y"]))
    assert view["preceding distance along the road [m]"] == pytest.approx(observation[19], rel=1e-5)
    assert view["automation's degraded steering u_a,f [rad]"] == pytest.approx(signals["u_a_f"][1] / np.radians(30.0))
    for name in (*driver, *view):
        assert "fault" not in name


@pytest.mark.parametrize(
    ("present", "distance", "relative_speed", "expected"),
    [
        (1.0, 25.0, -4.0, (21.0, 4.0 / 20.0, 16.0 / 40.0)),  # closing in
        (1.0, 25.0, 4.0, (21.0, -4.0 / 20.0, 0.0)),  # falling behind
        (1.0, 5.0, -0.02, (1.1, 0.02 / 0.1, 0.0004 / 0.2)),  # touching
        (0.0, 0.0, 0.0, (96.0, 0.0, 0.0)),  # nobody ahead
    ],
)
def test_a_driver_sees_how_the_vehicle_ahead_grows(present, distance, relative_speed, expected):
    observation = np.zeros(25)
    observation[18:22] = present, distance / 100.0, 0.0, relative_speed / 20.0
    grown, inverse, needed = driver_view(observation, np.zeros(2))[-3:]
    np.testing.assert_allclose(np.exp(grown * np.log(96.0)), expected[0], rtol=1e-5)
    assert inverse == pytest.approx(expected[1])
    assert needed * Limits().a_max == pytest.approx(expected[2])


def test_a_policy_that_asks_for_little_leaves_the_wheel_alone():
    weights = np.zeros((2, HISTORY * len(DRIVER_FEATURES)))
    little = np.full(2, 0.9 * DEAD_ZONE)
    driver = LearnedDriver(Policy([(weights, little)], "tanh", False, {"task": "driver", "dead_zone": DEAD_ZONE}))
    observation, scene = np.zeros(25), np.zeros(1, SCENE)[0]
    np.testing.assert_array_equal(driver.act(observation, scene), [0.0, 0.0])
    envs = [make_environment(["SharedControl/LaneKeeping-v1"], "driver", 2, 0) for _ in range(2)]
    for env in envs:
        env.reset()
    seen = [env.step(np.tile(action, (2, 1)))[0] for env, action in zip(envs, (little, np.zeros(2)), strict=True)]
    np.testing.assert_array_equal(*seen)


def test_hands_that_ask_for_little_rest():
    asked = np.linspace(-1.0, 1.0, 2001)
    given = command(asked)
    assert (given[np.abs(asked) <= DEAD_ZONE] == 0.0).all()
    np.testing.assert_array_equal(given, -command(-asked))
    assert (np.diff(given) >= 0.0).all()
    assert np.abs(np.diff(given)).max() < 1.1e-3
    assert given[-1] == 1.0
