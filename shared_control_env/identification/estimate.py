"""Estimates of an arm: output error with coloured remnant, and instrumental variables; intervals over whole trials.

The driver is in a closed loop: the remnant moves the car, and with it the driver's own input. An equation error (ARX)
is biased by that as soon as the remnant is not white in its form; an output error with a model of the remnant is not.
"""

from __future__ import annotations

from math import exp, log, nan
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from shared_control_env.identification.data import Drives
from shared_control_env.identification.model import Arm, respond

RESAMPLES = 1000
"""Resamples of the trials for an interval."""

LEVEL = 0.95
"""Level of the intervals."""

LAGS = (0, 1, 2, 4, 7, 11)
"""Lags of the instruments [steps]."""

BOUNDS = {"K_h": (0.0, 10.0), "T_h": (0.005, 3.0), "delay": (0.0, 0.5), "rho": (-0.99, 0.99), "offset": (-10.0, 10.0)}
"""Range in which each parameter is searched [-, s, s, -, rad or m/s^2]."""

_START = {"K_h": 1.0, "T_h": 0.2, "delay": 0.05, "rho": 0.5, "offset": 0.0}


class Value(NamedTuple):
    """A parameter with its interval.

    Attributes:
        value: the estimate.
        low, high: ends of the interval.
    """

    value: float
    low: float
    high: float


class Estimate(NamedTuple):
    """An estimate of an arm.

    Attributes:
        method: name of the method.
        K_h, T_h: gain [-] and time constant [s].
        delay: delay [s]; nan where it is taken to be 0.
        rho: correlation of the remnant from one step to the next [-]; nan where it has no model.
        offset: constant of the output, such as a wheel that does not stand straight [rad or m/s^2]; nan where it is
            not estimated.
        found: whether the method came to a result.
    """

    method: str
    K_h: Value
    T_h: Value
    delay: Value
    rho: Value
    offset: Value
    found: bool

    @property
    def arm(self) -> Arm:
        """The arm of the estimate."""
        return Arm(self.K_h.value, self.T_h.value, 0.0 if np.isnan(self.delay.value) else self.delay.value)

    @property
    def theta(self) -> dict[str, float]:
        """The parameters that :func:`innovations` takes."""
        return {**self.arm._asdict(), "rho": self.rho.value, "offset": self.offset.value}


def box_jenkins(drives: Drives, delay: bool = False, resamples: int = RESAMPLES) -> Estimate:
    """Output error with a remnant that is a first-order process, by least squares of its innovations.

    ::

        y = respond(v) + c + n,   n(k) = rho n(k-1) + e(k)

    The interval comes from resampling whole trials. Each resample takes one Gauss-Newton step from the estimate, which
    is as accurate as the normal approximation of a full search and needs no search (Davidson & MacKinnon, Econometric
    Theory 15, 1999). The ends are those of the studentised bootstrap.

    Args:
        drives: drives of a person.
        delay: whether the delay is estimated too.
        resamples: number of resamples.
    """
    names = ["K_h", "T_h", *(["delay"] if delay else []), "rho", "offset"]
    scale = float(np.std(drives.y[drives.counts])) or 1.0

    def residuals(theta: np.ndarray) -> np.ndarray:
        return (innovations(drives, dict(zip(names, theta, strict=True))) / scale).ravel()

    low, high = np.array([BOUNDS[name] for name in names]).T
    start = np.array([_START[name] for name in names])
    result = least_squares(
        residuals,
        start,
        bounds=(low, high),
        x_scale=[0.3 if name != "offset" else scale for name in names],
        method="trf",
    )
    n = len(drives.names)
    jacobian = result.jac.reshape(n, -1, len(names))
    e = result.fun.reshape(n, -1)
    gradients, squares = np.einsum("ntp,nt->np", jacobian, e), np.einsum("ntp,ntq->npq", jacobian, jacobian)
    intervals = studentised(result.x, gradients, squares, resamples)
    free = [i for i, name in enumerate(names) if name != "delay"]  # a delay of 0 is a result, not a failure
    inside = bool(np.all((result.x > low + 1e-6)[free]) and np.all(result.x < high - 1e-6))
    values = {name: Value(float(x), *ends) for name, x, ends in zip(names, result.x, intervals, strict=True)}
    none = Value(nan, nan, nan)
    return Estimate(
        "output error" + (" with delay" if delay else ""),
        values["K_h"],
        values["T_h"],
        values.get("delay", none),
        values["rho"],
        values["offset"],
        bool(result.success) and inside,
    )


def innovations(drives: Drives, theta: dict[str, Any]) -> np.ndarray:
    """Innovations of the remnant, 0 where a step or the one before it does not count, shape (n, T).

    Args:
        drives: drives of a person.
        theta: K_h, T_h, rho, offset, and delay where it is not 0.
    """
    arm = Arm(theta["K_h"], theta["T_h"], theta.get("delay", 0.0))
    n = drives.y - respond(drives.v, arm, drives.dt) - theta["offset"]
    e = np.zeros_like(n)
    e[:, 1:] = (n[:, 1:] - theta["rho"] * n[:, :-1]) * (drives.counts[:, 1:] & drives.counts[:, :-1])
    return e


def studentised(
    theta: np.ndarray, gradients: np.ndarray, squares: np.ndarray, resamples: int, seed: int = 0
) -> list[tuple[float, float]]:
    """Intervals by the studentised bootstrap over trials, from one Gauss-Newton step a resample.

    Args:
        theta: the estimate, shape (p,).
        gradients: J' e of each trial, shape (n, p).
        squares: J' J of each trial, shape (n, p, p).
        resamples: number of resamples.
        seed: seed of the resamples.

    Returns:
        Ends of the interval of each parameter.
    """
    n = len(gradients)
    rng = np.random.default_rng(seed)
    weights = rng.multinomial(n, np.full(n, 1.0 / n), size=resamples).astype(float)
    centred = gradients - gradients.mean(axis=0)
    inverse = np.linalg.pinv(np.einsum("rn,npq->rpq", weights, squares))
    steps = -np.einsum("rpq,rq->rp", inverse, weights @ centred)
    error = np.sqrt(_variance(np.linalg.pinv(squares.sum(axis=0))[None], np.ones((1, n)), centred))[0]
    # The spread within a resample is around its own step: its trials' gradients move by their J' J.
    moved = centred[None] + np.einsum("npq,rq->rnp", squares, steps)
    errors = np.sqrt(_variance(inverse, weights, moved))
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(errors > 0.0, steps / errors, 0.0)
    tails = np.quantile(t, [0.5 * (1.0 + LEVEL), 0.5 * (1.0 - LEVEL)], axis=0)
    return [(float(x - s * up), float(x - s * down)) for x, s, up, down in zip(theta, error, *tails, strict=True)]


def _variance(inverse: np.ndarray, weights: np.ndarray, gradients: np.ndarray) -> np.ndarray:
    """Variances of the parameters by the spread between trials (sandwich), shape (r, p)."""
    n = gradients.shape[-2]
    each = gradients if gradients.ndim == 3 else gradients[None]
    spread = np.einsum("rn,rnp,rnq->rpq", weights, np.broadcast_to(each, (len(weights), *each.shape[1:])), each)
    both = inverse @ spread @ inverse * n / (n - 1.0)
    return np.maximum(np.einsum("rpp->rp", both), 0.0)


def instrumental(drives: Drives, resamples: int = RESAMPLES) -> Estimate:
    """Two-stage least squares of ``y(k+1) = phi y(k) + b v(k)``; the instruments are what came from outside.

    The injected fault and the target position do not depend on the remnant, so that their past values are instruments.
    This holds for faults that do not depend on the command, such as a bias.

    Args:
        drives: drives of a person.
        resamples: number of resamples.
    """
    moments = [_moments(drives.part(np.array([i]))) for i in range(len(drives.names))]
    zx, zz, zy = (np.array(part) for part in zip(*moments, strict=True))
    none = Value(nan, nan, nan)
    theta = _two_stage(zx.sum(axis=0), zz.sum(axis=0), zy.sum(axis=0))
    arm = _as_arm(theta, drives.dt)
    if arm is None:
        return Estimate("instrumental variables", none, none, none, none, none, False)
    rng, n = np.random.default_rng(0), len(drives.names)
    drawn = []
    for weights in rng.multinomial(n, np.full(n, 1.0 / n), size=resamples):
        parts = (np.tensordot(weights, part, 1) for part in (zx, zz, zy))
        again = _as_arm(_two_stage(*parts), drives.dt)
        drawn.append(again if again is not None else (nan, nan))
    known = np.array(drawn)
    ends = [0.5 * (1.0 - LEVEL), 0.5 * (1.0 + LEVEL)]
    if np.isnan(known).any(axis=1).mean() > 1.0 - LEVEL:
        return Estimate("instrumental variables", none, none, none, none, none, False)
    low, high = np.nanquantile(known, ends, axis=0)
    values = [Value(value, float(a), float(b)) for value, a, b in zip(arm, low, high, strict=True)]
    return Estimate("instrumental variables", values[0], values[1], none, none, none, True)


def _moments(drives: Drives) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Products of instruments, regressors and output over the steps that count."""
    first = max(LAGS)
    counts = (drives.counts[:, 1:] & drives.counts[:, :-1])[:, first:]
    x = np.stack([drives.y[:, first:-1][counts], drives.v[:, first:-1][counts]], axis=1)
    T = drives.y.shape[1]
    past = [drives.outside[:, first - lag : T - 1 - lag] for lag in LAGS]
    z = np.concatenate([part[counts] for part in past], axis=1)
    z = np.column_stack([z - z.mean(axis=0), np.ones(len(z))]) if len(z) else np.zeros((0, 2 * len(LAGS) + 1))
    y = drives.y[:, first + 1 :][counts]
    return z.T @ np.column_stack([x, np.ones(len(x))]), z.T @ z, z.T @ y


def _two_stage(zx: np.ndarray, zz: np.ndarray, zy: np.ndarray) -> np.ndarray:
    projected = zx.T @ np.linalg.pinv(zz)
    return np.linalg.pinv(projected @ zx) @ projected @ zy


def _as_arm(theta: np.ndarray, dt: float) -> tuple[float, float] | None:
    """K_h and T_h of the coefficients phi and b; None if they are those of no stable lag."""
    phi, b = float(theta[0]), float(theta[1])
    if not exp(-dt / BOUNDS["T_h"][0]) < phi < 1.0:
        return None
    return b / (1.0 - phi), -dt / log(phi)
