"""The benchmark: runs drivers and authorities on suites of degraded automation, and reports the metrics."""

from shared_control_env.evaluation.catalogue import (
    AUTHORITIES,
    DRIVERS,
    SUITES,
    AuthorityEntry,
    DriverEntry,
    Suite,
)
from shared_control_env.evaluation.controllability import controllability
from shared_control_env.evaluation.metrics import METRICS, Metric, Trajectory, metric
from shared_control_env.evaluation.replay import replay_episode
from shared_control_env.evaluation.runner import evaluate
from shared_control_env.evaluation.statistics import summarise

__all__ = [
    "AUTHORITIES",
    "DRIVERS",
    "METRICS",
    "SUITES",
    "AuthorityEntry",
    "DriverEntry",
    "Metric",
    "Suite",
    "Trajectory",
    "controllability",
    "evaluate",
    "metric",
    "replay_episode",
    "summarise",
]
