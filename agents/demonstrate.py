"""Make a Minari dataset of a driver of the catalogue: ``python -m agents.demonstrate``; needs the extra ``minari``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import typer
from rich.console import Console

from agents.tasks import HELD_OUT_SEED
from shared_control_env.evaluation.catalogue import ARMS, AUTHORITIES, DRIVERS, DriverEntry, choose, choose_one
from shared_control_env.evaluation.episodes import EpisodeBatch, settings_of, versions
from shared_control_env.evaluation.progress import progress_bar
from shared_control_env.recordings.dataset import Demonstration, check_new, write_dataset
from shared_control_env.registration import ENVIRONMENTS
from shared_control_env.wrappers import DriverModel

AUTHORITY = "proportional"
"""Authority of the catalogue beside which the drivers are recorded."""


class Recorder(gym.Wrapper):
    """Adds noise to the driver's command, and keeps what a dataset needs.

    A clone that has seen only the driver's own episodes does not know the way back once it has strayed. Noise on the
    executed command takes the recorded car there; the dataset holds the command that the driver wanted (M. Laskey et
    al., "DART: Noise injection for robust imitation learning", CoRL 2017).

    Args:
        env: an environment whose only open slot is the driver's.
        noise: standard deviation of the noise, as a share of the limits [-].

    Attributes:
        demonstration: the episode so far.
    """

    demonstration: Demonstration

    def __init__(self, env: gym.Env, noise: float) -> None:
        super().__init__(env)
        self._noise = noise

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; the noise is drawn from the environment's random generator.

        Args:
            seed: seed of the episode.
            options: options of Gymnasium's ``reset``.
        """
        observation, info = self.env.reset(seed=seed, options=options)
        (self._rng,) = self.unwrapped.np_random.spawn(1)
        self.demonstration = Demonstration(seed, observation)
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step with the disturbed command.

        Args:
            action: the driver's command divided by its limits, shape (2,).
        """
        disturbed = np.clip(action + self._noise * self._rng.standard_normal(2), -1.0, 1.0).astype(np.float32)
        result = self.env.step(disturbed)
        self.demonstration.add(action, disturbed, result)
        return result


def with_arm(entry: DriverEntry) -> DriverEntry:
    """A driver whose arm is drawn around the five that the paper identified, unless the entry has an arm of its own.

    Args:
        entry: entry of the catalogue.
    """
    return entry if entry.draws or "driver_lag" in entry.config else entry._replace(draws=ARMS)


def recorded_env(id: str, driver: str, entry: DriverEntry) -> gym.Env:
    """The environment in which a driver is recorded, with the scenario's own faults.

    Args:
        id: id of a registered environment.
        driver: name of the driver.
        entry: entry of the driver.
    """
    batch = EpisodeBatch(ENVIRONMENTS[id], (driver, entry), (AUTHORITY, AUTHORITIES[AUTHORITY]), (), {})
    return gym.make(id, config=settings_of(batch, None))


def demonstrations(env: gym.Env, entry: DriverEntry, noise: float, seeds: Iterable[int]) -> Iterator[Demonstration]:
    """Drive one episode for each seed.

    Args:
        env: the environment, whose driver slot is open.
        entry: entry of the driver.
        noise: as in :class:`Recorder`.
        seeds: the seeds.

    Returns:
        The episodes, as an iterator.
    """
    recorder = Recorder(env, noise)
    model = DriverModel(recorder, entry.make() if entry.make else None)
    for seed in seeds:
        model.reset(seed=seed)
        going = True
        while going:
            _, _, terminated, truncated, _ = model.step(0)
            going = not (terminated or truncated)
        yield recorder.demonstration


def main(
    dataset: Annotated[str, typer.Option(help="Id of the Minari dataset that is made.")] = (
        "shared-control/internal-model-v0"
    ),
    driver: Annotated[str, typer.Option(help=f"One of: {', '.join(DRIVERS)}.")] = "internal_model",
    env: Annotated[str, typer.Option(help="Id of an environment.")] = "SharedControl/LaneKeeping-v1",
    episodes: Annotated[int, typer.Option(min=2, max=100_000, help="Number of episodes.")] = 1000,
    noise: Annotated[
        float, typer.Option(min=0.0, max=0.5, help="Standard deviation of the noise on the executed command [-].")
    ] = 0.03,
    seed: Annotated[int, typer.Option(min=0, help="Of the first episode; the others follow.")] = 0,
) -> None:
    """Record a driver of the catalogue, whose arm is another in each episode, as a Minari dataset."""
    console = Console()
    try:
        entry = with_arm(choose_one("driver", driver, DRIVERS))
        choose("env", [env], ENVIRONMENTS)
        check_new(dataset)
        if seed + episodes > HELD_OUT_SEED:
            raise ValueError(f"seed = {seed}: the seeds from {HELD_OUT_SEED:,} on are those of comparisons")
        with progress_bar(console) as bar:
            made, found = recorded_env(env, driver, entry), []
            running = bar.add_task("episodes", total=episodes)
            for demonstration in demonstrations(made, entry, noise, range(seed, seed + episodes)):
                found.append(demonstration)
                bar.advance(running)
        about = {"driver": driver, "noise": noise, "versions": versions()}
        write_dataset(dataset, [each.buffer(i) for i, each in enumerate(found)], made, about)
    except (ImportError, ValueError) as error:
        raise typer.BadParameter(str(error)) from None
    steps = sum(map(len, found))
    console.print(
        f"{dataset}: {episodes:,} episodes, {steps:,} steps. To clone: python -m agents.clone --data {dataset}"
    )


if __name__ == "__main__":
    typer.run(main)
