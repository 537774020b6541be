"""Episodes drawn in compiled code are those drawn in Python, to the bit, number by number."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest

import shared_control_env  # noqa: F401
from shared_control_env.core.batch import empty_batch
from shared_control_env.core.drawing import draw_starts
from shared_control_env.core.stream import WORDS, state_of
from shared_control_env.envs.drawing import drawing_of
from shared_control_env.envs.episode import draw_episode
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.envs.settings import combined, plain
from shared_control_env.envs.starts import sizes_for, start_of, write_start
from shared_control_env.evaluation.catalogue import DRIVERS
from shared_control_env.vector.episodes import NOBODY, Episodes
from shared_control_env.vector.threads import Threads

BEND = "SharedControl/Bend-v1"
N = 60
SPEED = {"setting": "ego.speed", "low": 9.0, "high": 13.0}
COMPILED = {
    **{name: (name, {}) for name, scenario in SCENARIOS.items() if "randomise" in scenario.settings},
    "an arm": ("bend", {"randomise": [{"setting": "driver_lag.K_h", "low": 0.8, "high": 1.2}]}),
    "two noises": (
        "two_lane",
        {
            "faults": [
                {"kind": "white_noise", "channel": "steering", "size": 0.1, "onset": 1.0},
                {"kind": "bias", "channel": "steering", "size": 0.1, "onset": 1.0},
                {"kind": "coloured_noise", "channel": "acceleration", "size": 0.1, "seed": 3, "onset": 1.0},
                {"kind": "coloured_noise", "channel": "acceleration", "size": 0.1, "onset": 1.0},
            ],
        },
    ),
    "no degradation": ("bend", {"degradations": ["none"]}),
    "a third lane": ("motorway", {"road": {"lanes": 3}}),
}
IN_PYTHON = {
    "a recording": ("recorded", {}),
    "a log-normal value": ("bend", {"randomise": [{"setting": "driver_lag.K_h", "median": 1.0, "spread": 0.1}]}),
    "an integer": ("two_lane", {"randomise": [{"setting": "road.lanes", "choices": [2, 3]}]}),
    "a length that the road sums up": (
        "two_lane",
        {"randomise": [{"setting": "road.segments.0.length", "low": 900.0, "high": 1000.0}]},
    ),
    "vehicles that might overlap": (
        "two_lane",
        {
            "randomise": [
                {"setting": "vehicles.1.position", "low": 5.0, "high": 30.0},
                {"setting": "vehicles.2.position", "low": -5.0, "high": 10.0},
            ]
        },
    ),
    "a value that is refused": ("two_lane", {"randomise": [{"setting": "ego.lateral_offset", "choices": [0.1, 9.0]}]}),
    "a speed that decides another": (
        "dense_traffic",
        {"randomise": [{"setting": "road.lane_width", "low": 3.0, "high": 4.0}]},
    ),
}


def settings_of(name, changes):
    return combined(SCENARIOS[name].settings, changes)


@pytest.mark.parametrize(("name", "changes"), COMPILED.values(), ids=list(COMPILED))
def test_the_starts_are_those_of_python(name, changes):
    settings = settings_of(name, changes)
    sizes = sizes_for([settings])
    drawing = drawing_of(settings, sizes)
    ours, theirs = empty_batch(N, sizes), empty_batch(N, sizes)
    generators = [np.random.default_rng(seed) for seed in range(N)]
    streams, after = np.zeros((2, N, WORDS), np.uint64)
    for generator, row in zip(generators, streams, strict=True):
        state_of(generator, row)
    for _ in range(3):
        for i, generator in enumerate(generators):
            write_start(start_of(draw_episode(settings, generator)), theirs, i)
            state_of(generator, after[i])
        words = [records.view(np.float64).reshape(N, -1) for records in (ours.parameters, ours.plans)]
        numbers = np.zeros((2, len(drawing.numbers)))
        for thread in range(2):
            draw_starts(np.ones(N, bool), streams, ours, *words, drawing, NOBODY, numbers, thread, 2)
        np.testing.assert_array_equal(streams, after)
        for field in ("parameters", "states", "lines", "faults", "traffic", "plans"):
            np.testing.assert_array_equal(getattr(ours, field), getattr(theirs, field), err_msg=field)


@pytest.mark.parametrize(("name", "changes"), IN_PYTHON.values(), ids=list(IN_PYTHON))
def test_what_is_not_so_simple_is_drawn_in_python(name, changes):
    settings = settings_of(name, changes)
    assert drawing_of(settings, sizes_for([settings])) is None


def driven(env, steps, seed=5):
    env.reset(seed=seed)
    rng = np.random.default_rng(0)
    return [env.step(rng.uniform(-1.0, 1.0, (3, 2)))[0] for _ in range(steps)]


@pytest.mark.parametrize("mode", ["next_step", "same_step"])
def test_episodes_show_the_settings_that_were_drawn(mode):
    env = gym.make_vec(BEND, num_envs=3, config={"duration": 0.5}, autoreset_mode=mode)
    driven(env, 25)
    episodes = env.unwrapped.episodes
    assert len({episode.ego.speed for episode in episodes}) == 3
    for i, episode in enumerate(episodes):
        line = start_of(episode).line
        np.testing.assert_array_equal(line, env.unwrapped._batch.lines[i, : len(line)])
        assert start_of(episode).parameters[()] == env.unwrapped._batch.parameters[i]
    assert episodes == env.unwrapped.episodes


def test_a_generator_in_a_users_hands_is_still_the_environments():
    """It is where the draws have left it, and numbers that the user takes are missing from the next episode."""
    plain_env, watched = (gym.make_vec(BEND, num_envs=3) for _ in range(2))
    plain_env.reset(seed=5)
    watched.reset(seed=5)
    single = gym.make(BEND)
    single.reset(seed=5)
    generators = watched.unwrapped.np_random
    assert generators[0].bit_generator.state == single.unwrapped.np_random.bit_generator.state
    np.testing.assert_array_equal(plain_env.reset()[0], watched.reset()[0])
    single.reset()
    assert generators[0].bit_generator.state == single.unwrapped.np_random.bit_generator.state
    taken = generators[1].random()
    assert taken == plain_env.unwrapped.np_random[1].random()
    np.testing.assert_array_equal(plain_env.reset()[0], watched.reset()[0])


def test_changed_settings_go_on_with_the_same_generators():
    env = gym.make_vec(BEND, num_envs=3)
    env.reset(seed=5)
    before = env.unwrapped.episodes
    env.unwrapped.set_config({"randomise": [SPEED]})
    assert env.unwrapped.episodes == before
    env.reset()
    single = gym.make(BEND)
    single.reset(seed=5)
    single.reset(options={"config": {"randomise": [SPEED]}})
    ours, theirs = env.unwrapped.episodes[0], single.unwrapped.episode
    assert (ours.ego, ours.road, ours.faults) == (theirs.ego, theirs.road, theirs.faults)


def test_a_copy_draws_the_same_episodes():
    env = gym.make_vec(BEND, num_envs=3, config={"duration": 0.5})
    driven(env, 5)
    for other in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        assert [plain(e) for e in other.unwrapped.episodes] == [plain(e) for e in env.unwrapped.episodes]
        np.testing.assert_array_equal(other.reset()[0], copy.deepcopy(env).reset()[0])


def test_many_are_drawn_by_several_threads():
    one, two = (gym.make_vec(BEND, num_envs=600, threads=threads) for threads in (1, 2))
    np.testing.assert_array_equal(one.reset(seed=0)[0], two.reset(seed=0)[0])


PERSONS = {
    "one of three": {"internal_model": {"active": True}, "persons": ["attentive", "hands_on", "hands_off"]},
    "one of the settings": {"internal_model": {"active": True}, "person": {"active": True, "delay": 0.3}},
    "one with a seed": {"internal_model": {"active": True}, "person": {"active": True, "seed": 5}},
}


@pytest.mark.parametrize("changes", PERSONS.values(), ids=list(PERSONS))
@pytest.mark.parametrize("name", ["population", "hands_on"])
def test_persons_are_those_of_python(changes, name):
    """With the arms and delays of the catalogue's drivers, over several episodes, and with another generator between."""
    draws = [dict(draw) for draw in DRIVERS[name].draws]
    if "delay" in changes.get("person", {}):
        draws = [draw for draw in draws if draw["setting"] != "person.delay"]
    own = SCENARIOS["bend"].settings["randomise"]
    settings = settings_of("bend", {**changes, "randomise": [*own, *draws]})
    sizes = sizes_for([settings])
    ours, theirs = empty_batch(N, sizes), empty_batch(N, sizes)
    episodes, threads = Episodes(N), Threads(1)
    episodes.adopt([settings] * N, True, sizes, settings)
    assert episodes._drawing is not None
    generators = [np.random.default_rng(seed) for seed in range(N)]
    for i in range(N):
        episodes.seed(i, np.random.default_rng(i), i)
    for _ in range(3):
        expected = [draw_episode(settings, generator) for generator in generators]
        for i, episode in enumerate(expected):
            write_start(start_of(episode), theirs, i)
        episodes.draw(np.ones(N, bool), ours, threads)
        for field in ("parameters", "states", "lines", "faults", "traffic", "plans"):
            np.testing.assert_array_equal(getattr(ours, field), getattr(theirs, field), err_msg=field)
        assert list(episodes) == expected
    for i, generator in enumerate(generators):
        assert episodes.generator(i).bit_generator.state == generator.bit_generator.state
