"""The episodes of many environments: their generators, and what was drawn, in compiled code where that is possible."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding

from shared_control_env.core.batch import Batch, Sizes
from shared_control_env.core.drawing import Drawing, Persons, draw_starts
from shared_control_env.core.stream import WORDS, set_state, state_of
from shared_control_env.envs.drawing import drawing_of
from shared_control_env.envs.episode import DriverDraws, draw_episode, driver_generator, is_random
from shared_control_env.envs.settings import Settings
from shared_control_env.envs.starts import start_of, write_start
from shared_control_env.vector.threads import Threads

FEWEST_FOR_THREADS = 256
"""Smallest number of starts that several threads draw; waking a thread costs as much as drawing so many."""

NOBODY = Persons(np.zeros(0, np.int64), np.zeros((0, 0)), np.zeros(0, np.int64))
"""Persons where nobody is at the wheel."""


class Episodes(Sequence[Settings]):
    """Settings of the present episode of each environment, with all random values drawn.

    In compiled code only the start is drawn. The settings are drawn again when they are asked for, from the state that
    the generator had before.

    Args:
        n: number of environments N.

    Attributes:
        templates: settings of each environment, from which its episodes are drawn.
        random: whether anything is drawn.
        seeds: seed of each environment; None before the first use of its generator.
    """

    def __init__(self, n: int) -> None:
        self.templates: list[Settings] = []
        self.random = False
        self.seeds: list[int | None] = [None] * n
        self._generators: list[np.random.Generator | None] = [None] * n
        self._streams, self._before = (np.zeros((n, WORDS), dtype=np.uint64) for _ in range(2))
        self._in_stream = np.zeros(n, dtype=bool)  # whether the row of the streams is newer than the generator
        self._given = np.zeros(n, dtype=bool)  # whether the generator is in a user's hands too
        self._drawn = np.zeros(n, dtype=object)  # settings; None where they are to be drawn again
        self._source = np.zeros(n, dtype=object)  # settings that these are drawn from
        self._roots = np.zeros(n, dtype=object)  # seed sequence that a person's generator came from, and its count
        self._drawing: Drawing | None = None
        self._driver: DriverDraws | None = None
        self._persons = NOBODY

    def __len__(self) -> int:
        """Number of environments."""
        return len(self.seeds)

    def __getitem__(self, i: Any) -> Any:
        """Settings of an episode, or of several."""
        if isinstance(i, slice):
            return [self[j] for j in range(*i.indices(len(self)))]
        if self._drawn[i] is None:
            generator = np.random.default_rng(self._roots[i] or None)
            set_state(generator, self._before[i])
            self._drawn[i] = draw_episode(self._source[i], generator)
        return self._drawn[i]

    def __iter__(self) -> Iterator[Settings]:
        """Settings of all episodes."""
        return (self[i] for i in range(len(self)))

    def adopt(self, templates: list[Settings], random: bool, sizes: Sizes, present: Settings | None) -> None:
        """Draw later episodes from other settings.

        Args:
            templates: settings of each environment.
            random: whether they differ, or anything is drawn.
            sizes: capacity of the arrays for a start.
            present: settings to show until the next draw; None to keep the present episodes.
        """
        self.templates, self.random = templates, random
        if present is not None:
            self._drawn[:] = present
        self.tabulate(sizes)

    def tabulate(self, sizes: Sizes) -> None:
        """Make the tables for drawing in compiled code, where all environments share their settings.

        Args:
            sizes: capacity of the arrays for a start.
        """
        first = self.templates[0]
        shared = is_random(first) and all(template is first for template in self.templates)
        self._drawing = drawing_of(first, sizes) if shared else None
        self._driver = DriverDraws.of(first) if self._drawing is not None and first.has_person else None
        if self._driver is not None:
            n, entries = len(self), len(self._driver.entries)
            self._persons = Persons(np.zeros(n, np.int64), np.zeros((n, entries)), np.zeros(n, np.int64))
        else:
            self._persons = NOBODY

    def __getstate__(self) -> dict[str, Any]:
        """State for pickling, without the tables, which hold addresses of this process."""
        return {**self.__dict__, "_drawing": None}

    def seed(self, i: int, generator: np.random.Generator, seed: int) -> None:
        """Give an environment another generator.

        Args:
            i: index of the environment.
            generator: its generator.
            seed: seed of the generator.
        """
        self._generators[i], self.seeds[i] = generator, seed
        self._in_stream[i] = self._given[i] = False

    def generator(self, i: int) -> np.random.Generator:
        """Generator of an environment for the user, seeded at random if no seed was given.

        Args:
            i: index of the environment.
        """
        self._given[i] = True
        return self._generator(i)

    def known_seeds(self) -> tuple[int, ...]:
        """Seed of each environment; an environment without one gets a random seed."""
        for i in range(len(self)):
            self._generator(i)
        return tuple(seed for seed in self.seeds if seed is not None)

    def _generator(self, i: int) -> np.random.Generator:
        generator = self._generators[i]
        if generator is None:
            generator, seed = seeding.np_random(None)
            self.seed(i, generator, seed)
        elif self._in_stream[i]:
            set_state(generator, self._streams[i])
            self._in_stream[i] = False
        return generator

    def draw(self, mask: np.ndarray, batch: Batch, threads: Threads) -> None:
        """Draw an episode for each environment of a mask, and write its start. A failed draw changes no episode.

        Args:
            mask: the environments, shape (N,).
            batch: state of all environments; ``ended`` is set, so that the kernel begins these episodes even after an
                interrupt.
            threads: threads that share the work.

        Raises:
            ValueError: if a drawn value is refused.
        """
        chosen = np.flatnonzero(mask)
        if not len(chosen):
            return
        if self._drawing is None:
            drawn = {i: draw_episode(self.templates[i], self._generator(i)) for i in chosen.tolist()}
            batch.ended[mask] = True
            for i, episode in drawn.items():
                self._drawn[i] = episode
                write_start(start_of(episode), batch, i)
            return
        for i in chosen[~self._in_stream[chosen]].tolist():
            state_of(self._generator(i), self._streams[i])
        self._before[chosen] = self._streams[chosen]
        self._in_stream[chosen] = True
        self._drawn[chosen], self._source[chosen] = None, self.templates[0]
        if self._driver is not None:
            self._draw_persons(self._driver, chosen.tolist())
        batch.ended[mask] = True
        self._draw_compiled(mask, batch, threads, threads.count if len(chosen) >= FEWEST_FOR_THREADS else 1)
        for i in chosen[self._given[chosen]].tolist():
            self._generator(i)

    def _draw_persons(self, driver: DriverDraws, chosen: list[int]) -> None:
        """Draw the persons of environments; a copy of the seed sequence as it is now draws them again when asked."""
        persons = self._persons
        for i in chosen:
            generator = self._generators[i]
            assert generator is not None
            root: Any = generator.bit_generator.seed_seq
            self._roots[i] = np.random.SeedSequence(
                root.entropy, spawn_key=root.spawn_key, n_children_spawned=root.n_children_spawned
            )
            drawn = driver.draw(driver_generator(generator))
            persons.which[i], persons.values[i], persons.seeds[i] = drawn.which, drawn.values, drawn.seed

    def _draw_compiled(self, mask: np.ndarray, batch: Batch, threads: Threads, count: int) -> None:
        drawing = self._drawing
        assert drawing is not None
        parameters, plans = (
            records.view(np.float64).reshape(len(self), -1) for records in (batch.parameters, batch.plans)
        )
        numbers = np.empty((count, len(drawing.numbers)))

        def work(thread: int) -> None:
            draw_starts(mask, self._streams, batch, parameters, plans, drawing, self._persons, numbers, thread, count)

        if count > 1:
            threads.run(work)
        else:
            work(0)
