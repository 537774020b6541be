"""Human-machine shared control of automated vehicles under automation degradation.

Importing the package registers its environments with Gymnasium.
"""

from importlib.metadata import PackageNotFoundError, version

from shared_control_env.registration import register_environments

try:
    __version__ = version("shared_control_env")
except PackageNotFoundError:  # A source tree that is on the path but not installed.
    __version__ = "0.0.0"

register_environments()
