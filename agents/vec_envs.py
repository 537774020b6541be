"""Vectorised environments for training: several scenarios joined, with the observations that a policy sees."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from time import perf_counter
from typing import Any

import gymnasium as gym
import numpy as np
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecMonitor

from agents.tasks import training_config
from shared_control_env.learned.history import HISTORY, History
from shared_control_env.learned.views import ACTION_OF, FEATURES_OF, driver_view, view
from shared_control_env.vector.stable_baselines import StableBaselinesVecEnv


class JoinedVecEnv(VecEnv):
    """Several vectorised environments with the same spaces as one vectorised environment.

    Args:
        parts: the vectorised environments.

    Attributes:
        parts: the vectorised environments.

    Raises:
        ValueError: if there are no parts, or their spaces differ.
    """

    def __init__(self, parts: Sequence[VecEnv]) -> None:
        if not parts:
            raise ValueError("parts must hold at least one environment")
        self.parts = list(parts)
        first = self.parts[0]
        for part in self.parts:
            if (part.observation_space, part.action_space) != (first.observation_space, first.action_space):
                raise ValueError(f"the spaces of {part} differ from those of {first}")
        self._edges = np.cumsum([0, *(part.num_envs for part in self.parts)]).tolist()
        self.render_mode = first.render_mode
        super().__init__(self._edges[-1], first.observation_space, first.action_space)

    def _slices(self) -> Iterator[tuple[VecEnv, slice]]:
        for part, begin, end in zip(self.parts, self._edges, self._edges[1:], strict=False):
            yield part, slice(begin, end)

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Set the seeds of the next reset; they are counted on from one part to the next.

        Args:
            seed: seed of the first environment, or None.
        """
        return [
            own for part, where in self._slices() for own in part.seed(None if seed is None else seed + where.start)
        ]

    def reset(self) -> np.ndarray:
        """Observations of new episodes."""
        observations: list[Any] = [part.reset() for part in self.parts]
        self.reset_infos = [info for part in self.parts for info in part.reset_infos]
        return np.concatenate(observations)

    def step_async(self, actions: np.ndarray) -> None:
        """Store the actions for :meth:`step_wait`.

        Args:
            actions: actions of all environments, shape (N, n).
        """
        for part, where in self._slices():
            part.step_async(actions[where])

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all environments."""
        results: list[Any] = [part.step_wait() for part in self.parts]
        observations, rewards, dones = (np.concatenate([result[i] for result in results]) for i in range(3))
        return observations, rewards, dones, [info for result in results for info in result[3]]

    def close(self) -> None:
        """Close all parts."""
        for part in self.parts:
            part.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Pictures of all environments."""
        return [image for part in self.parts for image in part.get_images()]

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of each environment.

        Args:
            attr_name: name of the attribute.
            indices: indices of the environments; None for all.
        """
        values = [value for part in self.parts for value in part.get_attr(attr_name)]
        return [values[i] for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Setting an attribute; the parts refuse it.

        Args:
            attr_name: name of the attribute.
            value: its value.
            indices: indices of the environments; None for all.
        """
        self.parts[0].set_attr(attr_name, value, indices)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Calling a method of the environments; the parts refuse it.

        Args:
            method_name: name of the method.
            args, kwargs: its arguments.
            indices: indices of the environments; None for all.
        """
        return self.parts[0].env_method(method_name, *args, indices=indices, **kwargs)

    def env_is_wrapped(self, wrapper_class: type[gym.Wrapper], indices: Any = None) -> list[bool]:
        """False for every environment, since none is wrapped.

        Args:
            wrapper_class: class of the wrapper; not used.
            indices: indices of the environments; None for all.
        """
        return [False for _ in self._get_indices(indices)]


class TaskView(VecEnvWrapper):
    """The kernel's environments as the policy of a task sees them.

    After the end of an episode there is no felt or planned command any more. The terminal observation therefore holds
    that of the last step.

    Args:
        env: environments with the task's slot open.
        task: key of :data:`agents.tasks.TASKS`.
    """

    def __init__(self, env: StableBaselinesVecEnv, task: str) -> None:
        space = gym.spaces.Box(-1.0, 1.0, (len(FEATURES_OF[task]),), np.float32)
        action_space = gym.spaces.Box(-1.0, 1.0, env.action_space.shape, np.float32)
        super().__init__(env, observation_space=space, action_space=action_space)
        self._parent, self._kernel, self._task = env, env.env, task

    def _view(self, observations: Any) -> np.ndarray:
        self._last = view(self._task, observations, self._kernel.scenes, self._kernel.signals)
        return self._last

    def reset(self) -> np.ndarray:
        """Observations of new episodes."""
        return self._view(self.venv.reset())

    def step_async(self, actions: np.ndarray) -> None:
        """Store the actions for :meth:`step_wait`.

        Args:
            actions: actions of the policy in [-1, 1], shape (N, n).
        """
        self.venv.step_async(ACTION_OF[self._task](actions))

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all environments."""
        observations, rewards, dones, infos = self.venv.step_wait()
        for i in np.flatnonzero(dones).tolist():
            infos[i]["terminal_observation"] = self._terminal(infos[i]["terminal_observation"], i)
        return self._view(observations), rewards, dones, infos

    def _terminal(self, observation: np.ndarray, i: int) -> np.ndarray:
        if self._task == "driver":
            return driver_view(observation, self._parent.signals["final_info"]["u_a_act"][i])
        return self._last[i]


class WithHistory(VecEnvWrapper):
    """Observations with their history; see :class:`shared_control_env.learned.history.History`.

    Args:
        env: the vectorised environment.
    """

    def __init__(self, env: VecEnv) -> None:
        self._size = env.observation_space.shape[0]  # type: ignore[index]
        space = gym.spaces.Box(-2.0, 2.0, (HISTORY * self._size,), np.float32)
        super().__init__(env, observation_space=space)

    def reset(self) -> np.ndarray:
        """Observations of new episodes."""
        observations: Any = self.venv.reset()
        self._history = History(self.num_envs, self._size)
        return self._history.push(observations)

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all environments."""
        observations, rewards, dones, infos = self.venv.step_wait()
        for i in np.flatnonzero(dones).tolist():
            infos[i]["terminal_observation"] = self._history.would_see(infos[i]["terminal_observation"], i)
        self._history.forget(dones)
        return self._history.push(observations), rewards, dones, infos  # type: ignore[arg-type]


class Timed(VecEnvWrapper):
    """Measures the time that an environment takes.

    Args:
        env: the vectorised environment.

    Attributes:
        seconds: time spent in ``step_wait`` so far [s].
    """

    def __init__(self, env: VecEnv) -> None:
        super().__init__(env)
        self.seconds = 0.0

    def reset(self) -> Any:
        """Observations of new episodes."""
        return self.venv.reset()

    def step_wait(self) -> Any:
        """Step all environments."""
        begin = perf_counter()
        result = self.venv.step_wait()
        self.seconds += perf_counter() - begin
        return result


def make_environment(ids: Sequence[str], task: str, num_envs: int, seed: int) -> VecEnv:
    """Environments of a task for Stable-Baselines3, with stacked history and monitored episodes.

    Args:
        ids: ids of registered environments, each with an equal share.
        task: key of :data:`TASKS`.
        num_envs: number of environments, a multiple of the number of ids.
        seed: seed of the first environment; the others follow.

    Raises:
        ValueError: if ``num_envs`` is not a multiple of the number of ids.
    """
    if num_envs % len(ids):
        raise ValueError(f"num_envs = {num_envs} must be a multiple of the {len(ids)} environments that share them")
    parts = [_kernel(id, task, num_envs // len(ids)) for id in ids]
    joined = parts[0] if len(parts) == 1 else JoinedVecEnv(parts)
    stacked = VecMonitor(WithHistory(Timed(joined)))
    stacked.seed(seed)
    return stacked


def _kernel(id: str, task: str, num_envs: int) -> VecEnv:
    """Environments of one scenario, as the policy of a task sees them."""
    bound: Any = {"limiter": task == "driver", "driver": task == "allocator"}
    config = training_config(id, task)
    env = StableBaselinesVecEnv(gym.make_vec(id, num_envs=num_envs, autoreset_mode="same_step", config=config, **bound))
    return TaskView(env, task)
