"""Train a driver or an allocator: ``python -m agents.train --algo ppo --env SharedControl/LaneKeeping-v1``.

Training proceeds in segments. Each segment begins from the checkpoint of the segment before. All random numbers are
then seeded again from the seed and the number of steps so far. A training that was killed and started again therefore
gives the same policy as an uninterrupted one.
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import torch
import typer
from rich.console import Console
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import VecEnv, VecNormalize, unwrap_vec_wrapper

from agents.card import card_of
from agents.export import export
from agents.hyperparameters import hyperparameters
from agents.model_driver import ALGORITHMS
from agents.tasks import TASKS, VALIDATION_SEED
from agents.vec_envs import Timed, make_environment
from shared_control_env.evaluation.catalogue import choose
from shared_control_env.evaluation.interrupt import resumable
from shared_control_env.evaluation.progress import progress_bar
from shared_control_env.evaluation.storage import write_atomically
from shared_control_env.learned.card import check_goes_on
from shared_control_env.learned.policy import Policy
from shared_control_env.registration import ENVIRONMENTS

VALIDATION_EPISODES = 500
"""Number of episodes by which the best policy is chosen, with seeds not used in training; failures are rare."""

EPSILON = 1e-6
"""Variance added to the variance of every entry of what a policy sees; the smallest of these is twice as large."""

PROGRESS = "progress.json"
"""File with the progress so far, in the folder of the checkpoint."""

BEST = "best.npz"
"""File of the best policy so far; its card is stored beside it as JSON."""

TENSORBOARD = "tensorboard"
"""Folder of the TensorBoard log."""


PARTS = ("environment", "adapters", "policy", "learning")
"""What a training spends its time on; the adapters make what the policy sees of what the environment returns."""


class Advance(BaseCallback):
    """Callback that advances the progress bar at every step, and measures the time between updates of the policy.

    Args:
        advance: called with the number of steps.

    Attributes:
        seconds: time spent in rollouts so far [s].
    """

    def __init__(self, advance: Callable[[int], None]) -> None:
        super().__init__()
        self._advance = advance
        self.seconds = 0.0

    def _on_rollout_start(self) -> None:
        self._begin = time.perf_counter()

    def _on_rollout_end(self) -> None:
        self.seconds += time.perf_counter() - self._begin

    def _on_step(self) -> bool:
        self._advance(self.training_env.num_envs)
        return True


def validate(policy: Policy, ids: Sequence[str], task: str) -> float:
    """Mean return over episodes with seeds reserved for validation.

    Args:
        policy: the policy.
        ids: ids of the environments, each with an equal share of the episodes.
        task: key of :data:`agents.tasks.TASKS`.
    """
    episodes = VALIDATION_EPISODES - VALIDATION_EPISODES % len(ids)
    env = make_environment(ids, task, episodes, VALIDATION_SEED)
    observations: Any = env.reset()
    returns, running = np.zeros(episodes), np.ones(episodes, dtype=bool)
    while running.any():
        observations, rewards, dones, _ = env.step(policy.act(observations))
        returns += rewards * running
        running &= ~dones
    env.close()
    return float(returns.mean())


class Training:
    """A training, with its state in a folder.

    Args:
        folder: folder of the checkpoint, the best policy and the log.
        algorithm: key of :data:`ALGORITHMS`.
        ids: ids of the environments.
        task: key of :data:`agents.tasks.TASKS`.
        seed: seed of all random numbers.

    Attributes:
        folder, algorithm, ids, task, seed: as the arguments.
        parameters: hyperparameters of the algorithm.
        card: card of the training; see :mod:`agents.card`.
        environments: number of environments.
        segment: number of steps in a segment.
        half_life: number of steps in which the learning rate halves.
        state: progress, as stored in :data:`PROGRESS`.

    Raises:
        ValueError: if the folder holds something else, such as a training with other arguments.
    """

    def __init__(self, folder: Path, algorithm: str, ids: Sequence[str], task: str, seed: int) -> None:
        self.folder, self.algorithm, self.ids, self.task, self.seed = folder, algorithm, list(ids), task, seed
        self.parameters = hyperparameters(algorithm, ids)
        libraries = ("stable-baselines3", "torch")
        self.card = card_of(algorithm, self.ids, task, seed, self.parameters, libraries)
        self.environments, self.segment = self.parameters.pop("environments"), self.parameters.pop("segment")
        self.half_life = self.parameters.pop("half_life")
        self.state: dict[str, Any] = {"card": self.card, "steps": 0, "scores": []}
        self.state |= {"seconds": 0.0, "seconds_in": dict.fromkeys(PARTS, 0.0)}
        stored = json.loads((folder / PROGRESS).read_text()) if (folder / PROGRESS).is_file() else None
        check_goes_on(folder, stored and stored["card"], self.card, "training")
        self.state = stored or self.state

    def _kept(self, suffix: str) -> Path:
        """A file of the state after the last complete segment."""
        return self.folder / f"checkpoint-{self.state['steps']}{suffix}"

    def run_segment(self, advance: Callable[[int], None]) -> None:
        """Learn one segment, and store the checkpoint, the score and, if it is the best so far, the policy.

        Args:
            advance: called with the number of steps.
        """
        (word,) = np.random.SeedSequence([self.seed, self.state["steps"]]).generate_state(1)
        segment_seed = int(word) % (VALIDATION_SEED - self.environments)
        self._begin()
        bare = make_environment(self.ids, self.task, self.environments, segment_seed)
        inner: Any = unwrap_vec_wrapper(bare, Timed)
        normalised = self._normalised(bare)
        env = Timed(normalised)
        model, progress = self._model(env), Advance(advance)
        torch.set_num_threads(1)  # the networks are small: more threads only wait for each other
        set_random_seed(segment_seed)
        env.seed(segment_seed)  # the model has seeded them with its own seed
        begin = time.perf_counter()
        model.learn(
            self.segment,
            callback=progress,
            tb_log_name="training",
            reset_num_timesteps=self.state["steps"] == 0,
        )
        seconds = time.perf_counter() - begin
        self.state["seconds"] += seconds
        ends = 0.0, inner.seconds, env.seconds, progress.seconds, seconds
        for part, lower, upper in zip(PARTS, ends, ends[1:], strict=False):
            self.state["seconds_in"][part] += upper - lower
        env.close()
        self._keep(model, normalised)

    def _begin(self) -> None:
        """Mark the folder as a training before the first segment is complete, and drop the log of an incomplete one."""
        if self.state["steps"] == 0:
            shutil.rmtree(self.folder / TENSORBOARD, ignore_errors=True)
            self._note_progress()

    def _note_progress(self) -> None:
        write_atomically(self.folder / PROGRESS, lambda draft: draft.write_text(json.dumps(self.state, indent=1)))

    def _normalised(self, env: VecEnv) -> VecNormalize:
        """Observations normalised by their running mean and standard deviation, which continue from the checkpoint."""
        if self.state["steps"] == 0:
            # The epsilon limits the gain of a constant entry, such as the curvature of a straight road.
            return VecNormalize(env, norm_reward=False, clip_obs=np.inf, epsilon=EPSILON)
        return VecNormalize.load(str(self._kept("-normalisation.pkl")), env)

    def _model(self, env: VecEnv) -> BaseAlgorithm:
        """A new model, or that of the checkpoint."""
        cls: Any = ALGORITHMS[self.algorithm]
        log = str(self.folder / TENSORBOARD)
        rate = self.parameters["learning_rate"] * 0.5 ** (self.state["steps"] / self.half_life)
        if self.state["steps"] == 0:
            parameters = dict(self.parameters)
            if "action_noise" in parameters:
                zeros = np.zeros(env.action_space.shape or ())
                parameters["action_noise"] = NormalActionNoise(zeros, zeros + parameters["action_noise"])
            return cls("MlpPolicy", env, seed=self.seed, device="cpu", tensorboard_log=log, **parameters)
        changed = {"learning_rate": rate, "tensorboard_log": log}
        model = cls.load(self._kept(".zip"), env=env, device="cpu", custom_objects=changed)
        if self._kept("-replay.pkl").is_file():
            model.load_replay_buffer(self._kept("-replay.pkl"))
        return model

    def _keep(self, model: Any, normalisation: VecNormalize) -> None:
        """Store the results of a segment; the progress is written last, so that a kill leaves the state before."""
        before = set(self.folder.glob("checkpoint-*"))
        policy = export(model, normalisation, {**self.card, "steps": model.num_timesteps})
        policy.card["score"] = reached = validate(policy, self.ids, self.task)
        model.logger.record("validation/mean_return", reached)
        model.logger.dump(model.num_timesteps)
        self.state["steps"] = model.num_timesteps
        self.state["scores"].append([model.num_timesteps, reached])
        write_atomically(self._kept(".zip"), model.save)
        write_atomically(self._kept("-normalisation.pkl"), lambda draft: normalisation.save(str(draft)))
        if hasattr(model, "replay_buffer"):
            write_atomically(self._kept("-replay.pkl"), model.save_replay_buffer)
        if reached >= max(value for _, value in self.state["scores"]):
            write_atomically(self.folder / BEST, policy.save)
            card = {**policy.card, "specs": [json.loads(gym.spec(id).to_json()) for id in self.ids]}
            text = json.dumps(card, indent=1)
            write_atomically((self.folder / BEST).with_suffix(".json"), lambda draft: draft.write_text(text))
        self._note_progress()
        for path in before - set(self.folder.glob(f"checkpoint-{self.state['steps']}*")):
            path.unlink(missing_ok=True)


def main(
    env: Annotated[
        str, typer.Option(help="Ids of environments, separated by commas; one named twice has twice the share.")
    ] = "SharedControl/LaneKeeping-v1",
    algo: Annotated[str, typer.Option(help=f"One of: {', '.join(ALGORITHMS)}.")] = "ppo",
    task: Annotated[str, typer.Option(help=f"One of: {', '.join(TASKS)}.")] = "driver",
    steps: Annotated[int, typer.Option(min=1, help="Steps in all; whole segments are learned.")] = 3_000_000,
    seed: Annotated[int, typer.Option(min=0, help="Of everything.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder; by default under results/train.")] = None,
) -> None:
    """Train, or go on with a training that was stopped; the best policy is kept as best.npz."""
    console = Console()
    ids = [id.strip() for id in env.split(",")]
    name = "-".join(id.split("/")[-1] for id in ids) if len(ids) < 4 else f"{len(ids)}-environments"
    folder = out or Path("results/train") / f"{name}-{task}-{algo}-{seed}"
    try:
        choose("algo", algo, ALGORITHMS)
        choose("task", task, TASKS)
        choose("env", ids, ENVIRONMENTS)
        with resumable(folder):
            training = Training(folder, algo, ids, task, seed)
            run(training, steps, console)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    seconds, parts = training.state["seconds"], training.state["seconds_in"].items()
    spent = ", ".join(f"{part} {100.0 * own / seconds:.0f} %" for part, own in parts)
    console.print(
        f"{training.state['steps']:,} steps in {seconds:.0f} s ({spent}); the best policy is {folder / BEST}, the log "
        f"{folder / TENSORBOARD}."
    )


def run(training: Training, steps: int, console: Console) -> None:
    """Learn segments until the number of steps is reached, and show the progress.

    Args:
        training: the training.
        steps: number of steps in all [-].
        console: where the progress is shown.
    """
    whole = -(-steps // training.segment) * training.segment
    if whole > steps:
        console.print(f"{steps:,} steps are rounded up to {whole:,}: segments of {training.segment:,} are learned.")
    with progress_bar(console) as bar:
        progress = bar.add_task("steps", total=whole, completed=training.state["steps"])
        while training.state["steps"] < steps:
            training.run_segment(lambda n: bar.advance(progress, n))
            console.print(f"{training.state['steps']:,} steps: mean return {training.state['scores'][-1][1]:.1f}")


if __name__ == "__main__":
    typer.run(main)
