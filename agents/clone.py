"""Clone a driver from a Minari dataset: ``python -m agents.clone --data ID``; needs the extras train and minari.

The policy is a Gaussian whose mean is a network of what a learned driver sees and whose standard deviation is constant
for each channel. It is fitted by maximum likelihood. Of all episodes, a tenth chooses the best epoch, and another tenth
measures the likelihood.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from itertools import pairwise
from math import log, pi
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import torch
import typer
from rich.console import Console

from agents.card import versions_with
from agents.demonstrate import AUTHORITY, with_arm
from agents.drivers import driver_entry
from agents.hyperparameters import hyperparameters
from agents.tasks import HELD_OUT_SEED
from shared_control_env.evaluation import Suite, evaluate
from shared_control_env.evaluation.catalogue import DRIVERS
from shared_control_env.evaluation.interrupt import resumable
from shared_control_env.evaluation.progress import progress_bar
from shared_control_env.evaluation.storage import write_atomically
from shared_control_env.learned.card import check_goes_on, new_card
from shared_control_env.learned.policy import Policy, as_array64, fold
from shared_control_env.recordings.samples import Samples, joined, samples_of
from shared_control_env.registration import ENVIRONMENTS

POLICY, CHECKPOINT = "best.npz", "checkpoint.pt"
"""Files of a cloning: the policy of the best epoch, and the state after the last epoch."""

PARTS = 10
"""Of so many episodes one chooses the best epoch, and one measures the likelihood."""

EPSILON = 1e-6
"""Variance added to that of every entry of what the policy sees, some of which are constant."""


class Split(NamedTuple):
    """Steps of different episodes.

    Attributes:
        training, validation, test: what the driver saw and wanted.
    """

    training: Samples
    validation: Samples
    test: Samples


def split(episodes: Sequence[Samples]) -> Split:
    """Divide episodes: one in :data:`PARTS` validates, one tests, and the others train.

    Args:
        episodes: the episodes, at least three.

    Raises:
        ValueError: if there are fewer than three.
    """
    if len(episodes) < 3:
        raise ValueError(
            f"the dataset has {len(episodes)} episode(s); three are needed: to train, to validate, to test"
        )
    parts = min(PARTS, len(episodes))
    chosen = [
        [each for i, each in enumerate(episodes) if test(i % parts)]
        for test in (lambda i: i < parts - 2, lambda i: i == parts - 2, lambda i: i == parts - 1)
    ]
    return Split(*map(joined, chosen))


def log_likelihood(error: np.ndarray, std: np.ndarray) -> float:
    """Mean logarithm of the density of a command, of both channels together [nat].

    Args:
        error: command minus mean, shape (n, 2) [-].
        std: standard deviations, shape (2,) [-].
    """
    return float(np.mean(np.sum(-0.5 * (error / std) ** 2 - np.log(std) - 0.5 * log(2.0 * pi), axis=1)))


class Cloning:
    """A cloning, with its state in a folder.

    Args:
        folder: folder of the checkpoint and the policy.
        data: steps of the dataset.
        card: card of the policy; see :mod:`agents.card`.

    Attributes:
        epochs: number of epochs in all.
        done: number of epochs so far.
        best: largest mean log-likelihood of the validation so far [nat].

    Raises:
        ValueError: if the folder holds something else, such as a cloning of other data.
    """

    def __init__(self, folder: Path, data: Split, card: dict[str, Any]) -> None:
        self._folder, self._data, self._card = folder, data, card
        self._parameters = card["hyperparameters"]
        self.epochs, self.done, self.best = self._parameters["epochs"], 0, -np.inf
        self._mean = data.training.seen.mean(axis=0, dtype=float)
        self._std = np.sqrt(data.training.seen.var(axis=0, dtype=float) + EPSILON)
        torch.manual_seed(card["seed"])
        torch.set_num_threads(1)  # the network is small: more threads only wait for each other
        sizes = [data.training.seen.shape[1], *self._parameters["net_arch"]]
        hidden = [part for pair in pairwise(sizes) for part in (torch.nn.Linear(*pair), torch.nn.Tanh())]
        self._network = torch.nn.Sequential(*hidden, torch.nn.Linear(sizes[-1], 2))
        spread = data.training.wanted.std(axis=0, dtype=float) + EPSILON
        self._log_std = torch.nn.Parameter(torch.from_numpy(np.log(spread).astype(np.float32)))
        rate = self._parameters["learning_rate"]
        self._optimiser = torch.optim.Adam([*self._network.parameters(), self._log_std], lr=rate)
        self._schedule = torch.optim.lr_scheduler.CosineAnnealingLR(self._optimiser, self.epochs)
        self._stateful: dict[str, Any] = {
            "network": self._network,
            "optimiser": self._optimiser,
            "schedule": self._schedule,
        }
        self._go_on()

    def _go_on(self) -> None:
        """Adopt the checkpoint of the folder, if there is one."""
        path = self._folder / CHECKPOINT
        state = torch.load(path, weights_only=True) if path.is_file() else None
        check_goes_on(self._folder, state and json.loads(state["card"]), self._card, "cloning")
        if state is None:
            return
        self.done, self.best = state["done"], state["best"]
        for name, part in self._stateful.items():
            part.load_state_dict(state[name])
        self._log_std.data = state["log_std"]

    def run_epoch(self) -> None:
        """Fit the policy to every step once; keep it if it is the best so far, and the state."""
        seen, wanted = self._tensors(self._data.training)
        order = torch.from_numpy(np.random.default_rng([self._card["seed"], self.done]).permutation(len(seen)))
        for batch in order.split(self._parameters["batch_size"]):
            error = wanted[batch] - self._network(seen[batch])
            loss = (0.5 * (error / self._log_std.exp()) ** 2 + self._log_std).sum(dim=1).mean()
            self._optimiser.zero_grad()
            loss.backward()
            self._optimiser.step()
        self._schedule.step()
        self.done += 1
        policy = self._policy()
        reached = likelihood_of(policy, self._data.validation)
        if reached > self.best:
            self.best = reached
            write_atomically(self._folder / POLICY, policy.save)
        state = {name: part.state_dict() for name, part in self._stateful.items()}
        state |= {"log_std": self._log_std.data, "done": self.done, "best": self.best, "card": json.dumps(self._card)}
        write_atomically(self._folder / CHECKPOINT, lambda draft: torch.save(state, draft))

    def _tensors(self, samples: Samples) -> tuple[torch.Tensor, torch.Tensor]:
        normalised = ((samples.seen - self._mean) / self._std).astype(np.float32)
        return torch.from_numpy(normalised), torch.from_numpy(samples.wanted)

    def _policy(self) -> Policy:
        linear = [part for part in self._network if isinstance(part, torch.nn.Linear)]
        layers = fold([(as_array64(part.weight), as_array64(part.bias)) for part in linear], self._mean, self._std)
        std = np.exp(as_array64(self._log_std)).tolist()
        return Policy(layers, "tanh", False, {**self._card, "std": std, "epoch": self.done})


def likelihood_of(policy: Policy, samples: Samples) -> float:
    """Mean log-likelihood of commands under a cloned policy [nat].

    Args:
        policy: the policy, whose card has ``std``.
        samples: what the driver saw and wanted.
    """
    return log_likelihood(samples.wanted - policy.act(samples.seen), np.array(policy.card["std"]))


def compare(path: Path, id: str, driver: str, seeds: int, progress: Callable[[int, int], None]) -> dict[Any, float]:
    """Mean lateral RMS of the clone and of its driver, in the same held-out episodes [m].

    Args:
        path: file of the policy.
        id: id of the environment.
        driver: name of the driver in the catalogue.
        seeds: number of episodes.
        progress: called with the number of finished episodes and the number of all episodes.
    """
    entry = with_arm(DRIVERS[driver])
    arms = tuple(draw for draw in entry.draws if draw["setting"].startswith("driver_lag."))
    lag = {name: value for name, value in entry.config.items() if name == "driver_lag"}
    clone = driver_entry(str(path))
    entries = {"clone": clone._replace(config={**clone.config, **lag}, draws=arms), driver: entry}
    suite = Suite("held-out episodes", (ENVIRONMENTS[id],), (None,))
    numbers = range(HELD_OUT_SEED, HELD_OUT_SEED + seeds)
    table = evaluate(entries, AUTHORITY, suite, seeds=numbers, progress=progress)
    return {name: float(part["lateral_rms"].mean()) for name, part in table.groupby("driver")}


def main(
    data: Annotated[str, typer.Option(help="Id of a Minari dataset, as agents.demonstrate or to_minari makes it.")],
    seed: Annotated[int, typer.Option(min=0, help="Of everything.")] = 0,
    episodes: Annotated[int, typer.Option(min=1, help="Held-out episodes of the comparison with its driver.")] = 200,
    out: Annotated[Path | None, typer.Option(help="Folder; by default under results/clone.")] = None,
) -> None:
    """Clone a driver, or go on with a cloning that was stopped; the policy is kept as best.npz."""
    console = Console()
    folder = out or Path("results/clone") / f"{data.replace('/', '-')}-{seed}"
    try:
        dataset = samples_of(data)
        parts = split(dataset.episodes)
        parameters, used = hyperparameters("clone", []), versions_with(("torch", "minari"))
        settings = {dataset.id: dataset.config}
        card = new_card("behaviour cloning", "driver", seed, parameters, settings, 0.0, used)
        card["dataset"] = dataset.about
        with resumable(folder), progress_bar(console) as bar:
            cloning = Cloning(folder, parts, card)
            running = bar.add_task("epochs", total=cloning.epochs, completed=cloning.done)
            while cloning.done < cloning.epochs:
                cloning.run_epoch()
                bar.advance(running)
            policy = Policy.load(folder / POLICY)
            test, train = parts.test.wanted, parts.training.wanted
            plain = log_likelihood(test - train.mean(axis=0), train.std(axis=0))
            console.print(
                f"Log-likelihood of {len(test):,} held-out steps: {likelihood_of(policy, parts.test):.2f} nat a step "
                f"(a constant Gaussian: {plain:.2f}). The policy is {folder / POLICY}."
            )
            driver = dataset.about.get("driver")
            if driver in DRIVERS:
                running = bar.add_task("comparison", total=None)
                show = lambda done, total: bar.update(running, completed=done, total=total)
                means = compare(folder / POLICY, dataset.id, driver, episodes, show)
                console.print(
                    f"Lateral RMS in {episodes:,} held-out episodes: {means['clone']:.4f} m, {driver} "
                    f"{means[driver]:.4f} m (ratio {means['clone'] / means[driver]:.2f})."
                )
    except (ImportError, ValueError) as error:
        raise typer.BadParameter(str(error)) from None


if __name__ == "__main__":
    typer.run(main)
