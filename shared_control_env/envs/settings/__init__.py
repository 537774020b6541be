"""Settings of an environment: their schema, changes to them, their check, and their conversion for the core."""

from shared_control_env.envs.settings.changes import ReadOnly, as_plain, change, difference, merge
from shared_control_env.envs.settings.checks import CUT_OFF, LEAD_IN, assigned, check, combined, defaults
from shared_control_env.envs.settings.schema import OWN_TRAFFIC, RandomSettings, Settings, plain
from shared_control_env.envs.settings.to_core import fault_records, parameters_of, plan_records

__all__ = [
    "CUT_OFF",
    "LEAD_IN",
    "OWN_TRAFFIC",
    "RandomSettings",
    "ReadOnly",
    "Settings",
    "as_plain",
    "assigned",
    "change",
    "check",
    "combined",
    "defaults",
    "difference",
    "fault_records",
    "merge",
    "parameters_of",
    "plain",
    "plan_records",
]
