"""Many environments in one kernel."""

from shared_control_env.vector.environment import Rollout, SharedControlVectorEnv

__all__ = ["Rollout", "SharedControlVectorEnv"]
