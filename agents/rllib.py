"""Train the same tasks on Ray, on one machine or a cluster: ``python -m agents.rllib``; needs the extra ``rllib``.

RLlib's env runners step environments in the compiled kernel, with the hyperparameters of :mod:`agents.train`. The
resulting policy is of the same kind, and :mod:`agents.evaluate` compares it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, NamedTuple

import gymnasium as gym
import numpy as np
import ray
import torch
import typer
from gymnasium.vector import VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space
from ray.rllib.algorithms import Algorithm
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.algorithms.ppo.torch.default_ppo_torch_rl_module import DefaultPPOTorchRLModule
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.rllib.core.rl_module.rl_module import RLModuleSpec
from ray.tune.registry import register_env
from rich.console import Console

from agents.card import card_of
from agents.hyperparameters import hyperparameters
from agents.tasks import TASKS, VALIDATION_SEED, training_config
from shared_control_env.evaluation.catalogue import choose
from shared_control_env.evaluation.progress import progress_bar
from shared_control_env.evaluation.storage import write_atomically
from shared_control_env.learned.history import HISTORY, History
from shared_control_env.learned.policy import Policy, as_array64, fold
from shared_control_env.learned.views import ACTION_OF, FEATURES_OF, view
from shared_control_env.registration import ENVIRONMENTS

ENVIRONMENT = "shared_control_task"
"""Name under which the environments are registered with Ray."""

EXCLUDED = ["results", "docs", ".venv*", ".git"]
"""Parts of the checkout that the workers do not need."""

HYPERPARAMETERS = hyperparameters("ppo", [])
"""The same hyperparameters as those of :mod:`agents.train`."""

LOG_STD = HYPERPARAMETERS["policy_kwargs"]["log_std_init"]
"""Initial logarithm of the exploration's standard deviation."""


class Normalisation(NamedTuple):
    """Normalisation of what a policy sees.

    Attributes:
        mean, std: mean and standard deviation, each of shape (HISTORY * size,).
    """

    mean: np.ndarray
    std: np.ndarray


class TaskVectorEnv(VectorWrapper):
    """Environments of a task with the history of observations, equivalent to :func:`agents.vec_envs.make_environment`.

    Args:
        env: environments with Gymnasium's next-step autoreset, which RLlib expects.
        task: key of :data:`agents.tasks.TASKS`.
        normalisation: normalisation of what a policy sees.
    """

    def __init__(self, env: VectorEnv, task: str, normalisation: Normalisation) -> None:
        super().__init__(env)
        size = len(FEATURES_OF[task])
        self.single_observation_space = gym.spaces.Box(-np.inf, np.inf, (HISTORY * size,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, env.num_envs)
        self.single_action_space = gym.spaces.Box(-1.0, 1.0, env.single_action_space.shape, np.float32)
        self.action_space = batch_space(self.single_action_space, env.num_envs)
        self._task, self._normalisation = task, normalisation
        self._history, self._ended = History(env.num_envs, size), np.ones(env.num_envs, dtype=bool)

    def reset(self, *, seed: Any = None, options: Any = None) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin new episodes.

        Args:
            seed: seed or seeds of the environments, or None.
            options: options of Gymnasium's ``reset``.
        """
        observations, _ = self.env.reset(seed=seed, options=options)
        self._ended[:] = True
        return self._seen(observations), {}

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Step all environments; environments whose episode has ended begin a new one.

        Args:
            actions: actions of the policy in [-1, 1], shape (N, n).
        """
        observations, rewards, terminations, truncations, _ = self.env.step(ACTION_OF[self._task](actions))
        seen = self._seen(observations)
        self._ended = terminations | truncations
        return seen, rewards, terminations, truncations, {}

    def _seen(self, observations: np.ndarray) -> np.ndarray:
        kernel: Any = self.env.unwrapped
        viewed = view(self._task, observations, kernel.scenes, kernel.signals)
        self._history.forget(self._ended)
        self._ended = np.zeros_like(self._ended)
        return ((self._history.push(viewed) - self._normalisation.mean) / self._normalisation.std).astype(np.float32)


class TrainingSeeds(VectorWrapper):
    """Maps the consecutive seeds that RLlib gives to its runners to seeds that are spread over the training range."""

    def reset(self, *, seed: Any = None, options: Any = None) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin new episodes.

        Args:
            seed: seed from RLlib, or None.
            options: options of Gymnasium's ``reset``.
        """
        if seed is not None:
            (word,) = np.random.SeedSequence(seed).generate_state(1)
            seed = int(word) % (VALIDATION_SEED - self.num_envs)
        return self.env.reset(seed=seed, options=options)


class QuietPPOModule(DefaultPPOTorchRLModule):
    """PPO's network with an initial exploration of :data:`LOG_STD`."""

    def setup(self) -> None:
        """Create the layers and set the initial exploration."""
        super().setup()
        with torch.no_grad():
            self.pi.log_std.fill_(LOG_STD)


def make_environment(id: str, task: str, normalisation: Normalisation, num_envs: int) -> TaskVectorEnv:
    """Environments of one env runner.

    Args:
        id: id of the environment.
        task: key of :data:`agents.tasks.TASKS`.
        normalisation: normalisation of what the policy sees.
        num_envs: number of environments.
    """
    bound: Any = {"limiter": task == "driver", "driver": task == "allocator"}
    env = gym.make_vec(id, num_envs=num_envs, config=training_config(id, task), threads=1, **bound)
    return TaskVectorEnv(env, task, normalisation)


def measured_normalisation(id: str, task: str, num_envs: int = 64, steps: int = 200) -> Normalisation:
    """Mean and standard deviation of a policy's input under pure exploration; the deviation is 1 for a constant entry.

    The statistics are measured once. Running statistics would have to be kept equal across a cluster.

    Args:
        id: id of the environment.
        task: key of :data:`agents.tasks.TASKS`.
        num_envs: number of environments.
        steps: number of steps of each environment.
    """
    size = HISTORY * len(FEATURES_OF[task])
    env = make_environment(id, task, Normalisation(np.zeros(size), np.ones(size)), num_envs)
    rng = np.random.default_rng(0)
    seen = [env.reset(seed=0)[0]]
    for _ in range(steps):
        actions = np.exp(LOG_STD) * rng.normal(size=env.action_space.shape or ())
        seen.append(env.step(np.clip(actions, -1.0, 1.0).astype(np.float32))[0])
    env.close()
    std = np.std(seen, axis=(0, 1))
    return Normalisation(np.mean(seen, axis=(0, 1)), np.where(std > 1e-6, std, 1.0))


def make_algorithm(
    id: str,
    task: str,
    seed: int,
    normalisation: Normalisation,
    runners: int = 1,
    environments: int = HYPERPARAMETERS["environments"],
    steps: int = HYPERPARAMETERS["n_steps"],
) -> Algorithm:
    """PPO on the connected Ray cluster.

    Args:
        id: id of the environment.
        task: key of :data:`agents.tasks.TASKS`.
        seed: seed of all random numbers.
        normalisation: normalisation of what the policy sees.
        runners: number of env runners, each a process somewhere in the cluster.
        environments: number of environments of each runner.
        steps: number of steps of each environment between two updates.
    """
    given, batch = HYPERPARAMETERS, runners * environments * steps
    register_env(
        ENVIRONMENT,
        lambda context: TrainingSeeds(make_environment(id, task, normalisation, context.get("num_envs", 1))),
    )
    model = DefaultModelConfig(
        fcnet_hiddens=given["policy_kwargs"]["net_arch"],
        fcnet_activation="tanh",
        vf_share_layers=False,
        free_log_std=True,
    )
    halvings = range(10)
    config = (
        PPOConfig()
        .environment(ENVIRONMENT)
        .env_runners(
            num_env_runners=runners,
            num_envs_per_env_runner=environments,
            rollout_fragment_length=steps,
            gym_env_vectorize_mode=gym.VectorizeMode.VECTOR_ENTRY_POINT,
        )
        .training(
            train_batch_size_per_learner=batch,
            minibatch_size=min(given["batch_size"], batch),
            num_epochs=given["n_epochs"],
            gamma=given["gamma"],
            lambda_=given["gae_lambda"],
            lr=[[i * given["half_life"], given["learning_rate"] * 0.5**i] for i in halvings],
            clip_param=given["clip_range"],
            vf_clip_param=float("inf"),
            grad_clip=0.5,
            use_kl_loss=False,
        )
        .rl_module(rl_module_spec=RLModuleSpec(module_class=QuietPPOModule, model_config=model))
        .debugging(seed=seed)
    )
    return config.build_algo()


def export(algorithm: Algorithm, normalisation: Normalisation, card: dict[str, Any]) -> Policy:
    """The deterministic policy of the algorithm.

    Args:
        algorithm: algorithm of :func:`make_algorithm`.
        normalisation: normalisation of what the policy sees.
        card: card that is stored with the policy.
    """
    module: Any = algorithm.get_module()
    parts = [*module.encoder.actor_encoder.net.mlp, *module.pi.net.mlp]
    linear = [part for part in parts if isinstance(part, torch.nn.Linear)]
    layers = [(as_array64(part.weight), as_array64(part.bias)) for part in linear]
    return Policy(fold(layers, *normalisation), "tanh", False, card)


def connect(address: str) -> None:
    """Connect to a Ray cluster, or start one on this machine.

    The other machines of a cluster receive the sources from this one. The dependencies must be installed on them.

    Args:
        address: address of the cluster, ``auto``, or ``local`` for a new cluster on this machine.
    """
    if address == "local":
        ray.init(include_dashboard=False)
    else:
        root = str(Path(__file__).parents[1])
        ray.init(address=address, runtime_env={"working_dir": root, "excludes": EXCLUDED})


def main(
    env: Annotated[str, typer.Option(help="Id of the environment.")] = "SharedControl/LaneKeeping-v1",
    task: Annotated[str, typer.Option(help=f"One of: {', '.join(TASKS)}.")] = "driver",
    steps: Annotated[int, typer.Option(min=1, help="Steps in all; whole updates are made.")] = 1_000_000,
    runners: Annotated[int, typer.Option(min=1, help="Env runners, a core each.")] = 1,
    environments: Annotated[int, typer.Option(min=1, help="Environments of each runner.")] = (
        HYPERPARAMETERS["environments"]
    ),
    address: Annotated[
        str, typer.Option(help="Of a Ray cluster; auto for this machine's, local for a new one.")
    ] = "local",
    seed: Annotated[int, typer.Option(min=0, help="Of everything.")] = 0,
    out: Annotated[Path | None, typer.Option(help="File of the policy; by default under results/rllib.")] = None,
) -> None:
    """Train on Ray, and keep the policy as an .npz file."""
    console = Console()
    path = out or Path("results/rllib") / f"{env.split('/')[-1]}-{task}-{seed}.npz"
    try:
        choose("env", env, ENVIRONMENTS)
        choose("task", task, TASKS)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    if path.suffix != ".npz":
        raise typer.BadParameter(f"out = {path} must end with .npz")
    if path.exists():
        raise typer.BadParameter(f"{path} already exists; choose another --out")
    card = card_of("ppo on RLlib", [env], task, seed, HYPERPARAMETERS, ("ray", "torch"))
    connect(address)
    normalisation = measured_normalisation(env, task)
    algorithm = make_algorithm(env, task, seed, normalisation, runners, environments)
    with progress_bar(console) as bar:
        progress, done = bar.add_task("steps", total=steps), 0
        while done < steps:
            result = algorithm.train()
            done = result["env_runners"]["num_env_steps_sampled_lifetime"]
            bar.update(progress, completed=done)
    policy = export(algorithm, normalisation, {**card, "steps": int(done)})
    write_atomically(path, policy.save)
    algorithm.stop()
    ray.shutdown()
    console.print(f"The policy is {path}; compare it by: python -m agents.evaluate {path} --task {task}")


if __name__ == "__main__":
    typer.run(main)
