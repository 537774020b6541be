"""Seeded rollouts of every environment, as digests of all that they give, and of the single ones a few numbers."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any

import gymnasium as gym
import llvmlite.binding
import numpy as np

import shared_control_env  # noqa: F401
from shared_control_env.registration import ENVIRONMENTS

FILE = Path(__file__).parent / "rollouts.json"
"""The rollouts that are expected."""

SEEDS, STEPS, NUMBER = (0, 1, 2), 200, 4
"""Seeds, steps of a rollout, and environments of a vectorised one."""

MODES = ("next_step", "same_step", "disabled")
"""Autoreset modes."""


def machine() -> str:
    """What the last bits of a floating-point number depend on: processor, C library, versions of the compilers."""
    features = llvmlite.binding.get_host_cpu_features().flatten()
    libraries = f"{np.__version__} {llvmlite.__version__} {' '.join(platform.libc_ver())}"
    return sha256(
        f"{platform.machine()} {llvmlite.binding.get_host_cpu_name()} {features} {libraries}".encode()
    ).hexdigest()[:12]


def rollouts() -> Iterator[tuple[str, dict[str, Any]]]:
    """Name and outcome of every rollout: ``digest`` of all arrays, and ``early``, signals of the first two seconds."""
    for name in ENVIRONMENTS:
        for seed in SEEDS:
            yield f"{name} single {seed}", single(name, seed)
            for mode in MODES:
                yield f"{name} {mode} {seed}", vectorised(name, mode, seed)


def single(name: str, seed: int) -> dict[str, Any]:
    """Rollout of one environment, which begins anew where an episode ends."""
    env, rng, record = gym.make(name, disable_env_checker=True), np.random.default_rng(seed), Record()
    record.note(*env.reset(seed=seed))
    for _ in range(STEPS):
        observation, reward, terminated, truncated, info = env.step(_actions(rng, (2,)))
        record.note(observation, reward, terminated, truncated, info)
        if terminated or truncated:
            record.note(*env.reset())
    env.close()
    return record.outcome()


def vectorised(name: str, mode: str, seed: int) -> dict[str, Any]:
    """Rollout of environments in the kernel."""
    env = gym.make_vec(name, num_envs=NUMBER, autoreset_mode=mode, threads=1)
    rng, record = np.random.default_rng(seed), Record()
    record.note(*env.reset(seed=seed))
    for _ in range(STEPS):
        result = env.step(_actions(rng, (NUMBER, 2)))
        record.note(*result)
        ended = result[2] | result[3]
        if mode == "disabled" and ended.any():
            record.note(*env.reset(options={"reset_mask": ended}))
    env.close()
    return {"digest": record.outcome()["digest"]}


def _actions(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    return rng.uniform(-0.3, 0.3, shape).astype(np.float32)


class Record:
    """Digest of all that a rollout gives, and its early signals."""

    EARLY = 40
    SIGNALS = ("z", "u", "r_x", "r_y", "alpha_a")

    def __init__(self) -> None:
        self._digest, self._early = sha256(), list[float]()
        self._noted = 0

    def note(self, *values: Any) -> None:
        """Take in what a reset or a step gave."""
        for value in values:
            self._take(value)
        info = values[-1]
        if self._noted < self.EARLY and self._noted % 8 == 0:
            self._early += [float(x) for name in self.SIGNALS for x in np.ravel(info[name])]
        self._noted += 1

    def _take(self, value: Any) -> None:
        if isinstance(value, dict):
            for key in sorted(value):
                self._digest.update(key.encode())
                self._take(value[key])
        else:
            array = np.asarray(value)
            self._digest.update(f"{array.dtype} {array.shape}".encode() + np.ascontiguousarray(array).tobytes())

    def outcome(self) -> dict[str, Any]:
        """The digest, and the early numbers to nine digits."""
        return {"digest": self._digest.hexdigest()[:24], "early": [float(f"{x:.9g}") for x in self._early]}
