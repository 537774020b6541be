"""The registered environments: a scenario with the authority limiter applied, unless it is left out.

The limiter is applied here and not in the registration, since Gymnasium's vector entry points allow no
additional wrappers there.
"""

from __future__ import annotations

from typing import Any

from shared_control_env.controllers.allocators import Allocator
from shared_control_env.controllers.automation import Planner
from shared_control_env.envs.environments import environment_class
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.envs.shared_control import SharedControlEnv
from shared_control_env.wrappers.authority_limiter import AuthorityLimiter


class Limited:
    """What ``gym.make`` calls; it reads the rendering modes from ``metadata``.

    Args:
        scenario: class of the bare environment.
    """

    def __init__(self, scenario: type[SharedControlEnv]) -> None:
        self.scenario, self.metadata = scenario, scenario.metadata

    def __call__(
        self,
        config: dict[str, Any] | None = None,
        render_mode: str | None = None,
        limiter: bool | Allocator = True,
        automation: Planner | None = None,
    ) -> AuthorityLimiter | SharedControlEnv:
        """The scenario's environment.

        Args:
            config: changes to its settings.
            render_mode: ``human``, ``rgb_array`` or None.
            limiter: bind alpha_a with the fuzzy inference, as ``gym.make_vec`` does, or with another allocator; False
                leaves both slots of the action open.
            automation: who decides u_a,des in the predictive controller's place.

        Raises:
            ValueError: for wrong settings, or what is no allocator or automation.
        """
        env = self.scenario(config, render_mode=render_mode)
        if automation is not None:
            env.automation = automation
        if isinstance(limiter, bool):
            return AuthorityLimiter(env) if limiter else env
        return AuthorityLimiter(env, limiter)


def __getattr__(name: str) -> Limited:
    """The entry point of a scenario, by its key in :data:`scenarios.SCENARIOS`."""
    if name not in SCENARIOS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return Limited(environment_class(name))
