"""Train a driver with Stable-Baselines3 on the kernel, and let it drive one episode."""

import sys

import gymnasium as gym
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

import shared_control_env  # noqa: F401
from shared_control_env.vector.stable_baselines import StableBaselinesVecEnv

STEPS = int(sys.argv[1]) if len(sys.argv) > 1 else 200_000
CONFIG = {"authority": {"law": "proportional"}}

envs = gym.make_vec("SharedControl/LaneKeeping-v1", num_envs=64, autoreset_mode="same_step", config=CONFIG)
model = PPO("MlpPolicy", VecMonitor(StableBaselinesVecEnv(envs)), n_steps=64, batch_size=1024, seed=0, device="cpu")
model.learn(STEPS)

env = gym.make("SharedControl/LaneKeeping-v1", config=CONFIG)
observation, _ = env.reset(seed=3_000_000)  # seeds from here on are used by no training of the package
total, done = 0.0, False
while not done:
    action, _ = model.predict(observation, deterministic=True)
    observation, reward, terminated, truncated, info = env.step(action)
    total, done = total + reward, terminated or truncated
print(f"return {total:.1f} after {info['t']:.1f} s, lateral error at the end {info['z'][1]:+.2f} m")
