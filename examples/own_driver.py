"""A driver of your own, who acts late, beside the predictive driver who knows its lag."""

from collections import deque

import numpy as np

from shared_control_env.evaluation import evaluate
from shared_control_env.evaluation.catalogue import DRIVERS


class Late:
    """Steers back to the lane's centre and keeps the target speed, 0.2 s late."""

    def reset(self, seed=None):
        self.past = deque(maxlen=5)

    def act(self, observation, scene):
        _, y, heading, speed, _, _ = scene["z"]
        self.past.append(np.array([0.5 * (scene["v_target"] - speed), -0.05 * (y - scene["y_target"]) - 0.5 * heading]))
        return self.past[0]


table = evaluate({"late": Late, "internal_model": DRIVERS["internal_model"]}, "proportional", suite="paper")
print(table[["scenario", "driver", "lateral_max", "driver_effort"]].round(3).to_string(index=False))
