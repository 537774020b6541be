"""One episode with and without a limit of the automation's authority, as one video."""

import sys
from pathlib import Path

import numpy as np

from shared_control_env.evaluation.catalogue import AUTHORITIES, DRIVERS
from shared_control_env.evaluation.replay import record, replay_episode

OUT = Path("results/examples/side_by_side.mp4")
SECONDS = float(sys.argv[1]) if len(sys.argv) > 1 else 8.0
DRIVER = "hands_on"

drives = []
for authority in ("proportional", "none"):
    frames = []
    entries = (DRIVER, DRIVERS[DRIVER]), (authority, AUTHORITIES[authority])
    metrics = replay_episode("lane_keeping", *entries, "step_bias", 3, frames, {"duration": SECONDS})
    print(f"{authority}: largest lateral error {metrics['lateral_max']:.2f} m")
    drives.append(frames)
length = max(map(len, drives))
pairs = ([frames[min(k, len(frames) - 1)] for frames in drives] for k in range(length))
record([np.concatenate(pair) for pair in pairs], OUT)
print(f"The video is {OUT}: above with the fuzzy limiter, below without.")
