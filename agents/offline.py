"""Offline reinforcement learning from a Minari dataset: ``python -m agents.offline --data ID``.

It runs in a virtual environment of its own (``make offline``): d3rlpy pins a Gymnasium that is older than ours. For the
same reason it imports only what reads a dataset and writes a policy; :mod:`agents.evaluate` compares the policy.
"""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import d3rlpy
import numpy as np
import torch
import typer
from d3rlpy.algos import BCConfig, IQLConfig, TD3PlusBCConfig
from d3rlpy.dataset import MDPDataset
from d3rlpy.logging import NoopAdapterFactory
from d3rlpy.preprocessing import StandardObservationScaler

from shared_control_env.learned.card import check_goes_on, new_card
from shared_control_env.learned.policy import Policy, as_array64, fold
from shared_control_env.recordings.samples import Samples, joined, samples_of

ALGORITHMS = {"td3_plus_bc": TD3PlusBCConfig, "iql": IQLConfig, "bc": BCConfig}
"""Algorithms by name."""

GAMMA = 0.98
"""Discount of a step, as in training by reward [-]."""

POLICY, PROGRESS = "policy.npz", "progress.json"
"""Files of a learning: the policy and the progress; beside them lie d3rlpy's networks after the last steps."""


def buffer_of(samples: Samples) -> MDPDataset:
    """d3rlpy's form of the steps of a dataset; the actions are those that were executed.

    Args:
        samples: the steps.
    """
    return MDPDataset(
        observations=samples.seen,
        actions=samples.executed,
        rewards=samples.rewards[:, None],
        terminals=samples.ends.astype(np.float32),
        timeouts=(samples.last & ~samples.ends).astype(np.float32),
        action_space=d3rlpy.constants.ActionSpace.CONTINUOUS,
        action_size=2,
    )


def policy_of(learner: Any, card: dict[str, Any]) -> Policy:
    """The deterministic policy of a learner.

    Args:
        learner: learner of d3rlpy with a multilayer perceptron.
        card: card that is stored with the policy.
    """
    linear = [part for part in learner.impl.policy.modules() if isinstance(part, torch.nn.Linear)]
    scaler = learner.config.observation_scaler
    layers = [(as_array64(part.weight), as_array64(part.bias)) for part in linear]
    return Policy(fold(layers, scaler.mean, scaler.std + scaler.eps), "relu", True, card)


def main(
    data: Annotated[str, typer.Option(help="Id of a Minari dataset, as agents.demonstrate or to_minari makes it.")],
    algo: Annotated[str, typer.Option(help=f"One of: {', '.join(ALGORITHMS)}.")] = "td3_plus_bc",
    steps: Annotated[int, typer.Option(min=1, help="Steps of the optimiser.")] = 100_000,
    epoch: Annotated[int, typer.Option(min=1, help="Steps between two checkpoints.")] = 10_000,
    seed: Annotated[int, typer.Option(min=0, help="Of everything.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder; by default under results/offline.")] = None,
) -> None:
    """Learn from a dataset alone, or go on with a learning that was stopped; the policy is policy.npz."""
    folder = out or Path("results/offline") / f"{data.replace('/', '-')}-{algo}-{seed}"
    try:
        if algo not in ALGORITHMS:
            raise ValueError(f"algo = {algo!r} must be one of {', '.join(ALGORITHMS)}")
        dataset = samples_of(data)
        parameters = {"gamma": GAMMA} if algo != "bc" else {}
        used = ", ".join(f"{name} {version(name)}" for name in ("shared_control_env", "d3rlpy", "torch", "minari"))
        card = new_card(algo, "driver", seed, parameters, {dataset.id: dataset.config}, 0.0, used)
        card["dataset"] = dataset.about
        done = progress_of(folder, card)
    except (ImportError, ValueError) as error:
        raise typer.BadParameter(str(error)) from None
    learner = ALGORITHMS[algo](observation_scaler=StandardObservationScaler(), **parameters).create(device="cpu:0")
    buffer = buffer_of(joined(dataset.episodes))
    torch.set_num_threads(1)  # the networks are small: more threads only wait for each other
    d3rlpy.seed(seed + done)
    learner.build_with_dataset(buffer)
    if done:
        learner.load_model(model_after(folder, done))
    folder.mkdir(parents=True, exist_ok=True)
    while done < steps:
        count = min(epoch, steps - done)
        d3rlpy.seed(seed + done)
        learner.fit(buffer, count, count, logger_adapter=NoopAdapterFactory(), save_interval=2)
        done += count
        keep(folder, learner, card, done)
    typer.echo(
        f"{done:,} steps; the policy is {folder / POLICY}. To compare it: python -m agents.evaluate {folder / POLICY}"
    )


def model_after(folder: Path, steps: int) -> Path:
    """File of d3rlpy's networks after a number of steps.

    Args:
        folder: folder of the learning.
        steps: number of steps of the optimiser.
    """
    return folder / f"model-{steps}.pt"


def keep(folder: Path, learner: Any, card: dict[str, Any], done: int) -> None:
    """Write what a learning needs to go on; the progress is written last, so that a kill leaves the state before.

    Args:
        folder: folder of the learning.
        learner: learner of d3rlpy.
        card: card of the learning.
        done: number of steps so far.
    """
    before = set(folder.glob("model-*.pt"))
    learner.save_model(model_after(folder, done))
    progress = json.dumps({"card": card, "steps": done}, indent=1)
    for name, write in (
        (POLICY, policy_of(learner, {**card, "steps": done}).save),
        (PROGRESS, lambda draft: draft.write_text(progress)),
    ):
        draft = folder / f"draft-{name}"
        write(draft)
        draft.replace(folder / name)
    for path in before - {model_after(folder, done)}:
        path.unlink()


def progress_of(folder: Path, card: dict[str, Any]) -> int:
    """Number of steps so far in a folder.

    Args:
        folder: the folder.
        card: card of the learning.

    Raises:
        ValueError: if the folder holds something else.
    """
    state = json.loads((folder / PROGRESS).read_text()) if (folder / PROGRESS).is_file() else None
    check_goes_on(folder, state and state["card"], card, "learning")
    return int(state["steps"]) if state else 0


if __name__ == "__main__":
    typer.run(main)
