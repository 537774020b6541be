"""Train a driver or an allocator: ``python -m agents.train --algo ppo --env SharedControl/LaneKeeping-v0``.

Training goes on in segments. Each begins from the checkpoint that the one before has left, with all random numbers
seeded anew from the seed and the segment's number, so that a training that was killed and started again gives the
same policy as one that was not.
"""

from __future__ import annotations

import json
import time
import tomllib
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import torch
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import VecEnv

from agents.export import export
from agents.history import HISTORY
from agents.tasks import HELD_OUT_SEED, TASKS, make_environment
from shared_control_env.core.observation import FEATURES
from shared_control_env.evaluation.catalogue import choose
from shared_control_env.evaluation.episodes import versions
from shared_control_env.evaluation.storage import write_atomically

ALGORITHMS: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "sac": SAC, "td3": TD3}
"""Algorithms by name."""

EVALUATION_EPISODES = 64
"""Episodes with held-out seeds by which the best policy is chosen."""

PROGRESS = "progress.json"
"""What is done so far, beside the checkpoint."""


def hyperparameters(algorithm: str, id: str) -> dict[str, Any]:
    """Hyperparameters of an algorithm, with those of the environment where it has its own."""
    tables = tomllib.loads((Path(__file__).parent / "hyperparameters.toml").read_text())
    return {**tables[algorithm], **tables.get(f"{algorithm}:{id}", {})}


class Steps(BaseCallback):
    """Tell the progress bar of every step, and measure how long the environment takes.

    Args:
        env: whose ``step_wait`` is timed.
        advance: called with the number of steps.
    """

    def __init__(self, env: VecEnv, advance: Any) -> None:
        super().__init__()
        self._advance, self.in_environment = advance, 0.0
        step_wait = env.step_wait

        def timed() -> Any:
            begin = time.perf_counter()
            result = step_wait()
            self.in_environment += time.perf_counter() - begin
            return result

        env.step_wait = timed  # type: ignore[method-assign]

    def _on_step(self) -> bool:
        self._advance(self.training_env.num_envs)
        return True


def score(model: BaseAlgorithm, id: str, task: str) -> float:
    """Mean return of the deterministic policy over episodes with held-out seeds."""
    env = make_environment(id, task, EVALUATION_EPISODES, HELD_OUT_SEED)
    observations: Any = env.reset()
    returns, running = np.zeros(EVALUATION_EPISODES), np.ones(EVALUATION_EPISODES, dtype=bool)
    while running.any():
        actions, _ = model.predict(observations, deterministic=True)
        observations, rewards, dones, _ = env.step(actions)
        returns += rewards * running
        running &= ~dones
    env.close()
    return float(returns.mean())


class Training:
    """A training in a folder.

    Args:
        folder: of the checkpoint, the best policy and the log.
        algorithm: key of :data:`ALGORITHMS`.
        id: of the environment.
        task: one of :data:`agents.tasks.TASKS`.
        seed: of everything.

    Raises:
        ValueError: if the folder holds a training of something else.
    """

    def __init__(self, folder: Path, algorithm: str, id: str, task: str, seed: int) -> None:
        self.folder, self.algorithm, self.id, self.task, self.seed = folder, algorithm, id, task, seed
        self.parameters = hyperparameters(algorithm, id)
        self.card: dict[str, Any] = {
            "algorithm": algorithm,
            "environment": id,
            "task": task,
            "seed": seed,
            "history": HISTORY,
            "hyperparameters": dict(self.parameters),
            "features": [name for name, _ in FEATURES],
            "versions": versions(),
        }
        self.environments, self.segment = self.parameters.pop("environments"), self.parameters.pop("segment")
        self.state: dict[str, Any] = {"card": self.card, "steps": 0, "scores": []}
        self.state |= {"seconds": 0.0, "in_environment": 0.0}
        if (folder / PROGRESS).is_file():
            self.state = json.loads((folder / PROGRESS).read_text())
            for name, wanted in self.card.items():
                if self.state["card"].get(name) != wanted:
                    raise ValueError(
                        f"{folder} holds a training with {name} = {self.state['card'].get(name)!r}, not {wanted!r}; "
                        "choose another --out"
                    )
        elif folder.exists() and any(folder.iterdir()):
            raise ValueError(f"{folder} holds files that are no training; choose another --out")

    @property
    def checkpoint(self) -> Path:
        """The model after the last whole segment."""
        return self.folder / f"checkpoint-{self.state['steps']}.zip"

    def run_segment(self, advance: Any) -> None:
        """Learn one segment, and keep checkpoint, score and, if it is the best, the policy."""
        (word,) = np.random.SeedSequence([self.seed, self.state["steps"]]).generate_state(1)
        segment_seed = int(word) % (HELD_OUT_SEED - self.environments)
        env = make_environment(self.id, self.task, self.environments, segment_seed)
        steps = Steps(env.venv.venv, advance)  # type: ignore[attr-defined]
        model = self._model(env)
        torch.set_num_threads(1)  # the networks are small: more threads wait for one another
        set_random_seed(segment_seed)
        begin = time.perf_counter()
        model.learn(self.segment, callback=steps, reset_num_timesteps=self.state["steps"] == 0)
        self.state["seconds"] += time.perf_counter() - begin
        self.state["in_environment"] += steps.in_environment
        env.close()
        self._keep(model)

    def _model(self, env: VecEnv) -> BaseAlgorithm:
        """A new model, or that of the checkpoint."""
        cls: Any = ALGORITHMS[self.algorithm]
        if self.state["steps"] == 0:
            return cls("MlpPolicy", env, seed=self.seed, device="cpu", **self.parameters)
        model = cls.load(self.checkpoint, env=env, device="cpu")
        buffer = self.checkpoint.with_suffix(".pkl")
        if buffer.is_file():
            model.load_replay_buffer(buffer)
        return model

    def _keep(self, model: Any) -> None:
        """Write what a segment gave; the progress last, so that a kill leaves the state before."""
        before, reached = self.checkpoint, score(model, self.id, self.task)
        self.state["steps"] = model.num_timesteps
        self.state["scores"].append([model.num_timesteps, reached])
        write_atomically(self.checkpoint, model.save)
        if hasattr(model, "replay_buffer"):
            write_atomically(self.checkpoint.with_suffix(".pkl"), model.save_replay_buffer)
        if reached >= max(value for _, value in self.state["scores"]):
            card = {**self.card, "steps": model.num_timesteps, "score": reached}
            policy = export(model, card)
            write_atomically(self.folder / "best.npz", policy.save)
        write_atomically(self.folder / PROGRESS, lambda draft: draft.write_text(json.dumps(self.state, indent=1)))
        for path in (before, before.with_suffix(".pkl")):
            if path != self.checkpoint:
                path.unlink(missing_ok=True)


def main(
    env: Annotated[str, typer.Option(help="Id of the environment.")] = "SharedControl/LaneKeeping-v0",
    algo: Annotated[str, typer.Option(help=f"One of: {', '.join(ALGORITHMS)}.")] = "ppo",
    task: Annotated[str, typer.Option(help=f"One of: {', '.join(TASKS)}.")] = "driver",
    steps: Annotated[int, typer.Option(min=1, help="Steps in all; whole segments are learned.")] = 3_000_000,
    seed: Annotated[int, typer.Option(min=0, help="Of everything.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder; by default under results/train.")] = None,
) -> None:
    """Train, or go on with a training that was stopped; the best policy is kept as best.npz."""
    console = Console()
    folder = out or Path("results/train") / f"{env.split('/')[-1]}-{task}-{algo}-{seed}"
    try:
        choose("algo", algo, ALGORITHMS)
        choose("task", task, dict.fromkeys(TASKS))
        choose("env", env, {id: None for id in gym.registry if id.startswith("SharedControl/")})
        training = Training(folder, algo, env, task, seed)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    columns = (TextColumn("steps"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console) as bar:
        progress = bar.add_task("steps", total=steps, completed=training.state["steps"])
        while training.state["steps"] < steps:
            training.run_segment(lambda n: bar.advance(progress, n))
            console.print(f"{training.state['steps']:,} steps: mean return {training.state['scores'][-1][1]:.1f}")
    share = training.state["in_environment"] / training.state["seconds"]
    console.print(
        f"{training.state['steps']:,} steps in {training.state['seconds']:.0f} s, {100.0 * share:.0f} % of it in the "
        f"environment; the best policy is {folder / 'best.npz'}."
    )


if __name__ == "__main__":
    typer.run(main)
