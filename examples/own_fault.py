"""A kind of fault of your own, compiled into the kernel: small steering commands are lost."""

import gymnasium as gym

import shared_control_env  # noqa: F401
from shared_control_env.core.faults.kinds import SHARE, Kind, add_kind
from shared_control_env.wrappers import DriverModel


def dead_band(c):
    """Commands smaller than a share of the limit are lost."""
    return 0.0 if abs(c.u) < c.g * c.size * c.bound else c.u


add_kind(Kind("dead_band", SHARE, act=dead_band))
for size in (0.0, 0.05, 0.2):
    fault = {"kind": "dead_band", "channel": "steering", "onset": 0.0, "size": size}
    config = {"degradations": [], "faults": [fault], "authority": {"law": "none"}, "driver_lag": {"K_h": 0.0}}
    env = DriverModel(gym.make("SharedControl/Bend-v1", config=config))
    env.reset(seed=0)
    largest, done = 0.0, False
    while not done:
        _, _, terminated, truncated, info = env.step(0)
        largest, done = max(largest, abs(info["z"][1])), terminated or truncated
    print(f"dead band of {100 * size:.0f} % of the limit, nobody at the wheel: largest lateral error {largest:.2f} m")
