"""Drivers: the common interface, and the predictive driver of the paper."""

from __future__ import annotations

import inspect
from math import isfinite
from time import perf_counter
from typing import Any, Protocol, runtime_checkable

import numpy as np
import osqp
from scipy import sparse

from shared_control_env.controllers.arrays import as_numbers
from shared_control_env.controllers.solution import Solution
from shared_control_env.core import entries
from shared_control_env.core.control.driver import DRIVERS, count_rows, count_variables
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import PERSON_MEMORY, SCENE, pack

KEPT = 1000
"""Number of programs, 2 kB each, that a predictive driver stores; then its solver is set up again.

A copy of the driver solves the stored programs again, because OSQP's workspace cannot be copied.
"""


@runtime_checkable
class Driver(Protocol):
    """Anything that drives: a scripted, learned or predictive driver, or a person at the controls.

    A driver that solves a problem may also have an attribute ``solution``, the last
    :class:`~shared_control_env.controllers.solution.Solution`. The environment then reports it in ``info``.
    """

    def reset(self, seed: int | None = None) -> None:
        """Begin an episode.

        Args:
            seed: seed for drivers that draw random numbers.
        """
        ...

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Decide on the desired command of one step.

        Args:
            observation: the environment's observation, shape (n,); by default
                :data:`core.feedback.observation.DRIVER_V0`.
            scene: the same step in SI units, a record of :data:`core.records.SCENE`; ``scene["z"]``, for example.

        Returns:
            ``u_h,des = [a, delta]`` [m/s^2, rad], shape (2,); the caller clips it to the limits.
        """
        ...


def check_reset(player: Any, label: str) -> None:
    """Check that the ``reset`` of a driver or an allocator takes a seed.

    Args:
        player: the driver or allocator.
        label: name of the object for the error message.

    Raises:
        ValueError: if ``reset`` does not take a seed.
    """
    try:
        inspect.signature(player.reset).bind(seed=0)
    except TypeError:
        raise ValueError(f"{label}: its reset must take a seed, as in reset(self, seed=None)") from None


def checked_command(command: Any, who: str = "driver") -> np.ndarray:
    """Check the value that a driver's ``act`` returned, and convert it to an array.

    Args:
        command: anything with two numbers, ``[a, delta]`` [m/s^2, rad].
        who: source of the command, for the error message.

    Returns:
        Array of shape (2,).

    Raises:
        ValueError: if the value is not two finite numbers.
    """
    array = as_numbers(command)
    if array.shape != (2,) or not all(map(isfinite, array.tolist())):
        raise ValueError(f"{who}: act() gave {command!r}; it must return finite [a, delta] [m/s^2, rad], shape (2,)")
    return array


class PredictiveDriver:
    """The driver of Eq. 14-15: the automation's costs without the potential field, linearised, solved by OSQP.

    With ``parameters.internal_model.active`` the driver knows its own response and feels the automation's command
    (:mod:`core.control.driver`). The paper's driver does neither.

    The OSQP workspace is set up at every reset, so that episodes do not depend on earlier ones. At every step it is
    updated in place. After :data:`KEPT` steps it is set up again. If OSQP does not solve to tolerance, the last
    feasible command is held.

    Args:
        parameters: the environment's parameters; by default those of the paper.
        eps: OSQP's absolute and relative tolerance [-].

    Attributes:
        solution: the last solution; ``status`` is OSQP's code, 1 for solved.
        failures: number of steps since the reset at which the last command was held.
        P, q, A, low, high: matrices and bounds of the last quadratic program.
    """

    def __init__(self, parameters: Parameters | None = None, eps: float = 1e-5) -> None:
        self._eps = eps
        p = Parameters() if parameters is None else parameters
        self._parameters = pack(p)
        n, rows = count_variables(p), count_rows(p)
        self.P, self.q, self.A = np.zeros((n, n)), np.zeros(n), np.zeros((rows, n))
        self.low, self.high = np.zeros(rows), np.zeros(rows)
        self._work = np.zeros((), DRIVERS)
        limits = self._parameters["limits"]
        self._bounds = np.array([limits["a_max"], limits["delta_max"]])
        # Entries that may differ from zero, in the order of compressed columns.
        self._P_columns, self._P_rows = np.nonzero(np.tri(n))
        pattern = np.vstack([np.ones((rows - n, n)), np.eye(n)])
        self._A_columns, self._A_rows = np.nonzero(pattern.T)
        self._P_pattern, self._A_pattern = sparse.csc_matrix(np.tri(n).T), sparse.csc_matrix(pattern)
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Begin an episode.

        Args:
            seed: not used, since the predictive driver draws no random numbers.
        """
        self.failures = 0
        self.solution: Solution | None = None
        self._last, self._arm = np.zeros(2), np.zeros(2)
        self._solver: osqp.OSQP | None = None
        self._problems: list[tuple[np.ndarray, ...]] = []

    def __getstate__(self) -> dict[str, Any]:
        """State for copies. OSQP's workspace cannot be copied; a copy first solves the same programs again."""
        return {**self.__dict__, "_solver": None}

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Desired command u_h,des of one step; see :class:`Driver`.

        Args:
            observation: the environment's observation; not used.
            scene: record of :data:`records.SCENE`, with its safe area already found.
        """
        if scene["k"] > 0:  # state of the arm after a step under its last command
            entries.advance_arm(self._arm, self._last, scene["felt"], self._parameters)
        self.solution = self.solve(scene)
        return self.solution.command

    def solve(self, scene: np.ndarray) -> Solution:
        """Condense and solve the quadratic program of one scene.

        Args:
            scene: record of :data:`records.SCENE`, with its safe area already found.

        Returns:
            The solution.
        """
        begin = perf_counter()
        entries.build_program(
            scene.reshape(1),
            self._last,
            self._arm,
            self._parameters,
            self._work,
            self.P,
            self.q,
            self.A,
            self.low,
            self.high,
        )
        result = self._solved()
        info = result.info
        found = info.status_val == osqp.SolverStatus.OSQP_SOLVED and all(map(isfinite, result.x[:2].tolist()))
        if found:
            self._last = np.clip(result.x[:2], -1.0, 1.0) * self._bounds
        else:
            self.failures += 1
        return Solution(
            command=self._last.copy(),
            found=found,
            status=int(info.status_val),
            iterations=int(info.iter),
            primal_residual=float(info.prim_res),
            dual_residual=float(info.dual_res),
            time=perf_counter() - begin,
        )

    def _solved(self) -> Any:
        """OSQP's result for the current program, warm-started from the previous programs."""
        if len(self._problems) == KEPT:
            self._solver = None
            self._problems.clear()
        P, A = self.P[self._P_rows, self._P_columns], self.A[self._A_rows, self._A_columns]
        self._problems.append((P, A, self.q.copy(), self.low.copy(), self.high.copy()))
        if self._solver is not None:
            return self._advance(*self._problems[-1])
        self._solver = self._set_up(*self._problems[0])
        result = self._solver.solve(raise_error=False)
        for problem in self._problems[1:]:  # only a copy has more than one here
            result = self._advance(*problem)
        return result

    def _advance(self, P: np.ndarray, A: np.ndarray, q: np.ndarray, low: np.ndarray, high: np.ndarray) -> Any:
        assert self._solver is not None
        self._solver.update(q=q, l=low, u=high, Px=P, Ax=A)
        return self._solver.solve(raise_error=False)

    def _set_up(self, P: np.ndarray, A: np.ndarray, q: np.ndarray, low: np.ndarray, high: np.ndarray) -> osqp.OSQP:
        """OSQP workspace with the full pattern; rho adapts by iterations, not by time, so that runs can be repeated."""
        self._P_pattern.data, self._A_pattern.data = P, A
        solver = osqp.OSQP()
        solver.setup(
            P=self._P_pattern,
            q=q,
            A=self._A_pattern,
            l=low,
            u=high,
            eps_abs=self._eps,
            eps_rel=self._eps,
            max_iter=4000,
            adaptive_rho_interval=50,
            check_termination=10,
            verbose=False,
        )
        return solver


class PersonDriver(PredictiveDriver):
    """The predictive driver with a person's perception, attention and arm, as in the kernel.

    See :mod:`core.control.person`.

    Args:
        parameters: the environment's parameters; ``parameters.person.active`` must be True.
        eps: OSQP's absolute and relative tolerance [-].

    Attributes:
        person: record of :data:`records.PERSON_MEMORY`: whether the person drives, and what was noticed and when.

    Raises:
        ValueError: if ``parameters.person.active`` is False.
    """

    def __init__(self, parameters: Parameters, eps: float = 1e-5) -> None:
        if not parameters.person.active:
            raise ValueError("parameters.person.active = False; it must be True for a person to drive")
        self.person = np.zeros((), PERSON_MEMORY)
        self._seen = np.zeros((), SCENE)
        super().__init__(parameters, eps)

    @property
    def resting(self) -> bool:
        """Whether the hands rest; the environment then takes u_a,act for u_h,des."""
        return not self.person["engaged"]

    def reset(self, seed: int | None = None) -> None:
        """Begin an episode.

        Args:
            seed: not used; the person's random numbers come from ``parameters.person.seed``.
        """
        super().reset(seed)
        self._total = np.zeros(2)
        entries.clear_person(self.person, self._parameters)

    def act(self, observation: np.ndarray, scene: np.ndarray) -> np.ndarray:
        """Desired command u_h,des of the person; see :class:`Driver`.

        Args:
            observation: the environment's observation; not used.
            scene: record of :data:`records.SCENE`, with its safe area already found.
        """
        if scene["k"] > 0:
            if self.resting:
                self._last = scene["felt"].copy()  # u_h,des was u_a,act
            self._total = np.clip(scene["felt"] + self._arm, -self._bounds, self._bounds)  # command of the last step
            entries.advance_arm(self._arm, self._last, scene["felt"], self._parameters)
        self._seen[()] = scene
        if entries.perceive_and_attend(scene, self._total, self.person, self._parameters, self._seen):
            self.solution = self.solve(self._seen)
            self._last = self.solution.command.copy()
            entries.add_arm_noise(self._last, self.person, self._parameters)
        else:
            self.solution = Solution(self._last, True, int(osqp.SolverStatus.OSQP_SOLVED), 0, 0.0, 0.0, 0.0)
        return self._last.copy()


def driver_of(parameters: Parameters) -> PredictiveDriver:
    """The driver that an environment's parameters describe: a person, or the plain predictive driver.

    Args:
        parameters: the environment's parameters.
    """
    return PersonDriver(parameters) if parameters.person.active else PredictiveDriver(parameters)
