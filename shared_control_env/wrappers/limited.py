"""The registered environments: a scenario, by default with the authority limiter applied.

The limiter is applied here and not in the registration, since Gymnasium's vector entry points do not accept
additional wrappers there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from shared_control_env.core import loading
from shared_control_env.envs.scenarios import ENTRY, SCENARIOS

if TYPE_CHECKING:
    from shared_control_env.controllers.allocators import Allocator
    from shared_control_env.controllers.automation import Planner
    from shared_control_env.envs.shared_control import SharedControlEnv
    from shared_control_env.wrappers.authority_limiter import AuthorityLimiter


class Limited:
    """The callable that ``gym.make`` uses as entry point; Gymnasium reads the rendering modes from ``metadata``.

    Args:
        name: key of :data:`scenarios.SCENARIOS`.
    """

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 20}

    def __init__(self, name: str) -> None:
        self.name = name

    def __call__(
        self,
        config: dict[str, Any] | None = None,
        render_mode: str | None = None,
        limiter: bool | Allocator = True,
        automation: Planner | None = None,
    ) -> AuthorityLimiter | SharedControlEnv:
        """Create the scenario's environment.

        Args:
            config: changes to its settings.
            render_mode: ``human``, ``rgb_array`` or None.
            limiter: True binds alpha_a with the fuzzy inference, as ``gym.make_vec`` does. An allocator binds alpha_a
                itself. False leaves both slots of the action open.
            automation: planner that decides u_a,des instead of the predictive controller.

        Raises:
            ValueError: for invalid settings, or for an object that is not an allocator or an automation.
        """
        loading.begin(driver=False, limiter=False)  # beside the import of highway-env
        from shared_control_env.envs.environments import environment_class
        from shared_control_env.wrappers.authority_limiter import AuthorityLimiter

        env = environment_class(self.name)(config, render_mode=render_mode)
        if automation is not None:
            env.automation = automation
        if isinstance(limiter, bool):
            return AuthorityLimiter(env) if limiter else env
        return AuthorityLimiter(env, limiter)


def __getattr__(name: str) -> Limited:
    """The entry point of a scenario, by its key in :data:`scenarios.SCENARIOS`."""
    key = name.removeprefix(ENTRY)
    if key not in SCENARIOS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return Limited(key)
