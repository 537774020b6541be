"""An allocator of your own against the fuzzy inference: results, and a figure of both in one episode."""

from pathlib import Path

import gymnasium as gym
import matplotlib.pyplot as plt

import shared_control_env  # noqa: F401
from shared_control_env.controllers.allocators import FuzzyAuthority
from shared_control_env.evaluation import evaluate
from shared_control_env.wrappers import DriverModel

OUT = Path("results/examples")
CONFIG = {"authority": {"law": "proportional"}, "internal_model": {"active": True}}


class Slow:
    """Follows 1 - the larger risk, but falls and rises by at most 0.05 a step."""

    def reset(self, seed=None):
        self.alpha = 1.0

    def allocate(self, scene, signals):
        wanted = 1.0 - max(signals["r_x"], signals["r_y"])
        self.alpha += min(max(wanted - self.alpha, -0.05), 0.05)
        return self.alpha


allocators = {"slow": Slow, "fuzzy": FuzzyAuthority}
table = evaluate("internal_model", allocators, suite="paper")
print(table[["scenario", "authority", "lateral_max", "driver_effort"]].round(3).to_string(index=False))

figure, axis = plt.subplots(figsize=(7, 3), layout="constrained")
for name, make in allocators.items():
    env = DriverModel(gym.make("SharedControl/TwoLane-v1", config=CONFIG, limiter=make()))
    env.reset(seed=0)
    rows, done = [], False
    while not done:
        _, _, terminated, truncated, info = env.step(0)
        rows.append((info["t"], info["alpha_a"]))
        done = terminated or truncated
    axis.plot(*zip(*rows, strict=True), label=name)
axis.set(xlabel="time [s]", ylabel="authority of the automation [-]")
axis.legend()
OUT.mkdir(parents=True, exist_ok=True)
figure.savefig(OUT / "own_allocator.png", dpi=120)
print(f"The figure is {OUT / 'own_allocator.png'}.")
