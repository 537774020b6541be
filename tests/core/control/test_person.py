"""A person at the wheel: each part against what it is defined as, and the whole in both kinds of environments."""

import gymnasium as gym
import numpy as np
import pytest
from scipy import stats

from shared_control_env.controllers.driver import PersonDriver
from shared_control_env.core import entries
from shared_control_env.core.compile.jit import jit
from shared_control_env.core.control import person as persons
from shared_control_env.core.control.person import REASONS
from shared_control_env.core.parameters import (
    IDENTIFIED_DRIVERS,
    PERSONS,
    InternalModelParameters,
    Parameters,
    PersonParameters,
    fitted_arms,
)
from shared_control_env.core.records import PERSON_MEMORY, SCENE, pack
from shared_control_env.evaluation import DRIVERS, DriverEntry, Suite, evaluate
from shared_control_env.wrappers import DriverModel
from tests.scenes import scene_of, traffic

EXACT = PersonParameters(active=True, weber=0.0, arm_noise=0.0)


def parameters_of(person):
    return pack(Parameters(person=person, internal_model=InternalModelParameters(active=True)))


def watch(person, scenes, commands=None):
    """What a person sees of scenes one after the other: the scenes as seen, whether the person drives, and the memory."""
    p, memory, seen = parameters_of(person), np.zeros((), PERSON_MEMORY), np.zeros((), SCENE)
    out = []
    for k, scene in enumerate(scenes):
        seen[()] = scene
        u_last = np.zeros(2) if commands is None or k == 0 else commands[k - 1]
        drives = entries.perceive_and_attend(scene, u_last, memory, p, seen)
        out.append((seen.copy(), bool(drives), memory.copy()))
    return out


def scenes_at(states, **fields):
    made = []
    for k, state in enumerate(states):
        scene = scene_of(np.asarray(state, dtype=float), k=k)
        for name, value in fields.items():
            scene[name] = value
        made.append(scene)
    return made


def test_without_delay_and_noise_everything_is_seen_as_it_is():
    rng = np.random.default_rng(0)
    scenes = scenes_at(rng.normal(size=(30, 6)) * [5.0, 0.3, 0.02, 1.0, 0.1, 0.05] + [0, 0, 0, 15.0, 0, 0])
    for scene, (seen, drives, _) in zip(scenes, watch(EXACT._replace(delay=0.0), scenes), strict=True):
        np.testing.assert_array_equal(seen["z"], scene["z"])
        assert drives


def test_the_own_model_makes_up_for_the_delay():
    """Driven by commands that the person gave, the car is where the model says, but for the plant's finer steps."""
    env = gym.make("SharedControl/Bend-v1", config={"authority": {"law": "driver_only"}, "randomise": []})
    env.reset(seed=0)
    rng, scenes, commands = np.random.default_rng(1), [], []
    for _ in range(60):
        scenes.append(env.unwrapped.scene.copy())
        commands.append(env.step(rng.uniform([-0.2, -0.05], [0.2, 0.15]))[4]["u"])
    late = watch(EXACT, scenes, commands)
    error = np.array([seen["z"] - scene["z"] for scene, (seen, _, _) in zip(scenes, late, strict=True)])
    assert np.abs(error[:, 1]).max() < 0.05
    assert np.abs(error[:, 2]).max() < 0.05
    unaware = watch(EXACT, scenes)  # who does not know what drove the car errs by what it did
    blind = np.array([seen["z"] - scene["z"] for scene, (seen, _, _) in zip(scenes, unaware, strict=True)])
    assert np.sqrt(np.mean(blind[:, 2] ** 2)) > 3.0 * np.sqrt(np.mean(error[:, 2] ** 2))


def test_what_happens_is_seen_after_the_delay():
    states = [[0.0, 0.0, 0.0, 15.0, 0.0, 0.0]] * 10 + [[0.0, 0.7, 0.0, 15.0, 0.0, 0.0]] * 10
    for delay, steps in ((0.0, 0), (0.2, 4), (0.5, 10)):
        seen = np.array([each["z"][1] for each, _, _ in watch(EXACT._replace(delay=delay), scenes_at(states))])
        assert (seen[: 10 + steps] < 0.1).all()
        assert (seen[10 + steps :] > 0.6).all()


def test_the_error_is_in_proportion_and_of_the_stated_size():
    offset, seeds = 0.4, range(300)
    scenes = scenes_at([[0.0, offset, 0.1, 15.0, 0.0, 0.0]] * 6, v_target=10.0)
    person = EXACT._replace(delay=0.0, weber=0.1)
    seen = np.array([watch(person._replace(seed=seed), scenes)[-1][0]["z"] for seed in seeds])
    for place, size in ((1, 0.4), (2, 0.1), (3, 5.0)):
        assert seen[:, place].std() == pytest.approx(0.1 * size, rel=0.15)
        assert seen[:, place].mean() == pytest.approx(scenes[0]["z"][place], abs=0.03 * size)
    centred = scenes_at([[0.0, 0.0, 0.0, 15.0, 0.0, 0.0]], v_target=15.0)
    np.testing.assert_array_equal(watch(person, centred)[0][0]["z"][1:4], [0.0, 0.0, 15.0])


def test_errors_keep_their_variance_and_their_correlation():
    p, memory = parameters_of(PersonParameters(active=True, noise_time=0.3, seed=7)), np.zeros((), PERSON_MEMORY)
    advance = jit(lambda memory, k, p: persons.advance_errors(memory[()], k, p[()]))
    series = []
    for k in range(20_000):
        advance(memory, k, p)
        series.append(memory["error"].copy())
    series = np.array(series)
    np.testing.assert_allclose(series.std(axis=0), 1.0, atol=0.06)
    for place in range(4):
        correlation = np.corrcoef(series[:-1, place], series[1:, place])[0, 1]
        assert correlation == pytest.approx(np.exp(-0.05 / 0.3), abs=0.02)
    assert np.abs(np.corrcoef(series.T) - np.eye(4)).max() < 0.08


AT_REST = EXACT._replace(engaged=False, delay=0.0, response=1.0, response_spread=0.0)
QUIET = {"felt": [0.0, 0.0], "displayed": 1.0, "v_target": 15.0}
CAUSES = {
    "lane position": ([0.0, 0.9, 0.0, 15.0, 0.0, 0.0], QUIET),
    "heading": ([0.0, 0.0, 0.2, 15.0, 0.0, 0.0], QUIET),
    "felt steering": ([0.0, 0.0, 0.0, 15.0, 0.0, 0.0], {**QUIET, "felt": [0.0, 0.1]}),
    "felt acceleration": ([0.0, 0.0, 0.0, 15.0, 0.0, 0.0], {**QUIET, "felt": [3.5, 0.0]}),
    "display": ([0.0, 0.0, 0.0, 15.0, 0.0, 0.0], {**QUIET, "displayed": 0.4}),
}


@pytest.mark.parametrize("reason", CAUSES)
def test_each_reason_is_noticed_and_acted_on_after_the_response_time(reason):
    state, fields = CAUSES[reason]
    story = watch(AT_REST, scenes_at([state] * 30, **fields))
    first = 1 if reason.startswith("felt") else 0  # at the start nothing is felt yet
    assert story[first][2]["noticed"] == pytest.approx(0.05 * first)
    assert REASONS[story[first][2]["reason"]] == reason
    assert [drives for _, drives, _ in story] == [False] * (20 + first) + [True] * (10 - first)


def test_the_vehicle_ahead_is_noticed():
    near = scene_of(np.array([0.0, 0.0, 0.0, 15.0, 0.0, 0.0]), others=traffic((13.0, 0.0, 15.0)))
    near["v_target"], near["displayed"] = 15.0, 1.0
    assert REASONS[watch(AT_REST, [near])[0][2]["reason"]] == "headway"


def test_nothing_is_noticed_where_all_is_well():
    story = watch(AT_REST, scenes_at([[0.0, 0.1, 0.01, 15.0, 0.0, 0.0]] * 40, **QUIET))
    assert not any(drives for _, drives, _ in story)
    assert story[-1][2]["noticed"] == np.inf


def test_response_times_are_log_normal_over_persons():
    respond = jit(lambda p: persons.response_time(p[()]))
    times = [respond(parameters_of(PersonParameters(active=True, engaged=False, seed=seed))) for seed in range(2000)]
    logarithms = (np.log(times) - np.log(1.2)) / 0.5
    assert stats.kstest(logarithms, "norm").pvalue > 0.01


def test_the_arms_are_fitted_to_the_papers_five():
    (gain, gain_spread), (time, time_spread) = fitted_arms()
    five = np.array([(lag.K_h, lag.T_h) for name, lag in IDENTIFIED_DRIVERS.items() if name != "average"])
    np.testing.assert_allclose([gain, time], stats.gmean(five))
    np.testing.assert_allclose([gain_spread, time_spread], np.log(five).std(axis=0, ddof=1))
    assert gain == pytest.approx(1.07, abs=0.01)
    assert time == pytest.approx(0.172, abs=0.001)


CONFIG = {"internal_model": {"active": True}, "authority": {"law": "proportional"}}


@pytest.mark.parametrize("person", PERSONS)
@pytest.mark.parametrize("name", ["SharedControl/TwoLane-v1", "SharedControl/Bend-v1", "SharedControl/CutIn-v1"])
def test_the_person_in_the_kernel_is_the_one_from_python(name, person):
    differing = {
        field: value
        for field, value in PERSONS[person]._asdict().items()
        if value != PersonParameters()._asdict()[field]
    }
    config = {**CONFIG, "person": differing}
    alone = DriverModel(gym.make(name, config=config))
    many = gym.make_vec(name, num_envs=2, driver=True, config=config)
    alone.reset(seed=3)
    many.reset(seed=3)
    assert isinstance(alone.driver, PersonDriver)
    done = False
    while not done:
        _, _, terminated, truncated, info = alone.step(0)
        infos = many.step(None)[4]
        np.testing.assert_allclose(infos["z"][0], info["z"], atol=2e-2)
        for key in ("engaged", "noticed", "reason"):
            assert infos["driver"][key][0] == info["driver"][key]
        done = terminated or truncated


@pytest.mark.parametrize("kernel", [False, True])
def test_hands_that_rest_do_nothing(kernel):
    """Not even where the automation's command jumps: u_h,des is the u_a,act of the same step."""
    person = {"active": True, "engaged": False, "response": 30.0, "response_spread": 0.0}
    fault = {"channel": "steering", "onset": 0.5, "size": 0.3}
    config = {**CONFIG, "person": person, "faults": [fault], "authority": {"law": "none"}, "duration": 1.5}
    if kernel:
        env = gym.make_vec("SharedControl/TwoLane-v1", num_envs=1, driver=True, config=config)
    else:
        env = DriverModel(gym.make("SharedControl/TwoLane-v1", config=config))
    env.reset(seed=0)
    for _ in range(25):
        infos = env.step(None if kernel else 0)[4]
        assert not np.any(infos["driver"]["engaged"])
        np.testing.assert_array_equal(infos["u_h_des"], infos["u_a_act"])
        np.testing.assert_array_equal(infos["u_h_act"], 0.0 * infos["u_h_act"])
        np.testing.assert_array_equal(infos["u"], infos["u_a_act"])
    assert np.abs(infos["u"]).max() > 0.25


def test_persons_are_drawn_from_the_environments_generator():
    suite = Suite("one", ("bend",), ("step_bias",))
    first, again = (evaluate("hands_on", "none", suite, seeds=range(6)) for _ in range(2))
    for column in ("K_h", "T_h", "noticed", "lateral_max"):
        np.testing.assert_array_equal(first[column], again[column])
    assert first["K_h"].nunique() == first["T_h"].nunique() == 6
    assert first["K_h"].between(0.78, 1.46).all()


def test_what_a_person_is_cannot_be_changed_by_a_config():
    with pytest.raises(ValueError, match=r"'driver_lag.K_h', which the driver 'hands_on' draws"):
        evaluate("hands_on", "none", config={"driver_lag": {"K_h": 1.0}})
    with pytest.raises(ValueError, match=r"'person.engaged', which the driver 'hands_on' sets to False"):
        evaluate("hands_on", "none", config={"person": {"engaged": True}})


def test_a_small_fault_is_noticed_late_and_a_large_one_early():
    """So that a small fault can be worse than a large one, and a limiter can help against the large one."""
    suite = Suite("one", ("lane_keeping",), ("none",))
    noticed = {}
    for size in (0.05, 0.4):
        fault = [{"channel": "steering", "onset": 2.0, "size": size}]
        table = evaluate("hands_on", "none", suite, seeds=range(12), config={"faults": fault})
        noticed[size] = table["noticed"].fillna(np.inf).median()
    assert 2.0 < noticed[0.4] < 2.3
    assert noticed[0.05] > noticed[0.4] + 0.2


@pytest.mark.parametrize("name", ["attentive", "hands_on", "hands_off"])
def test_persons_of_the_catalogue_say_what_they_are(name):
    entry = DRIVERS[name]
    assert entry.config["person"]["active"]
    assert {draw["setting"] for draw in entry.draws} == {"driver_lag.K_h", "driver_lag.T_h"}


def test_a_population_draws_one_person_an_episode_from_the_environments_generator():
    suite = Suite("one", ("bend",), ("step_bias",))
    first, again = (evaluate("population", "none", suite, seeds=range(30)) for _ in range(2))
    for column in ("person", "K_h", "T_h", "noticed"):
        np.testing.assert_array_equal(first[column], again[column])
    assert set(first["person"]) == set(PERSONS)
    assert (first["person"].value_counts() > 3).all()
    assert first["K_h"].nunique() == 30
    assert (evaluate("internal_model", "none", suite)["person"] == "").all()
    own = DriverEntry("mine", config={"person": {"active": True, "weber": 0.3}, "internal_model": {"active": True}})
    assert (evaluate({"mine": own}, "none", suite)["person"] == "own").all()


def test_the_road_does_not_depend_on_who_drives():
    episodes = {}
    for names in ([], ["hands_on"], list(PERSONS)):
        env = DriverModel(gym.make("SharedControl/Bend-v1", config={"persons": names}))
        env.reset(seed=4)
        episode = env.unwrapped.episode
        episodes[tuple(names)] = (episode.road, episode.ego, episode.vehicles)
        assert episode.persons == []
        assert episode.has_person == bool(names)
    assert episodes[("hands_on",)] == episodes[tuple(PERSONS)]


def test_the_person_is_in_info_in_both_kinds_of_environments():
    config = {"persons": ["hands_off"], "driver_lag": {"K_h": 1.1, "T_h": 0.15}, "internal_model": {"active": True}}
    single = DriverModel(gym.make("SharedControl/TwoLane-v1", config=config))
    many = gym.make_vec("SharedControl/TwoLane-v1", num_envs=2, driver=True, config=config)
    infos = [single.reset(seed=5)[1]["driver"], {k: v[0] for k, v in many.reset(seed=5)[1]["driver"].items()}]
    infos += [single.step(0)[4]["driver"], {k: v[0] for k, v in many.step(None)[4]["driver"].items()}]
    for info in infos:
        assert info["K_h"] == 1.1
        assert info["T_h"] == 0.15
        assert 0.3 < info["response"] < 20.0
        assert not info["engaged"]
    assert len({info["response"] for info in infos}) == 1


def test_a_person_who_is_drawn_is_not_set_as_well():
    both = {"persons": ["hands_on"], "person": {"active": True, "weber": 0.2}}
    with pytest.raises(ValueError, match=r"\['person'\]\['active'\] = True would not act.*config\['persons'\]"):
        gym.make("SharedControl/TwoLane-v1", config=both)
    with pytest.raises(ValueError, match="did you mean 'hands_on'"):
        gym.make("SharedControl/TwoLane-v1", config={"persons": ["hands_onn"]})
    with pytest.raises(ValueError, match=r"config\['persons'\] would not act: it needs driver=True"):
        gym.make_vec("SharedControl/TwoLane-v1", num_envs=2, config={"persons": ["hands_on"]})


@pytest.mark.parametrize(
    ("field", "value", "more", "largest"),
    [
        ("lane_position", 4.5, {"road": {"lanes": 1}}, "2 m"),
        ("felt_steering", 0.3, {"limits": {"delta_max": 0.2}}, "0.2 rad"),
        ("felt_acceleration", 9.0, {"limits": {"a_max": 4.0}}, r"8 m/s\^2"),
    ],
)
def test_a_threshold_that_never_triggers_is_refused(field, value, more, largest):
    person = {"active": True, "engaged": False, field: value}
    message = rf"\['person'\]\['{field}'\] = {value}.*never be noticed.*less than {largest}"
    with pytest.raises(ValueError, match=message):
        gym.make("SharedControl/Bend-v1", config={"person": person, **more})


@pytest.mark.parametrize("field", ["delay", "weber", "response", "arm_noise", "lane_position"])
def test_negative_numbers_of_a_person_are_refused(field):
    with pytest.raises(ValueError, match=rf"\['person'\]\['{field}'\] = -0.1.*smallest is"):
        gym.make("SharedControl/Bend-v1", config={"person": {"active": True, "engaged": False, field: -0.1}})


def test_what_is_drawn_beside_persons_is_taken_at_every_reset():
    """Also where the person drawn drives from the start, and where a preset's threshold is beyond the limits."""
    draws = [{"setting": f"person.{name}", "low": 0.1, "high": 0.3} for name in ("display", "headway", "delay")]
    config = {"persons": list(PERSONS), "randomise": draws, "limits": {"delta_max": 0.4}}
    env = DriverModel(gym.make("SharedControl/TwoLane-v1", config=config))
    seen = set()
    for seed in range(12):
        env.reset(seed=seed)
        person = env.unwrapped.episode.person
        assert 0.1 <= person.delay <= 0.3
        assert person.engaged == (person.display == PERSONS["attentive"].display)
        seen.add(person.engaged)
    assert seen == {False, True}


@pytest.mark.parametrize("path", ["vehicle.mu", "model.mu", "person.delay"])
def test_a_draw_that_would_not_act_is_refused_when_the_environment_is_made(path):
    draw = {"setting": path, "low": 0.15, "high": 0.25}
    for make in (gym.make, lambda *a, **k: gym.make_vec(*a, num_envs=2, **k)):
        with pytest.raises(ValueError, match=rf"\['randomise'\]\[0\] draws '{path}': .*would not act"):
            make("SharedControl/TwoLane-v1", config={"randomise": [draw]})


def test_what_a_setting_does_wrong_is_not_blamed_on_a_draw():
    config = {"longitudinal_risk": {"sigma_x": 3.0}, "randomise": [{"setting": "ego.speed", "low": 12.0, "high": 14.0}]}
    with pytest.raises(ValueError, match=r"^config\['longitudinal_risk'\]\['sigma_x'\] = 3.0 would not act"):
        gym.make("SharedControl/LaneKeeping-v1", config=config)
