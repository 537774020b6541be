"""Environments that share a block: each gets what it gets alone, also where their horizons or models differ."""

import gymnasium as gym
import numpy as np
import pytest

from shared_control_env.core.compile.lanes import WIDTH


def rollout(n, entries, driver=False, steps=40):
    config = {"randomise": entries}
    env = gym.make_vec("SharedControl/Bend-v1", num_envs=n, threads=1, driver=driver, config=config)
    seeds = list(range(n))
    env.reset(seed=seeds)
    action = np.zeros((n, 2)) if not driver else np.zeros(n, dtype=np.int64)
    signals = []
    for _ in range(steps):
        infos = env.step(action)[-1]
        signals.append(np.concatenate([infos["z"], infos["u_a_des"], infos["u_h_des"]], axis=1))
    return np.array(signals)


@pytest.mark.parametrize("driver", [False, True])
@pytest.mark.parametrize("setting", ["automation", "driver", "solver"])
def test_horizons_and_iterations_that_differ(setting, driver):
    entries = {
        "automation": [
            {"setting": "automation.H_p", "choices": [3, 10, 20]},
            {"setting": "automation.H_c", "choices": [1, 3]},
        ],
        "driver": [
            {"setting": "driver.H_p", "choices": [5, 10]},
            {"setting": "driver.H_c", "choices": [2, 3]},
        ],
        "solver": [{"setting": "solver.iterations", "choices": [1, 3, 8]}],
    }[setting]
    together = rollout(2 * WIDTH + 3, entries, driver)
    assert len(np.unique(together[-1, :, 1])) > 3
    for n in (1, WIDTH):
        np.testing.assert_array_equal(rollout(n, entries, driver), together[:, :n])
