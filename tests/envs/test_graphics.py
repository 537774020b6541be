import os
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import RecordVideo

import shared_control_env  # noqa: F401
from shared_control_env.envs.highway import viewer as graphics
from shared_control_env.wrappers import DriverModel


def frame_after(name, steps, **config):
    env = DriverModel(gym.make(name, render_mode="rgb_array", config=config))
    env.reset(seed=0)
    for _ in range(steps):
        env.step(0)
    frame = env.render()
    env.close()
    return frame


def count(frame, colour):
    return int((frame == np.array(colour)).all(axis=-1).sum())


@pytest.mark.parametrize("name", ["SharedControl/TwoLane-v1", "SharedControl/Curve-v1"])
def test_frame_shows_prediction_path_safe_area_and_gauges(name):
    frame = frame_after(name, 40)
    assert frame.dtype == np.uint8
    height = frame.shape[0] - graphics.PANEL_HEIGHT
    world, panel = frame[:height], frame[height:]
    assert count(world, graphics.PREDICTION) > 80  # the diamond
    assert count(world, graphics.PATH) > 50
    assert count(panel, graphics.DEGRADED) > 200
    assert count(panel, graphics.AUTHORITY) > 200
    assert count(panel, graphics.RISK) > 200
    green = world[..., 1].astype(int) - world[..., 0].astype(int) > 25
    assert green.sum() > 2000  # the safe area tints the road


def test_left_is_up():
    # The prediction under a steering fault to the left lies above the middle of the road's picture.
    frame = frame_after("SharedControl/TwoLane-v1", 30)
    world = frame[: frame.shape[0] - graphics.PANEL_HEIGHT]
    rows = np.flatnonzero((world == np.array(graphics.PREDICTION)).all(axis=-1).any(axis=1))
    assert rows.mean() < 0.5 * len(world) - 5


def test_frames_repeat():
    np.testing.assert_array_equal(frame_after("SharedControl/Curve-v1", 20), frame_after("SharedControl/Curve-v1", 20))


def test_closing_one_viewer_leaves_the_other_alive():
    first, second = (gym.make("SharedControl/TwoLane-v1", render_mode="rgb_array") for _ in range(2))
    for env in (first, second):
        env.reset(seed=0)
        env.render()
    first.close()
    assert second.render().any()
    second.close()


def test_video_runs_at_the_speed_of_the_drive(tmp_path):
    import imageio_ffmpeg

    config = {"duration": 1.0, "screen_width": 320, "screen_height": 240}
    env = gym.make("SharedControl/TwoLane-v1", render_mode="rgb_array", config=config)
    video = RecordVideo(DriverModel(env), str(tmp_path / "video"), episode_trigger=lambda _: True)
    video.reset(seed=0)
    for _ in range(20):
        video.step(0)
    video.close()
    (path,) = (tmp_path / "video").glob("*.mp4")
    meta = imageio_ffmpeg.read_frames(str(path)).__next__()
    assert meta["fps"] == 20.0
    frames, _ = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert frames == 21


def test_metadata_is_each_environments_own():
    slow = gym.make("SharedControl/TwoLane-v1", config={"simulation_frequency": 20, "policy_frequency": 10})
    fast = gym.make("SharedControl/TwoLane-v1")
    for env in (slow, fast):
        env.reset(seed=0)
    assert (slow.metadata["render_fps"], fast.metadata["render_fps"]) == (10, 20)


def test_human_mode_on_a_dummy_display():
    code = (
        "import gymnasium as gym, numpy as np, shared_control_env\n"
        "env = gym.make('SharedControl/TwoLane-v1', render_mode='human', config={'screen_width': 400})\n"
        "env.reset(seed=0)\n"
        "env.step(np.zeros(2, dtype=np.float32))\n"
        "import pygame\n"
        "shown = pygame.surfarray.array3d(pygame.display.get_surface())\n"
        "drawn = pygame.surfarray.array3d(env.unwrapped.viewer.frame_surface)\n"
        "assert (shown == drawn).all() and drawn.any()\n"
        "env.close()\n"
    )
    environment = {**os.environ, "SDL_VIDEODRIVER": "dummy"}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)


def test_the_gauges_are_those_of_the_step_that_led_to_the_picture(monkeypatch):
    config = {"degradations": ["delay"], "authority": {"law": "none"}}
    env = DriverModel(gym.make("SharedControl/Bend-v1", render_mode="rgb_array", config=config))
    env.reset(seed=1_000_000)
    for _ in range(125):
        info = env.step(0)[4]
    written = []
    monkeypatch.setattr(graphics.SharedControlViewer, "_write", lambda self, text, corner: written.append(text))
    env.render()
    assert f"lateral risk r_y = {info['r_y']:.2f}" in written
    degrees = np.degrees(-info["u_a_f"][1])
    assert degrees > 0.1
    for name in ("degraded", "limited"):  # one command under the law none
        assert f"steering, {name}: {degrees:.2f} deg right" in written
    assert f"acceleration, driver: {round(info['u_h_act'][0], 2) + 0.0:+.2f} m/s2" in written
