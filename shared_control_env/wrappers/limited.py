"""The registered environments: a scenario with the authority limiter applied, unless it is left out.

The limiter is applied here and not in the registration, since Gymnasium's vector entry points allow no
additional wrappers there.
"""

from __future__ import annotations

from typing import Any

from shared_control_env.controllers.automation import Planner
from shared_control_env.envs.cases import CASES
from shared_control_env.envs.scenarios import scenario
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
        limiter: bool = True,
        automation: Planner | None = None,
    ) -> AuthorityLimiter | SharedControlEnv:
        """The scenario's environment.

        Args:
            config: changes to its settings.
            render_mode: ``human``, ``rgb_array`` or None.
            limiter: bind alpha_a with the fuzzy inference, as ``gym.make_vec`` does; else both slots of the action are
                open, for ``AuthorityLimiter`` with an allocator of one's own, or ``DriverModel``.
            automation: who decides u_a,des in the predictive controller's place.

        Raises:
            ValueError: for wrong settings, or what is no automation.
        """
        if not isinstance(limiter, bool):
            raise ValueError(
                f"limiter = {limiter!r} must be True or False; an allocator of your own goes into AuthorityLimiter "
                "around an environment made with limiter=False"
            )
        env = self.scenario(config, render_mode=render_mode)
        if automation is not None:
            env.automation = automation
        return AuthorityLimiter(env) if limiter else env


def __getattr__(name: str) -> Limited:
    """The entry point of a scenario, by its key in :data:`cases.CASES`."""
    if name not in CASES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return Limited(scenario(name))
