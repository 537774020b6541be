"""A scenario of your own: a narrow country road with a tight bend, its speed and radius drawn."""

import gymnasium as gym

from shared_control_env.envs.scenarios import Scenario, add_scenario
from shared_control_env.evaluation import Suite, evaluate

add_scenario(
    "country_road",
    Scenario(
        id="Mine/CountryRoad-v0",
        description="a narrow road with a tight bend",
        settings={
            "road": {
                "lanes": 2,
                "lane_width": 3.0,
                "segments": [{"length": 40.0, "curvature": 0.0}, {"length": 120.0, "curvature": 1.0 / 80.0}],
            },
            "ego": {"speed": 12.0},
            "degradations": ["bias_ramp", "stuck"],
            "randomise": [
                {"setting": "ego.speed", "low": 10.0, "high": 14.0},
                {"setting": "road.segments.1.curvature", "low": 1.0 / 120.0, "high": 1.0 / 70.0},
            ],
        },
    ),
)
env = gym.make("Mine/CountryRoad-v0")
for seed in range(3):
    env.reset(seed=seed)
    episode = env.unwrapped.episode
    print(f"seed {seed}: {episode.ego.speed:.1f} m/s, radius {1 / episode.road.segments[1].curvature:.0f} m")

suite = Suite("the country road with its own faults", ("country_road",), (None,))
table = evaluate("internal_model", ["proportional", "none"], suite, seeds=range(10))
print(table.groupby("authority")[["lateral_max", "terminated"]].mean().round(2))
