"""A recording as traffic: how far the drive is from what the recorded person did, and who reacted to it."""

import gymnasium as gym

import shared_control_env  # noqa: F401
from shared_control_env.evaluation import Suite, evaluate
from shared_control_env.wrappers import DriverModel

RECORDING = {"file": "example"}  # or a CommonRoad scenario (.xml), a table (.tracks.csv), or a folder of them
CONFIG = {"recording": RECORDING, "internal_model": {"active": True}, "authority": {"law": "proportional"}}

env = DriverModel(gym.make("SharedControl/Recorded-v1", config=CONFIG))
for seed in range(3):
    env.reset(seed=seed)
    left, done = 0, False
    while not done:
        _, _, terminated, truncated, info = env.step(0)
        left, done = int(info["handed_over"].sum()), terminated or truncated
    print(f"seed {seed}: in the place of vehicle {env.unwrapped.episode.recording.ego}, {left} reacted to the ego")

suite = Suite("the recording without a fault", ("recorded",), ("none",))
table = evaluate("internal_model", "proportional", suite, seeds=range(5), config={"recording": RECORDING})
print(table[["seed", "human_displacement", "human_speed_rms", "min_gap"]].round(2).to_string(index=False))
