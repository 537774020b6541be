"""Recorded traffic: files, smoothing, replay and reaction; on the small generated recording, and on the shared one."""

from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import shared_control_env  # noqa: F401
from shared_control_env.core.records import BODY_LENGTH, BODY_WIDTH, HEADING, SPEED, YAW_RATE, X, Y
from shared_control_env.core.world.collision import overlap
from shared_control_env.core.world.replay import AWAY
from shared_control_env.core.world.road import LEFT, RIGHT, WIDTH, locate, width_at
from shared_control_env.envs.recorded.commonroad import read_commonroad
from shared_control_env.envs.recorded.recording import Recording, Track, check
from shared_control_env.envs.recorded.replay import files_in, read, replay_of, usable
from shared_control_env.envs.recorded.road import road_along
from shared_control_env.envs.recorded.smoothing import motion, smoothed
from shared_control_env.envs.recorded.tracks import read_tracks
from shared_control_env.envs.settings import plain
from shared_control_env.wrappers import DriverModel

ID = "SharedControl/Recorded-v1"
SHARED = Path(__file__).parents[3] / "shared/data/USA_US101-5_1_T-1.xml"
EXAMPLE = files_in("example")[0]
QUIET = {"degradations": [], "internal_model": {"active": True}}


@pytest.fixture
def us101():
    if not SHARED.exists():
        pytest.skip(f"needs {SHARED.name} in ../shared/data")
    return SHARED


def made(path, ego=None, **config):
    return gym.make(ID, config={**QUIET, "recording": {"file": str(path), "ego": ego}, **config})


def driven(path, ego, **config):
    """Traffic of every step while the predictive driver drives, and the last info."""
    env = DriverModel(made(path, ego, **config))
    env.reset(seed=0)
    bare, traffic = env.unwrapped, []
    done = False
    while not done:
        traffic.append(bare.traffic.copy())
        _, _, terminated, truncated, info = env.step(0)
        done = terminated or truncated
    return np.array(traffic), info, bare


# The file


def test_the_example_is_read():
    recording = read_tracks(EXAMPLE)
    assert len(recording.tracks) == 6
    assert [lane.lane_to_left for lane in recording.lanes.values()] == ["1", "2", None]
    assert recording.tracks["2"].length == 12.0


def test_the_shared_file_is_read(us101):
    recording = read_commonroad(us101)
    assert len(recording.tracks) == 25
    assert len(recording.lanes) == 5
    lengths = [track.length for track in recording.tracks.values()]
    assert (min(lengths), max(lengths)) == (pytest.approx(4.0, abs=0.1), pytest.approx(14.6, abs=0.1))
    assert sum(track.t[-1] < 9.99 for track in recording.tracks.values()) == 17


XML = """<?xml version="1.0"?>
<commonRoad commonRoadVersion="2020a" timeStepSize="0.1">
  <lanelet id="1">
    <leftBound><point><x>0</x><y>2</y></point><point><x>100</x><y>2</y></point></leftBound>
    <rightBound><point><x>0</x><y>-2</y></point><point><x>100</x><y>-2</y></point></rightBound>
  </lanelet>
  <dynamicObstacle id="7"><shape><rectangle><length>4.5</length><width>1.8</width></rectangle></shape>
    <initialState><position><point><x>5</x><y>0</y></point></position><orientation><exact>0</exact></orientation>
      <time><exact>0</exact></time></initialState>
    <trajectory>STATES</trajectory>
  </dynamicObstacle>
</commonRoad>
"""
STATE = (
    "<state><position><point><x>{x}</x><y>0</y></point></position><orientation><exact>0</exact></orientation>"
    "<time><exact>{t}</exact></time></state>"
)
GOOD = XML.replace("STATES", "".join(STATE.format(x=5 + t, t=t) for t in range(1, 40)))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("2020a", "2016a", "no CommonRoad scenario of the version"),
        ('timeStepSize="0.1"', 'timeStepSize="10"', "timeStepSize = 10 s must lie in"),
        ('timeStepSize="0.1"', "", "timeStepSize is missing"),
        ("<length>4.5</length>", "<length>450</length>", "dynamicObstacle 7|vehicle 7: length = 450"),
        ("<length>4.5</length>", "<length>much</length>", "dynamicObstacle 7: shape: length = 'much' is no number"),
        ("<length>4.5</length>", "", "dynamicObstacle 7: shape: length is missing"),
        ("<rectangle>", "<circle>", "no whole XML"),
        ("<x>6</x>", "<x>nan</x>", "vehicle 7: x is not finite in state 1"),
        ("<x>6</x>", "<x>600</x>", "vehicle 7 moves at .* m/s after state"),
        ("<exact>2</exact>", "<exact>1</exact>", "vehicle 7: from state 1 to the next t goes from 0.1 to 0.1 s"),
        ('<dynamicObstacle id="7">', "<dynamicObstacle>", "a dynamicObstacle has no id"),
        ("<x>100</x><y>2</y>", "<x>inf</x><y>2</y>", "lane 1: its left border"),
        ("</lanelet>", '<successor ref="9"/></lanelet>', "lane 1 refers to the lane 9, which is not there"),
        ("</lanelet>", '<adjacentLeft ref="1" drivingDir="same"/></lanelet>', "neighbours .* lead back to the lane 1"),
        ("</lanelet>", '<successor ref="1"/></lanelet>', "successors of the lane 1 lead back to the lane 1"),
        ("<commonRoad ", '<!DOCTYPE a [<!ENTITY b "c">]><commonRoad ', "declares a document type or entities"),
        ("</commonRoad>", "", "no whole XML file"),
        ("<lanelet", "<x>" * 200 + "</x>" * 200 + "<lanelet", "nests elements more than"),
    ],
)
def test_a_wrong_file_is_refused_by_file_and_element(tmp_path, old, new, said):
    assert old in GOOD
    path = tmp_path / "wrong.xml"
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(ValueError, match=said) as error:
        made(path, duration=2.0)
    assert "wrong.xml" in str(error.value)


def test_other_wrong_files(tmp_path):
    good = tmp_path / "good.xml"
    good.write_text(GOOD)
    made(good, duration=2.0)
    for name, content in (("cut.xml", GOOD[:700].encode()), ("empty.xml", b""), ("bytes.xml", b"\xff\xfe\x00")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ValueError, match=name):
            made(tmp_path / name, duration=2.0)
    twice = GOOD.replace("</commonRoad>", GOOD[GOOD.index("<dynamicObstacle") :].replace('id="7"', 'id="8"'))
    (tmp_path / "twice.xml").write_text(twice)
    with pytest.raises(ValueError, match="the vehicles 7 and 8 are inside each other"):
        made(tmp_path / "twice.xml", duration=2.0)
    with pytest.raises(ValueError, match="no recording, and no folder"):
        made(tmp_path / "nowhere")
    with pytest.raises(ValueError, match="no vehicle that is recorded for 8 s"):
        made(good)
    with pytest.raises(ValueError, match="no vehicle and no planning problem '99'"):
        made(good, "99", duration=2.0)


def test_wrong_tables(tmp_path):
    tracks, lanes = EXAMPLE.read_text(), EXAMPLE.with_name("example.lanes.csv").read_text()
    for i, (table, old, new, said) in enumerate(
        (
            ("tracks", "heading", "yaw", "has no column heading"),
            ("tracks", "4.6,1.9", "4.6,wide", "width = 'wide' in row 1 is no number"),
            ("tracks", "4.6,1.9", "4.7,1.9", "vehicle 1 changes its length"),
            ("lanes", "0,left", "0,middle", "side left or right"),
            ("lanes", "2,", "5,", "numbered from 0"),
        )
    ):
        texts = {"tracks": tracks, "lanes": lanes}
        texts[table] = (
            texts[table].replace(old, new) if table == "lanes" and old == "2," else texts[table].replace(old, new, 1)
        )
        folder = tmp_path / str(i)
        folder.mkdir()
        for name, text in texts.items():
            (folder / f"x.{name}.csv").write_text(text)
        with pytest.raises(ValueError, match=said):
            read_tracks(folder / "x.tracks.csv")
    folder = tmp_path / "alone"
    folder.mkdir()
    (folder / "x.tracks.csv").write_text(tracks)
    with pytest.raises(ValueError, match=r"x\.lanes\.csv cannot be read"):
        read_tracks(folder / "x.tracks.csv")


def test_what_the_recording_decides_cannot_be_set():
    for config, said in (
        ({"road": {"lanes": 4}}, "'road'"),
        ({"ego": {"speed": 3.0}}, "'ego'"),
        ({"vehicles": [{"lane": 0, "position": 30.0, "speed": 9.0}]}, "'vehicles'"),
        ({"vehicle": {"length": 4.0}}, "'length'"),
    ):
        with pytest.raises(ValueError, match=f"{said}.* would not act"):
            gym.make(ID, config=config)


def test_an_episode_that_was_drawn_begins_as_its_recording_says():
    """The settings of an episode make the same episode again; with another start they are refused."""
    first = gym.make(ID, config={"duration": 2.0})
    observation, _ = first.reset(seed=3)
    config = plain(first.unwrapped.episode)
    np.testing.assert_array_equal(gym.make(ID, config=config).reset(seed=0)[0], observation)
    for section, change in (("ego", {"speed": 1.0}), ("road", {"lanes": 1}), ("vehicle", {"width": 1.0})):
        with pytest.raises(ValueError, match=f"'{section}'.* would not act"):
            gym.make(ID, config={**config, section: {**config[section], **change}})
    with pytest.raises(ValueError, match="set by the environment"):
        gym.make(ID, config={"recording": {"file": "example", "drawn": True}})


@pytest.mark.parametrize("setting", ["ego.speed", "vehicle.length", "road.lane_width"])
def test_what_the_recording_decides_is_not_drawn(setting):
    entry = {"setting": setting, "low": 4.0, "high": 5.0}
    with pytest.raises(ValueError, match=f"draws '{setting}', which the recording"):
        gym.make(ID, config={"randomise": [entry]})


# The road


def test_the_line_runs_through_the_middle_of_the_lane_and_has_its_width(us101):
    recording, widths = read(us101), []
    for name in ("476", "449", "554"):
        track = recording.tracks[name]
        road = road_along(recording, track.x[0], track.y[0])
        lane = next(lane for lane in recording.lanes.values() if _contains(lane, track.x[0], track.y[0]))
        for border, sign in ((lane.left, 1.0), (lane.right, -1.0)):
            for point in road.into(np.column_stack([border, np.zeros(len(border))]))[2:-2]:
                s, d, _, _ = locate(road.line, point[0], point[1])
                assert d == pytest.approx(sign * 0.5 * width_at(road.line, s), abs=0.12)
        inner = road.line[2:-2]
        assert ((inner[:, WIDTH] > 3.0) & (inner[:, WIDTH] < 3.8)).all()
        widths += [inner[:, WIDTH].min(), inner[:, WIDTH].max()]
        assert (inner[:, LEFT] - inner[:, RIGHT] > 16.0).all()
        assert road.lanes == 5
    assert np.ptp(widths) > 0.2


def _contains(lane, x, y):
    from shapely import Point, Polygon

    return Polygon(np.vstack([lane.left, lane.right[::-1]])).contains(Point(x, y))


# The replay


def test_smoothing_keeps_a_motion_that_is_smooth_and_takes_noise_away():
    t = np.arange(0.0, 10.0, 0.1)
    x, y = 12.0 * t + 0.4 * np.sin(0.6 * t), 0.002 * (12.0 * t) ** 2 / 2.0
    noisy = x + 0.1 * np.random.default_rng(0).normal(size=len(t))
    track = Track(4.5, 1.8, t, noisy, y, np.zeros_like(t))
    rows = motion(track, t[10:-10])
    assert np.abs(rows[:, X] - x[10:-10]).max() < 0.15
    true = 12.0 + 0.24 * np.cos(0.6 * t[10:-10])
    assert np.abs(rows[:, SPEED] - np.hypot(true, 0.024 * x[10:-10] * 1.0)).max() < 1.2
    clean = motion(Track(4.5, 1.8, t, x, y, np.zeros_like(t)), t[10:-10])
    np.testing.assert_allclose(clean[:, X], x[10:-10], atol=1e-3)


def test_a_vehicle_that_stands_keeps_its_heading():
    t = np.arange(0.0, 6.0, 0.1)
    x = np.where(t < 2.0, 5.0 * t, 10.0) + 0.02 * np.random.default_rng(1).normal(size=len(t))
    rows = motion(Track(4.5, 1.8, t, x, np.zeros_like(t), np.zeros_like(t)), t)
    assert np.abs(np.diff(rows[t > 3.0, HEADING])).max() < 1e-9


@pytest.mark.parametrize("ego", ["1", "3"])
def test_positions_are_those_of_the_record_while_nobody_deviates(ego):
    """Offset, heading and speed, the three errors of other replays: the ego is put where its own record has it."""
    env = made(EXAMPLE, ego)
    env.reset(seed=0)
    bare = env.unwrapped
    replay = replay_of(EXAMPLE, ego, 0.05, bare.episode.steps)
    rows = []
    for k in range(bare.episode.steps - 1):
        human = replay.human[k]
        bare.vehicle.array[:] = [human[X], human[Y], human[HEADING], human[SPEED], 0.0, human[YAW_RATE]]
        info = env.step(np.zeros(2))[4]
        rows.append(bare.traffic.copy())
        assert not info["handed_over"].any()
        assert not info["crashed"]
    rows = np.array(rows)
    there = rows[:, :, X] != AWAY
    tracks = replay.tracks[:, 1 : len(rows) + 1].transpose(1, 0, 2)
    gap = np.hypot(rows[:, :, X] - tracks[:, :, X], rows[:, :, Y] - tracks[:, :, Y])[there]
    assert gap.max() < 0.05
    moved = np.hypot(np.diff(rows[:, :, X], axis=0), np.diff(rows[:, :, Y], axis=0)) / 0.05
    both = there[1:] & there[:-1]
    mean = 0.5 * (rows[1:, :, SPEED] + rows[:-1, :, SPEED])
    np.testing.assert_allclose(moved[both], mean[both], atol=0.05)
    turned = np.diff(np.unwrap(rows[:, :, HEADING], axis=0), axis=0) / 0.05
    assert np.abs(turned[both]).max() < 0.3
    swinging = np.abs(np.fft.rfft(turned - turned.mean(axis=0), axis=0)) ** 2
    assert swinging[len(swinging) // 3 :].sum() < 0.1 * swinging.sum() + 1e-9  # of the yaw rate, above 3.3 Hz


def test_every_usable_vehicle_of_the_shared_file_can_be_the_ego(us101, capsys):
    found = {duration: usable(us101, duration) for duration in (2.0, 5.0, 10.0)}
    with capsys.disabled():
        print(
            "\nvehicles and planning problems of 26 that can be the ego: " + str({d: len(n) for d, n in found.items()})
        )
    assert {duration: len(names) for duration, names in found.items()} == {2.0: 21, 5.0: 16, 10.0: 9}
    for ego in found[2.0]:
        traffic, info, bare = driven(us101, ego, duration=2.0)
        assert not info["crashed"], ego
        assert info["on_road"], ego
        assert nobody_appears_inside_another(traffic)
        bodies = {(row[BODY_LENGTH], row[BODY_WIDTH]) for row in traffic[0]}
        assert len(bodies) > 10
        assert (5.0, 2.0) not in bodies


def nobody_appears_inside_another(traffic):
    for before, now in zip(traffic[:-1], traffic[1:], strict=True):
        for i in np.flatnonzero((before[:, X] == AWAY) & (now[:, X] != AWAY)):
            for j in np.flatnonzero(now[:, X] != AWAY):
                if i != j and overlap(now[i], now[j]):
                    return False
    return True


@pytest.mark.parametrize("ego", ["476", "450", "523"])
def test_an_ego_that_brakes_is_not_driven_through(us101, ego):
    env = made(
        us101,
        ego,
        duration=5.0,
        authority={"law": "driver_only"},
        driver_lag={"direct": True},
        internal_model={"active": False},
    )
    env.reset(seed=0)
    done, handed = False, 0
    while not done:
        _, _, terminated, truncated, info = env.step(np.array([-1.0, 0.0], np.float32))
        handed = max(handed, int(info["handed_over"].sum()))
        done = terminated or truncated
    assert not info["crashed"]
    if ego == "450":  # the others are not followed closely
        assert handed > 0


@pytest.mark.parametrize("path", [EXAMPLE, SHARED], ids=["example", "shared"])
def test_single_and_vectorised_are_the_same(path):
    if not path.exists():
        pytest.skip(f"needs {path.name} in ../shared/data")
    config = {"degradations": ["step_bias"], "recording": {"file": str(path)}, "duration": 4.0}
    single, many = gym.make(ID, config=config), gym.make_vec(ID, num_envs=3, config=config)
    for seed in (5, 8):
        first, _ = single.reset(seed=seed)
        all_of_them, _ = many.reset(seed=[seed, 2, 3])
        np.testing.assert_array_equal(first, all_of_them[0])
        rng = np.random.default_rng(seed)
        done = False
        while not done:
            actions = rng.uniform(-0.2, 0.1, (3, 2)).astype(np.float32)
            observation, _, terminated, truncated, info = single.step(actions[0])
            observations, _, _, _, infos = many.step(actions)
            np.testing.assert_allclose(observation, observations[0], atol=1e-9)
            np.testing.assert_allclose(info["state"], infos["state"][0], rtol=0, atol=1e-9)
            done = terminated or truncated


@pytest.mark.parametrize(("ego", "at"), [("476", 2.0), ("450", 3.0)])
def test_gap_headway_and_closing_are_those_of_the_file_by_hand(us101, ego, at):
    """THW, TTC and DRAC along the record, from the raw positions and velocities of the file, without our code."""
    import xml.etree.ElementTree as ElementTree

    root = ElementTree.parse(us101).getroot()
    states, sizes = {}, {}
    for obstacle in root.findall("dynamicObstacle"):
        sizes[obstacle.get("id")] = float(obstacle.findtext("shape/rectangle/length"))
        for state in [*obstacle.findall("initialState"), *obstacle.findall("trajectory/state")]:
            key = obstacle.get("id"), int(state.findtext("time/exact"))
            values = ("position/point/x", "position/point/y", "velocity/exact", "orientation/exact")
            states[key] = [float(state.findtext(name)) for name in values]
    step = round(at / 0.1) + min(k for name, k in states if name == ego)
    x, y, speed, heading = states[ego, step]
    best = np.inf, None
    for (name, k), (other_x, other_y, other_speed, _) in states.items():
        if k != step or name == ego:
            continue
        along = (other_x - x) * np.cos(heading) + (other_y - y) * np.sin(heading)
        across = -(other_x - x) * np.sin(heading) + (other_y - y) * np.cos(heading)
        if along > 0.0 and abs(across) < 1.7 and along < best[0]:
            best = along, (name, other_speed)
    name, lead_speed = best[1]
    gap = best[0] - 0.5 * (sizes[ego] + sizes[name])
    env = made(us101, ego, duration=5.0)
    env.reset(seed=0)
    bare = env.unwrapped
    replay = replay_of(us101, ego, 0.05, bare.episode.steps)
    for k in range(round(at / 0.05) + 1):
        human = replay.human[k]
        bare.vehicle.array[:] = [human[X], human[Y], human[HEADING], human[SPEED], 0.0, human[YAW_RATE]]
        info = env.step(np.zeros(2))[4]
    z, ahead = info["z"], info["neighbours"][2]
    ours = ahead[1] - z[0] - 0.5 * (sizes[ego] + sizes[name])
    assert ours == pytest.approx(gap, abs=0.6)
    assert ours / z[3] == pytest.approx(gap / speed, abs=0.1)
    assert z[3] - ahead[3] == pytest.approx(speed - lead_speed, abs=0.8)
    drac = [max(closing, 0.0) ** 2 / (2.0 * g) for closing, g in ((z[3] - ahead[3], ours), (speed - lead_speed, gap))]
    assert drac[0] == pytest.approx(drac[1], abs=0.15)


def test_the_suite_measures_against_the_recorded_human(tmp_path):
    from shared_control_env.evaluation import evaluate
    from shared_control_env.evaluation.catalogue import Suite

    suite = Suite("one", ("recorded",), ("none", "step_bias"))
    table = evaluate("internal_model", "proportional", suite, seeds=(0, 1), out=tmp_path / "out")
    assert (table["human_displacement"] > 0.0).all()
    assert (table["human_speed_rms"] < 20.0).all()
    assert "recorded" in (tmp_path / "out/report.html").read_text()


def test_the_command_takes_a_folder_of_recordings(tmp_path):
    from typer.testing import CliRunner

    from shared_control_env.cli import app

    (tmp_path / "a.xml").write_text(GOOD)
    arguments = [
        "benchmark",
        "--drivers",
        "none",
        "--authorities",
        "paper",
        "--seeds",
        "0",
        "--out",
        str(tmp_path / "o"),
    ]
    wrong = CliRunner().invoke(app, [*arguments, "--recordings", str(tmp_path)])
    assert wrong.exit_code == 2
    assert "--recordings would not act" in " ".join(wrong.output.replace("│", " ").split())
    short = CliRunner().invoke(app, [*arguments, "--suite", "recorded", "--recordings", str(tmp_path)])
    assert short.exit_code == 2
    assert "recorded for 8 s" in " ".join(short.output.replace("│", " ").split())


def test_a_folder_is_drawn_from_and_the_seed_decides(tmp_path):
    (tmp_path / "a.xml").write_text(GOOD)
    (tmp_path / "b.xml").write_text(GOOD.replace('id="7"', 'id="70"'))
    env = made(tmp_path, duration=2.0)
    drawn = []
    for seed in range(12):
        env.reset(seed=seed)
        drawn.append((Path(env.unwrapped.episode.recording.file).name, env.unwrapped.episode.recording.ego))
    assert set(drawn) == {("a.xml", "7"), ("b.xml", "70")}
    env.reset(seed=3)
    assert (Path(env.unwrapped.episode.recording.file).name, env.unwrapped.episode.recording.ego) == drawn[3]


def test_copies_go_on():
    import copy
    import pickle

    env = made(EXAMPLE, "1").unwrapped
    env.reset(seed=0)
    action = {"driver": np.zeros(2), "authority": np.ones(1)}
    for _ in range(10):
        env.step(action)
    first, second = pickle.loads(pickle.dumps(env)), copy.deepcopy(env)
    for _ in range(20):
        states = [each.step(action)[4]["state"] for each in (env, first, second)]
        np.testing.assert_array_equal(states[0], states[1])
        np.testing.assert_array_equal(states[0], states[2])
        np.testing.assert_array_equal(env.traffic, first.traffic)


def test_the_smoothed_positions_are_near_the_recorded_ones(us101):
    for track in read(us101).tracks.values():
        if len(track.t) > 10:
            x, y = smoothed(track)
            assert np.hypot(x(track.t) - track.x, y(track.t) - track.y).max() < 1.0


def test_a_recording_without_lanes_or_vehicles_is_none():
    track = Track(4.5, 1.8, np.arange(3.0), np.arange(3.0), np.zeros(3), np.zeros(3))
    with pytest.raises(ValueError, match="has no lane"):
        check(Recording("x", {}, {"1": track}))


def test_pictures_of_the_kernels_environments_show_the_recording():
    """An episode may have fewer vehicles than the batch has rows, since the ego is one of the recording's."""
    envs = gym.make_vec(ID, num_envs=2, render_mode="rgb_array", config={"duration": 2.0})
    envs.reset(seed=3)
    single = gym.make(ID, render_mode="rgb_array", config={"duration": 2.0})
    single.reset(seed=3)
    for _ in range(5):
        envs.step(np.zeros((2, 2)))
        single.step(np.zeros(2))
    np.testing.assert_array_equal(envs.render()[0], single.render())
