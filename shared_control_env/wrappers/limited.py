"""The registered environments: a scenario with the authority limiter applied.

The limiter is applied here and not in the registration, since Gymnasium's vector entry points allow no
additional wrappers there.
"""

from __future__ import annotations

from typing import Any

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

    def __call__(self, config: dict[str, Any] | None = None, render_mode: str | None = None) -> AuthorityLimiter:
        """The scenario with its settings changed by ``config``, and the limiter applied."""
        return AuthorityLimiter(self.scenario(config, render_mode=render_mode))


def __getattr__(name: str) -> Limited:
    """The entry point of a scenario, by its key in :data:`cases.CASES`."""
    if name not in CASES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return Limited(scenario(name))
