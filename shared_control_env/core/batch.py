"""The arrays that hold many environments, and the view of one environment that the loop works on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, NamedTuple

import numpy as np

from shared_control_env.core.compile.jit import jit_inlined
from shared_control_env.core.compile.lanes import WIDTH
from shared_control_env.core.control.automation import Automations
from shared_control_env.core.control.predictive_driver import DRIVER_REPORT
from shared_control_env.core.feedback.info import INFO
from shared_control_env.core.parameters import DegradationParameters, Parameters, TrafficParameters
from shared_control_env.core.records import (
    AUTOMATION_MEMORY,
    FAULT_MEMORY,
    MEMORY,
    PERSON_MEMORY,
    SCENE,
    SIGNALS,
    TRANSITION,
    AutomationMemory,
    Memory,
    Scene,
    Signals,
    Transition,
    Vector2,
    record_dtype,
)
from shared_control_env.core.risk.finding import Finding
from shared_control_env.core.world.motion import Motion
from shared_control_env.core.world.road import COLUMNS


class Batch(NamedTuple):
    """State of N environments, one entry per environment.

    Attributes:
        parameters: records of :class:`core.parameters.Parameters`, shape (N,).
        scenes: records of :data:`records.SCENE`, shape (N,).
        signals: records of :data:`records.SIGNALS`, shape (N,).
        memories: records of :data:`records.MEMORY`, shape (N,).
        automations: records of :data:`records.AUTOMATION_MEMORY`, shape (N,).
        persons: records of :data:`records.PERSON_MEMORY`, shape (N,); a single unused record, shape (1,), where the
            kernel has no driver.
        transitions: records of :data:`records.TRANSITION`, shape (N,).
        states: ego ``[x, y, psi, v_x, v_y, r]`` [m, rad, m/s, rad/s], shape (N, 6).
        lines: reference lines of the roads, see :mod:`core.world.road`, shape (N, n, 12).
        faults: records of :class:`core.parameters.DegradationParameters`, shape (N, m).
        fault_memories: records of :data:`records.FAULT_MEMORY`, shape (N, m).
        traffic: other vehicles, columns as in :mod:`core.records`, shape (N, M, 8).
        plans: plans of the other vehicles, records of :class:`core.parameters.TrafficParameters`, shape (N, M).
        ended: whether the episode has ended and the environment awaits its reset, shape (N,).
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
    """One environment of a batch, as views of its entries.

    Attributes:
        p: parameters.
        scene: the scene perceived at the present time step.
        signals: signals of that time step.
        memory: what the loop carries from step to step.
        automation: what the automation carries from step to step.
        transition: what the reward needs from before and after the last step.
        state: ego ``[x, y, psi, v_x, v_y, r]`` [m, rad, m/s, rad/s], shape (6,).
        line: reference line of the road, shape (n, 12).
        faults: records of :class:`core.parameters.DegradationParameters`, shape (m,).
        fault_memories: records of :data:`records.FAULT_MEMORY`, shape (m,).
        traffic: other vehicles, columns as in :mod:`core.records`, shape (M, 8).
        plans: plans of the other vehicles, records of :class:`core.parameters.TrafficParameters`, shape (M,).
    """

    p: Parameters
    scene: Scene
    signals: Signals
    memory: Memory
    automation: AutomationMemory
    transition: Transition
    state: np.ndarray
    line: np.ndarray
    faults: np.ndarray
    fault_memories: np.ndarray
    traffic: np.ndarray
    plans: np.ndarray


@jit_inlined
def environment(i: int, batch: Batch) -> Environment:
    """Environment i of a batch. Its fields are views; nothing is copied.

    Args:
        i: index of the environment.
        batch: state of all environments.
    """
    return Environment(
        batch.parameters[i],
        batch.scenes[i],
        batch.signals[i],
        batch.memories[i],
        batch.automations[i],
        batch.transitions[i],
        batch.states[i],
        batch.lines[i],
        batch.faults[i],
        batch.fault_memories[i],
        batch.traffic[i],
        batch.plans[i],
    )


class Starts(NamedTuple):
    """The fixed start of every episode.

    The arrays have one entry. They are empty if episodes are drawn at random; the batch then holds each start.

    Attributes:
        parameters, states, lines, faults, traffic, plans: as the fields of :class:`Batch`, with N = 1 or N = 0.
    """

    parameters: np.ndarray
    states: np.ndarray
    lines: np.ndarray
    faults: np.ndarray
    traffic: np.ndarray
    plans: np.ndarray


class Calls(NamedTuple):
    """Addresses of the compiled functions that the loop calls by address; 0 for a function not bound or not loaded.

    Attributes:
        automate: address of the automation's controller, see :data:`control.automation.AUTOMATE`.
        triangulate, search: addresses of the two steps that find the safe area, see :mod:`core.risk.finding`.
        assess: address of the risk assessment, see :data:`risk.assessment.ASSESS`.
        move: address of the vehicles' motion, see :data:`world.motion.MOVE`.
        drive: address of the predictive driver, see :data:`control.predictive_driver.DRIVE`.
        allocate: address of the allocator of authority, see :data:`authority.allocators.ALLOCATE`.
        observe: address of the function that writes the observation, see :data:`feedback.observation.WRITE`.
    """

    automate: int
    triangulate: int
    search: int
    assess: int
    move: int
    drive: int
    allocate: int
    observe: int


NOT_LOADED = Calls(0, 0, 0, 0, 0, 0, 0, 0)
"""The addresses before the first reset."""


class Setup(NamedTuple):
    """What all environments of a batch share.

    Attributes:
        starts: fixed start of the episodes.
        steps: duration of an episode [time steps].
        frames: number of simulation steps per time step.
        dt: duration of a simulation step [s].
        calls: addresses of the compiled functions.
        scales: scales of the observation's features, in the units of the features, shape (n,).
    """

    starts: Starts
    steps: int
    frames: int
    dt: float
    calls: Calls
    scales: np.ndarray


class Outputs(NamedTuple):
    """Outputs of a step, one entry per environment.

    Attributes:
        observations: features divided by their scales [-], float32, shape (N, n).
        rewards: rewards [-], shape (N,).
        terminations, truncations: whether the episode has terminated or was truncated, shape (N,).
        infos: records of :data:`feedback.info.INFO`, shape (N,).
        drivers: records of :data:`control.predictive_driver.DRIVER_REPORT`, shape (N,).
    """

    observations: np.ndarray
    rewards: np.ndarray
    terminations: np.ndarray
    truncations: np.ndarray
    infos: np.ndarray
    drivers: np.ndarray


class Work:
    """Scratch memory of one thread.

    Attributes:
        members: indices of the environments of a block that make this step, see :mod:`core.kernel`.
        driving: indices of those of them that do not begin an episode.
        automations: the automation's problems of the block.
        finding: scratch of the search for the safe area.
        automation_view: the scene as the automation perceives it.
        motion: scratch of the vehicles' motion.
        trial: signals of a command whose risks an allocator asks for.
        command: the driver's desired command ``[a, delta]`` [m/s^2, rad].
    """

    members: Annotated[np.ndarray, (WIDTH,), np.int64]
    driving: Annotated[np.ndarray, (WIDTH,), np.int64]
    automations: Automations
    finding: Finding
    automation_view: Scene
    motion: Motion
    trial: Signals
    command: Vector2


WORK = record_dtype(Work)


class Sizes(NamedTuple):
    """Capacity of the arrays that hold a start.

    Attributes:
        faults: number of degradations.
        rows: number of rows of the reference line.
        vehicles: number of other vehicles.
    """

    faults: int
    rows: int
    vehicles: int


def empty_starts(n: int, sizes: Sizes) -> Starts:
    """Arrays of zeros for n starts.

    Args:
        n: number of starts.
        sizes: capacity for each start.
    """
    return Starts(
        parameters=np.zeros(n, record_dtype(Parameters)),
        states=np.zeros((n, 6)),
        lines=np.zeros((n, sizes.rows, COLUMNS)),
        faults=np.zeros((n, sizes.faults), record_dtype(DegradationParameters)),
        traffic=np.zeros((n, sizes.vehicles, 8)),
        plans=np.zeros((n, sizes.vehicles), record_dtype(TrafficParameters)),
    )


def empty_batch(n: int, sizes: Sizes, driver: bool = False) -> Batch:
    """Arrays of n environments before their first episode.

    Args:
        n: number of environments.
        sizes: capacity of the arrays for the start of each environment.
        driver: whether the kernel runs the predictive driver.
    """
    return Batch(
        **empty_starts(n, sizes)._asdict(),
        scenes=np.zeros(n, SCENE),
        signals=np.zeros(n, SIGNALS),
        memories=np.zeros(n, MEMORY),
        automations=np.zeros(n, AUTOMATION_MEMORY),
        persons=np.zeros(n if driver else 1, PERSON_MEMORY),
        transitions=np.zeros(n, TRANSITION),
        fault_memories=np.zeros((n, sizes.faults), FAULT_MEMORY),
        ended=np.zeros(n, dtype=bool),
    )


def new_outputs(n: int, features: int, allocate: Callable[..., np.ndarray] = np.zeros) -> Outputs:
    """New arrays for one step of n environments.

    Args:
        n: number of environments.
        features: number of features of an observation.
        allocate: ``numpy.zeros``, or ``numpy.empty`` if every environment writes its entries.
    """
    return Outputs(
        observations=allocate((n, features), np.float32),
        rewards=allocate(n),
        terminations=allocate(n, bool),
        truncations=allocate(n, bool),
        infos=allocate(n, INFO),
        drivers=allocate(n, DRIVER_REPORT),
    )
