"""The arrays of many environments, and the view of one of them that the loop works on."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from shared_control_env.core.compile.jit import jit_inlined
from shared_control_env.core.control import condensing
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import (
    AutomationMemory,
    Memory,
    PersonMemory,
    Scene,
    Signals,
    Transition,
    Vector2,
    record_dtype,
)
from shared_control_env.core.risk.finding import Finding


class Batch(NamedTuple):
    """State of N environments, one entry each.

    Attributes:
        parameters: records of :class:`core.parameters.Parameters`, (N,).
        scenes: of :data:`records.SCENE`, (N,).
        signals: of :data:`records.SIGNALS`, (N,).
        memories: of :data:`records.MEMORY`, (N,).
        automations: of :data:`records.AUTOMATION_MEMORY`, (N,).
        persons: of :data:`records.PERSON_MEMORY`, (N,); one, which nobody uses, where the kernel has no driver.
        transitions: of :data:`records.TRANSITION`, (N,).
        states: ego ``[x, y, psi, v_x, v_y, r]``, (N, 6).
        lines: reference lines of the roads, (N, n, 6).
        faults: records of :class:`core.parameters.DegradationParameters`, (N, m).
        fault_memories: of :data:`records.FAULT_MEMORY`, (N, m).
        traffic: other vehicles, (N, M, 8).
        plans: what they are going to do, records of :class:`core.parameters.TrafficParameters`, (N, M).
        ended: whether the episode has ended and awaits its reset, (N,).
    """

    parameters: np.ndarray
    scenes: np.ndarray
    signals: np.ndarray
    memories: np.ndarray
    automations: np.ndarray
    persons: np.ndarray
    transitions: np.ndarray
    states: np.ndarray
    lines: np.ndarray
    faults: np.ndarray
    fault_memories: np.ndarray
    traffic: np.ndarray
    plans: np.ndarray
    ended: np.ndarray


class Environment(NamedTuple):
    """One environment of a batch.

    Attributes:
        p: parameters.
        scene: what is perceived at the present time step.
        signals: of that step.
        memory: what the loop carries from step to step.
        automation: what the automation carries.
        person: what a person at the wheel carries.
        transition: what the last step led from and to.
        state: ego ``[x, y, psi, v_x, v_y, r]``, (6,).
        line: reference line of the road, (n, 6).
        faults: records of :class:`core.parameters.DegradationParameters`, (m,).
        fault_memories: records of :data:`records.FAULT_MEMORY`, (m,).
        traffic: other vehicles, (M, 8).
        plans: what they are going to do, records of :class:`core.parameters.TrafficParameters`, (M,).
    """

    p: Parameters
    scene: Scene
    signals: Signals
    memory: Memory
    automation: AutomationMemory
    person: PersonMemory
    transition: Transition
    state: np.ndarray
    line: np.ndarray
    faults: np.ndarray
    fault_memories: np.ndarray
    traffic: np.ndarray
    plans: np.ndarray


@jit_inlined
def environment(i: int, batch: Batch) -> Environment:
    """Environment i of a batch: views, nothing is copied.

    Args:
        i: which.
        batch: of all.
    """
    return Environment(
        batch.parameters[i],
        batch.scenes[i],
        batch.signals[i],
        batch.memories[i],
        batch.automations[i],
        batch.persons[min(i, batch.persons.shape[0] - 1)],
        batch.transitions[i],
        batch.states[i],
        batch.lines[i],
        batch.faults[i],
        batch.fault_memories[i],
        batch.traffic[i],
        batch.plans[i],
    )


class Starts(NamedTuple):
    """What every episode starts from, one entry; none where episodes are drawn, whose starts are in the batch already.

    Attributes:
        parameters, states, lines, faults, traffic, plans: as those of :class:`Batch`.
    """

    parameters: np.ndarray
    states: np.ndarray
    lines: np.ndarray
    faults: np.ndarray
    traffic: np.ndarray
    plans: np.ndarray


class Calls(NamedTuple):
    """Where the compiled functions are that the loop calls by address; 0 for what nobody bound or loaded.

    Attributes:
        automate, triangulate, search, drive, allocate, observe: of the functions of these names.
    """

    automate: int
    triangulate: int
    search: int
    drive: int
    allocate: int
    observe: int


NOT_LOADED = Calls(0, 0, 0, 0, 0, 0)
"""Before the first reset."""


class Setup(NamedTuple):
    """What all environments share.

    Attributes:
        starts: of the episodes.
        steps: length of an episode in decisions.
        frames: simulation steps of one decision.
        dt: of a simulation step [s].
        calls: where the compiled functions are.
        scales: of the observation's features, (n,).
    """

    starts: Starts
    steps: int
    frames: int
    dt: float
    calls: Calls
    scales: np.ndarray


class Outputs(NamedTuple):
    """What a step gives, one entry an environment.

    Attributes:
        observations: (N, n), float32.
        rewards: (N,).
        terminations, truncations: (N,).
        infos: records of :data:`feedback.info.INFO`, (N,).
        drivers: records of :data:`control.predictive_driver.DRIVER_REPORT`, (N,).
    """

    observations: np.ndarray
    rewards: np.ndarray
    terminations: np.ndarray
    truncations: np.ndarray
    infos: np.ndarray
    drivers: np.ndarray


class Work:
    """Scratch of one thread.

    Attributes:
        condensing: of the automation's solver.
        finding: of the safe area.
        automation_view: the scene as the automation takes it to be.
        row: the ego as a row of traffic.
        plant: of the vehicle's step.
        command: the driver's, ``[a, delta]`` [m/s^2, rad].
    """

    condensing: condensing.Workspace
    finding: Finding
    automation_view: Scene
    row: Annotated[np.ndarray, (8,)]
    plant: Annotated[np.ndarray, (2, 6)]
    command: Vector2


WORK = record_dtype(Work)
