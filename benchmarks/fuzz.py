"""Random and invalid input: ``python -m benchmarks.fuzz`` runs the environments with it and reports every fault.

A configuration must either be refused with a ValueError or run. If it runs, the observation stays in its space, all
signals are finite, an episode whose state is lost ends, and the time is limited. An interrupted command resumes. A
fault is shown with the command that repeats it alone.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import typer
from rich.console import Console

import shared_control_env  # noqa: F401
from benchmarks.random_settings import random_config
from shared_control_env.evaluation.episodes import source_digest
from shared_control_env.evaluation.interrupt import resumable
from shared_control_env.evaluation.progress import progress_bar
from shared_control_env.evaluation.storage import write_atomically
from shared_control_env.registration import ENVIRONMENTS
from shared_control_env.wrappers import DriverModel

PATIENCE = 5.0
"""Longest time that one configuration may take [s]."""

STEPS = 8
"""Number of steps of a configuration in the single environment."""

BATCH, LENGTH = 64, 50
"""Number of environments, and of steps of each, for a configuration in the kernel."""

SAVED_EVERY = 50
"""Number of configurations after which the progress is saved."""

IDS = list(ENVIRONMENTS)


def try_single(rng: np.random.Generator) -> int:
    """Try one configuration in the single environment, with the predictive driver half of the time.

    Args:
        rng: random generator.

    Returns:
        Number of steps; 0 if the configuration was refused.

    Raises:
        AssertionError: if a signal, the observation or the time is not as required.
    """
    name, config = IDS[int(rng.integers(len(IDS)))], random_config(rng)
    begin = perf_counter()
    try:
        env = gym.make(name, config=config, disable_env_checker=True)
        env = DriverModel(env) if rng.random() < 0.5 else env
        env.reset(seed=int(rng.integers(2**31)))
    except ValueError as error:
        if "config" not in str(error):
            raise
        assert perf_counter() - begin < PATIENCE, f"{name}, {config!r}: refusing took {perf_counter() - begin:.1f} s"
        return 0
    steps = 0
    for _ in range(STEPS):
        observation, reward, terminated, truncated, info = env.step(_action(env.action_space, rng))
        _check(observation, np.array(reward), info, np.array(terminated), f"{name}, {config!r}")
        steps += 1
        if terminated or truncated:
            break
    assert perf_counter() - begin < PATIENCE, f"{name}, {config!r}: took {perf_counter() - begin:.1f} s"
    return steps


def try_kernel(rng: np.random.Generator) -> int:
    """Try one configuration in the kernel, for many steps.

    Args:
        rng: random generator.

    Returns:
        Number of steps; 0 if the configuration was refused.

    Raises:
        AssertionError: if a signal, the observation or the time is not as required.
    """
    name, config = IDS[int(rng.integers(len(IDS)))], random_config(rng, wrong=0.0)
    try:
        env: Any = gym.make_vec(name, num_envs=BATCH, config=config, threads=1, driver=bool(rng.integers(2)))
        env.reset(seed=int(rng.integers(2**31)))
    except ValueError as error:
        if "config" not in str(error):
            raise
        return 0
    begin, steps = perf_counter(), 0
    for _ in range(LENGTH):
        actions = env.action_space.sample() if env.unwrapped._driver else rng.uniform(-1.5, 1.5, (BATCH, 2))
        try:
            observation, reward, terminated, _, info = env.step(actions)
        except ValueError as error:
            if "config" not in str(error):  # a configuration whose episode cannot be drawn is no fault
                raise
            break
        _check(observation, reward, info, terminated, f"{name}, {config!r}")
        steps += 1
    assert perf_counter() - begin < BATCH * PATIENCE, f"{name}, {config!r}: took {perf_counter() - begin:.1f} s"
    env.close()
    return steps * BATCH


def _action(space: gym.Space, rng: np.random.Generator) -> Any:
    return 0 if isinstance(space, gym.spaces.Discrete) else rng.uniform(-1.5, 1.5, space.shape)


def _check(
    observation: np.ndarray, reward: np.ndarray, info: dict[str, Any], terminated: np.ndarray, what: str
) -> None:
    """Check a step: bounded observations, finite signals, and an end of the episode where the state is lost."""
    running = ~terminated
    assert (np.abs(observation[running] if observation.ndim > 1 else observation) <= 1.0).all() or not running.any(), (
        what
    )
    for key in ("u_a_des", "u_a_f", "u_a_act", "u_h_des", "u_h_act", "u", "alpha_a", "r_x", "r_y", "state"):
        assert np.isfinite(info[key]).all(), f"{what}: {key} = {info[key]!r}"
    assert np.isfinite(reward[running]).all(), what
    assert (np.asarray(info["alpha_a"]) >= 0.0).all(), what
    assert (np.asarray(info["alpha_a"]) <= 1.0).all(), what


def _compile() -> None:
    """Compile everything before the first timing."""
    env = DriverModel(gym.make(IDS[0]))
    env.reset(seed=0)
    env.step(0)
    for driver in (False, True):
        gym.make_vec(IDS[0], num_envs=1, threads=1, driver=driver).reset(seed=0)


def attempt(what: str, seed: int, index: int) -> tuple[int, str]:
    """Run one trial by its number.

    Args:
        what: ``single`` or ``kernel``.
        seed: seed of all trials.
        index: number of the trial.

    Returns:
        The number of steps, and a description of the fault; the description is empty if there is no fault.
    """
    tries: dict[str, Callable[[np.random.Generator], int]] = {"single": try_single, "kernel": try_kernel}
    rng = np.random.default_rng([seed, index, list(tries).index(what)])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about unstable vehicles and actions out of bounds
        try:
            return tries[what](rng), ""
        except Exception as error:
            return 0, f"{type(error).__name__}: {error}"


def main(
    steps: Annotated[float, typer.Option(help="Steps in the kernel.")] = 1e6,
    configs: Annotated[float, typer.Option(help="Configurations in the single environment.")] = 1e4,
    seed: Annotated[int, typer.Option(min=0, help="Of everything.")] = 0,
    out: Annotated[Path, typer.Option(help="Folder of what is done.")] = Path("results/fuzz"),
    only: Annotated[str, typer.Option(help="One trial again, such as single:17.")] = "",
) -> None:
    """Try random and hostile configurations and actions; stopped, it goes on where it was."""
    console = Console()
    if only:
        what, _, number = only.partition(":")
        console.print(*attempt(what, seed, int(number)), markup=False)
        return
    path = out / f"{source_digest()}-{seed}.json"
    done = json.loads(path.read_text()) if path.exists() else {}
    wanted = {"single": ("tried", int(configs)), "kernel": ("steps", int(steps))}
    _compile()
    with resumable(path), progress_bar(console) as bar:
        for what, (counted, goal) in wanted.items():
            state = done.setdefault(what, {"tried": 0, "drove": 0, "steps": 0, "faults": []})
            task = bar.add_task(f"{what}: {counted}", total=goal)
            while state[counted] < goal:
                driven, fault = attempt(what, seed, state["tried"])
                if fault:
                    again = f"python -m benchmarks.fuzz --seed {seed} --only {what}:{state['tried']}"
                    state["faults"].append([again, fault])
                    console.print(f"{again}: {fault}", markup=False)
                state["tried"] += 1
                state["steps"] += driven
                state["drove"] += driven > 0
                bar.update(task, completed=min(state[counted], goal))
                if state["tried"] % SAVED_EVERY == 0 or state[counted] >= goal:
                    write_atomically(path, lambda draft: draft.write_text(json.dumps(done)))
    for what, state in done.items():
        console.print(
            f"{what}: {state['tried']} configurations of {len(IDS)} environments; {state['drove']} drove "
            f"{state['steps']} steps, the others were refused; {len(state['faults'])} fault(s)"
        )
    console.print(f"Kept in {path}.")
    raise typer.Exit(any(state["faults"] for state in done.values()))


if __name__ == "__main__":
    typer.run(main)
