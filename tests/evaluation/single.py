"""An episode of the benchmark in the single environment, to hold the kernel's rows against it."""

import numpy as np

from shared_control_env.envs.environments import environment_class
from shared_control_env.evaluation.episodes import Recorder, settings_of
from shared_control_env.evaluation.metrics import measure_all
from shared_control_env.wrappers import AuthorityLimiter, DriverModel


def drive_single(batch):
    """Metrics of a batch's one episode; the predictive driver is solved by OSQP here, to its tolerance of 1e-5."""
    ((degradation, seed),) = batch.episodes
    make_driver, make_allocator = batch.driver[1].make, batch.authority[1].make
    env = AuthorityLimiter(environment_class(batch.scenario)(settings_of(batch, degradation)), make_allocator())
    env = DriverModel(env, make_driver() if make_driver else None)
    env.reset(seed=seed)
    settings = env.unwrapped.episode
    recorder, going, k = Recorder(settings.steps, 1), True, 0
    while going:
        _, _, terminated, truncated, info = env.step(0)
        going = recorder.note(k, as_batch(info), np.array([terminated or truncated]), env.unwrapped.scene[None])
        k += 1
    return measure_all(recorder.trajectory(0, settings, 1.0))


def as_batch(info):
    """The info of one environment in the form of many."""
    return {k: as_batch(v) if isinstance(v, dict) else np.asarray(v)[None] for k, v in info.items()}
