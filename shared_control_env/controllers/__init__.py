"""Controllers with state: the automation and the driver. Each is a thin layer around the compiled core."""

from shared_control_env.controllers.automation import Automation
from shared_control_env.controllers.driver import Driver, PredictiveDriver
from shared_control_env.controllers.solution import Solution

__all__ = ["Automation", "Driver", "PredictiveDriver", "Solution"]
