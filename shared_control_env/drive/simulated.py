"""Simulated people at the wheel: a driver of the catalogue with an arm of its own, who takes part like anyone else."""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import exp
from typing import Any, NamedTuple

import numpy as np
from websockets.asyncio.client import ClientConnection, connect

from shared_control_env.controllers.driver import Driver, PersonDriver, checked_command, driver_of
from shared_control_env.core.entries import advance_arm
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import SCENE, pack
from shared_control_env.drive.devices import SIMULATED
from shared_control_env.drive.session import Choice
from shared_control_env.envs.settings import parameters_of
from shared_control_env.evaluation.catalogue import DRIVERS, DriverEntry
from shared_control_env.evaluation.episodes import RunningBatch


class Remnant(NamedTuple):
    """What a person does beside the model: coloured noise of the arm.

    Attributes:
        steering: standard deviation of the steering [rad].
        acceleration: standard deviation of the acceleration [m/s^2].
        time: correlation time [s].
    """

    steering: float = 0.0
    acceleration: float = 0.0
    time: float = 0.3


NO_REMNANT = Remnant()
"""The model alone."""


class SimulatedPerson:
    """A driver of the catalogue with the arm of Eq. 16 and a remnant, the same person in every drive.

    What the catalogue draws for a driver, such as the arm and the response of the ``population``, is drawn once.

    Args:
        name: key of :data:`evaluation.catalogue.DRIVERS`.
        number: number of the person, which is the seed of all that is drawn for it.
        remnant: the remnant.
    """

    def __init__(self, name: str, number: int, remnant: Remnant = NO_REMNANT) -> None:
        self.name, self.number, self.remnant = name, number, remnant
        self._entry: DriverEntry = DRIVERS[name]
        self._person = self._parameters(Choice("lane_keeping", "none", "proportional", "", number))
        self._arm, self._noise, self._wanted = np.zeros(2), np.zeros(2), np.zeros(2)
        self._driver: Driver | None = None

    @property
    def lag(self) -> tuple[float, float]:
        """The true gain K_h [-] and time constant T_h [s] of the arm."""
        return self._person.lag.K_h, self._person.lag.T_h

    def _parameters(self, choice: Choice) -> Parameters:
        running = RunningBatch(choice.batch((self.name, self._entry)), single=True)
        running.env.close()
        return parameters_of(running.drawn[0])

    def begin(self, choice: Choice) -> None:
        """Begin a drive.

        Args:
            choice: what is driven.
        """
        own, there = self._person, self._parameters(choice)
        person = own.person._replace(seed=there.person.seed)
        self._p = there._replace(lag=own.lag, internal_model=own.internal_model, person=person)
        self._packed = pack(self._p)
        self._driver = driver_of(self._p) if self._entry.make is None else self._entry.make()
        self._driver.reset(seed=choice.seed)
        self._arm[:] = self._noise[:] = self._wanted[:] = 0.0
        self._rng = np.random.default_rng([self.number, choice.seed % 2**32])
        self._sizes = np.array([self.remnant.acceleration, self.remnant.steering])

    def shares(self, observation: np.ndarray, scene: np.ndarray) -> list[float]:
        """What the arm does at a scene, as shares of the limits [-].

        Args:
            observation: the environment's observation.
            scene: record of :data:`core.records.SCENE`.
        """
        assert self._driver is not None
        if scene["k"] > 0:
            wanted = scene["felt"] if self._resting() else self._wanted
            advance_arm(self._arm, wanted, scene["felt"], self._packed)
            fade = exp(-self._p.task.dt / self.remnant.time)
            self._noise = fade * self._noise + np.sqrt(1.0 - fade**2) * self._rng.normal(size=2)
        else:
            self._noise = self._rng.normal(size=2)
        self._wanted = checked_command(self._driver.act(observation, scene)).copy()
        limits = np.array([self._p.limits.a_max, self._p.limits.delta_max])
        bounded = np.clip(self._wanted, -limits, limits)
        self._wanted = bounded
        return np.clip((self._arm + self._sizes * self._noise) / limits, -1.0, 1.0).tolist()

    def _resting(self) -> bool:
        return isinstance(self._driver, PersonDriver) and self._driver.resting


async def take_part(url: str, origin: str, person: SimulatedPerson) -> None:
    """Take part in a study through its page's connection, until the end.

    Args:
        url: address of the connection, with its token.
        origin: the page's origin.
        person: the person.

    Raises:
        RuntimeError: if the server refuses something.
    """
    async with connect(url, origin=origin, max_size=2**22) as connection:  # type: ignore[arg-type]
        seq = 0
        async for text in connection:
            message = json.loads(text)
            if message["type"] == "refused":
                raise RuntimeError(f"the study refused a simulated person: {message['message']}")
            if message["type"] == "step":
                if message["step"] == "end":
                    return
                await _answer(connection, message)
            elif message["type"] == "road" and "choice" in message:
                person.begin(Choice(**message["choice"]))
            elif message["type"] == "state" and message["state"] == "ready":
                await _say(connection, type="begin")
            elif message["type"] == "frame" and message.get("driving"):
                scene = np.frombuffer(bytes.fromhex(message["scene"]), SCENE).reshape(())
                observation = np.frombuffer(bytes.fromhex(message["observation"]), np.float32)
                readings = person.shares(observation, scene)
                about = {"seq": seq, "stamp": message["t"], "echo": message["n"], "device": SIMULATED}
                await _say(connection, type="input", **about, readings=readings)
                seq += 1


async def _answer(connection: ClientConnection, step: Mapping[str, Any]) -> None:
    """Answer a step beside the drives. The middle of every scale is ticked: a simulated person has no opinion."""
    if step["step"] == "consent":
        await _say(connection, type="consent", agreed=True)
    elif step["step"] == "device":
        await _say(connection, type="device", device="simulated")
    elif step["step"] == "questionnaire":
        values = {item["name"]: item["least"] + item["step"] * (item["steps"] // 2) for item in step["items"]}
        await _say(connection, type="answers", values=values)
    else:
        await _say(connection, type="begin")


async def _say(connection: ClientConnection, **message: Any) -> None:
    await connection.send(json.dumps(message))
