"""Closed-loop runs of the paper's cases: the list of runs, and their signals as a table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
import pandas as pd

import shared_control_env  # noqa: F401  (registers the environments)
from shared_control_env.core.authority.laws import LAWS
from shared_control_env.wrappers import DriverModel

SEED = 0
"""Seed of every run; it has no effect, since the cases draw no random numbers."""

SCENARIOS = {1: "SharedControl/TwoLane-v1", 2: "SharedControl/Curve-v1"}
PRESETS = ("graded", "paper")

SIGNAL_COLUMNS = {
    "state": ("x", "y_cartesian", "psi_cartesian", "v_x", "v_y", "r"),
    "z": ("s", "y", "psi"),
    "u_a_des": ("a_a_des", "delta_a_des"),
    "u_a_f": ("a_a_f", "delta_a_f"),
    "u_a_act": ("a_a_act", "delta_a_act"),
    "u_h_des": ("a_h_des", "delta_h_des"),
    "u_h_act": ("a_h_act", "delta_h_act"),
    "u": ("a", "delta"),
    "prediction": ("x_pred", "y_pred_cartesian"),
    "prediction_road": ("s_pred", "y_pred"),
}
"""Columns made from the array-valued signals of ``info``."""

SCALAR_COLUMNS = (
    "k",
    "t",
    "y_target",
    "v_target",
    "r_x",
    "r_y",
    "alpha_a",
    "speed",
    "lane_departures",
    "safe_area_outcome",
)


@dataclass(frozen=True)
class Run:
    """One closed-loop run.

    Attributes:
        case: 1 or 2.
        law: authority law.
        preset: preset of the longitudinal risk.
        driver: whether the driver takes part; if not, the degraded automation drives alone.
    """

    case: int
    law: str
    preset: str
    driver: bool = True

    @property
    def name(self) -> str:
        """Name for files and tables."""
        who = self.law if self.driver else "automation_alone"
        return f"case{self.case}-{who}-{self.preset}"

    @property
    def config(self) -> dict[str, Any]:
        """Settings that differ from the case's own settings."""
        config: dict[str, Any] = {
            "authority": {"law": self.law},
            "longitudinal_risk": {"preset": self.preset},
        }
        if not self.driver:
            config["driver_lag"] = {"K_h": 0.0}
        return config


def all_runs() -> list[Run]:
    """Both cases under all laws and both presets, and the degraded automation alone."""
    runs = [Run(case, law, preset) for case in SCENARIOS for law in LAWS for preset in PRESETS]
    return runs + [Run(case, "none", preset, driver=False) for case in SCENARIOS for preset in PRESETS]


def make(run: Run, render_mode: str | None = None, **config: Any) -> gym.Env:
    """The paper's closed loop of a run, with the limiter and the predictive driver bound.

    Args:
        run: the run.
        render_mode: ``human``, ``rgb_array`` or None.
        config: further settings.
    """
    env = gym.make(SCENARIOS[run.case], config={**run.config, **config}, render_mode=render_mode)
    return DriverModel(env)


def simulate(run: Run, **config: Any) -> pd.DataFrame:
    """Simulate one run.

    Args:
        run: the run.
        config: further settings.

    Returns:
        One row per time step: the signals of ``info``, the gap to the preceding vehicle, the reward, and whether the
        episode terminated.
    """
    env = make(run, **config)
    env.reset(seed=SEED)
    rows = []
    done = False
    while not done:
        gap = _gap(env)
        _, reward, terminated, truncated, info = env.step(0)
        done = terminated or truncated
        rows.append({**_row(info), "gap": gap, "reward": reward, "terminated": terminated})
    env.close()
    return pd.DataFrame(rows)


def _row(info: dict[str, Any]) -> dict[str, Any]:
    row = {name: info[name] for name in SCALAR_COLUMNS}
    for signal, columns in SIGNAL_COLUMNS.items():
        row.update(zip(columns, info[signal], strict=False))
    row["fault_a"], row["fault_delta"] = info["fault"]
    row["fault_active"] = info["fault_active"]
    row["automation_failures"] = info["automation"]["failures"]
    row["driver_failures"] = info["driver"]["failures"]
    for side in ("lower", "upper"):
        row[f"safe_area_{side}"] = info[f"safe_area_{side}"].ravel()
    return row


def _gap(env: gym.Env) -> float:
    """Distance between the centres of the ego and the preceding vehicle along the road [m]; NaN without one."""
    scene = env.unwrapped.scene  # type: ignore[attr-defined]
    present, s_preceding = scene["neighbours"][2, :2]
    return float(s_preceding - scene["z"][0]) if present else np.nan
