"""Comparison of the vectorised environment with the single one."""

import numpy as np
import pytest


def flat(info, prefix=""):
    """Nested info as {path: value}, masks left out."""
    values = {}
    for key, value in info.items():
        if not key.startswith("_"):
            path = f"{prefix}{key}"
            values.update(flat(value, f"{path}/") if isinstance(value, dict) else {path: value})
    return values


def at(value, index):
    """Environment ``index`` of a nested info."""
    if isinstance(value, dict):
        return {k: at(v, index) for k, v in value.items() if not k.startswith("_")}
    return value[index]


def assert_same_info(infos, single, index):
    many = flat({key: value for key, value in infos.items() if not key.startswith("final_")})
    one = flat(single)
    assert many.keys() == one.keys()
    for path, value in one.items():
        np.testing.assert_allclose(many[path][index], value, rtol=0.0, atol=1e-9, err_msg=path)


def compare(single, many, policy, seed=0, index=2, episodes=1):
    """Whole episodes of the single environment against environment ``index`` of the vectorised one; their lengths."""
    rng = np.random.default_rng(seed)
    observation, info = single.reset(seed=seed)
    observations, infos = many.reset(seed=[seed] * many.num_envs)
    lengths = [0]
    while True:
        np.testing.assert_allclose(observations[index], observation, rtol=0.0, atol=1e-9)
        assert_same_info(infos, info, index)
        assert (many.unwrapped.scenes["felt"][index] == single.unwrapped.scene["felt"]).all()
        actions = policy(rng, many)
        observation, reward, terminated, truncated, info = single.step(actions[index])
        observations, rewards, terminations, truncations, infos = many.step(actions)
        assert rewards[index] == pytest.approx(reward, abs=1e-9)
        assert (terminations[index], truncations[index]) == (terminated, truncated)
        lengths[-1] += 1
        if terminated or truncated:
            np.testing.assert_allclose(observations[index], observation, rtol=0.0, atol=1e-9)
            assert_same_info(infos, info, index)
            if len(lengths) == episodes:
                return lengths
            lengths.append(0)
            observation, info = single.reset()
            observations, _, _, _, infos = many.step(actions)


def random_driver(rng, many):
    return (0.15 * rng.normal(size=(many.num_envs, 2))).clip(-1, 1).astype(np.float32)


def gentle_driver(rng, many):
    return (0.03 * rng.normal(size=(many.num_envs, 2))).astype(np.float32)
