"""The vectorised environment: many environments stepped by one compiled kernel."""

from shared_control_env.vector.environment import Rollout, SharedControlVectorEnv

__all__ = ["Rollout", "SharedControlVectorEnv"]
