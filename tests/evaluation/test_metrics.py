"""Every metric on trajectories made by hand, whose values are known."""

import numpy as np
import pytest

from shared_control_env.evaluation import evaluate
from shared_control_env.evaluation import metrics as m
from shared_control_env.evaluation.metrics import METRICS, Trajectory

T = 100
STATES = ("lateral_error", "speed", "target_speed", "lateral_speed", "yaw_rate", "gap", "lead_speed")


def trajectory(**changes):
    """Five seconds of healthy driving in the middle of the lane, with changes."""
    values = {
        "dt": 0.05,
        "lateral_error": np.zeros(T),
        "lane_width": 4.0,
        "body_width": 2.0,
        "speed": np.full(T, 10.0),
        "target_speed": np.full(T, 10.0),
        "lateral_speed": np.zeros(T),
        "yaw_rate": np.zeros(T),
        "command": np.zeros((T, 2)),
        "delta_max": 0.5,
        "a_max": 5.0,
        "gap": np.full(T, np.inf),
        "lead_speed": np.zeros(T),
        "driver": np.zeros((T, 2)),
        "automation": np.zeros((T, 2)),
        "authority": np.ones(T),
        "sound_authority": np.ones(T),
        "alert": np.zeros(T, dtype=bool),
        "degraded": np.zeros(T, dtype=bool),
        "crashed": False,
        "left_road": False,
        "solver_failures": 0,
        "wall_time": 0.5,
    }
    values |= changes
    for name in STATES:  # the state in which the episode ends is the last one again, unless a test gives its own
        if len(values[name]) == len(values["command"]):
            values[name] = np.append(values[name], values[name][-1])
    return Trajectory(**values)


def steps(*pieces):
    """Piecewise constant signal: (number of steps, value) pairs, the last one to the end."""
    values = np.concatenate([np.full(n, float(v)) for n, v in pieces])
    return np.concatenate([values, np.full(T - len(values), values[-1])])


FAULT = steps((20, 0), (80, 1)).astype(bool)  # sets in after 1 s


def test_a_quiet_drive():
    quiet = m.measure_all(trajectory())
    undefined = {
        "human_displacement",
        "human_speed_rms",
        "min_gap",
        "min_thw",
        "min_ttc",
        "time_to_detect",
        "time_to_alert",
        "missed_detection",
        "recovery_time",
    }
    assert {name for name, value in quiet.items() if np.isnan(value)} == undefined
    assert quiet.pop("real_time_factor") == pytest.approx(10.0)
    assert (quiet.pop("authority_min"), quiet.pop("controlled"), quiet.pop("lane_room_min")) == (1.0, 1.0, 1.0)
    assert all(value == 0.0 for name, value in quiet.items() if name not in undefined)


@pytest.mark.parametrize("entry", METRICS.values(), ids=METRICS)
def test_every_metric_has_a_unit_a_direction_and_a_definition(entry):
    assert entry.unit
    assert entry.better in ("lower", "higher", "neither")
    assert entry.definition.endswith(".")


LATERAL = steps((10, 0.0), (20, 2.5), (10, 1.0), (5, -3.0), (55, 0.0))


@pytest.mark.parametrize(
    ("name", "changes", "expected"),
    [
        ("collisions", {"crashed": True}, 1.0),
        ("road_departures", {"left_road": True}, 1.0),
        ("lane_departures", {"lateral_error": LATERAL}, 2.0),
        ("lane_departures", {"lateral_error": steps((5, 1.1), (95, 0.0))}, 1.0),
        ("lane_departures", {"lateral_error": steps((100, 1.0))}, 0.0),
        ("lane_departures", {"lateral_error": np.append(np.zeros(T), 1.2)}, 1.0),  # in the last state
        ("controlled", {"degraded": FAULT, "lateral_error": steps((15, 1.5), (85, 0.9))}, 1.0),  # before the onset
        ("controlled", {"degraded": FAULT, "lateral_error": np.append(np.zeros(T), -1.2)}, 0.0),
        ("controlled", {"lateral_error": steps((15, 1.5), (85, 0.9))}, 0.0),
        ("controlled", {"left_road": True}, 0.0),
        ("controlled", {"crashed": True}, 0.0),
        ("lane_room_min", {"lateral_error": np.append(np.zeros(T), -2.3)}, -1.3),
        ("time_out_of_lane", {"lateral_error": LATERAL}, 25 * 0.05),
        ("lateral_max", {"lateral_error": LATERAL}, 3.0),
        ("lateral_rms", {"lateral_error": np.repeat([1.0, -3.0], [51, 50])}, np.sqrt(501.0 / 101.0)),
        ("min_gap", {"gap": steps((50, np.inf), (30, 12.0), (20, 8.0))}, 8.0),
        ("min_gap", {"gap": np.append(np.full(T, 12.0), 0.0), "crashed": True}, 0.0),  # whatever was hit
        ("min_ttc", {"gap": np.append(np.full(T, np.inf), 0.0), "crashed": True}, 0.0),
        ("exposed_time", {"gap": steps((50, 20.0), (50, 8.0)), "lead_speed": np.full(T, 6.0)}, 51 * 0.05),
        ("exposed_time_integral", {"gap": steps((50, 20.0), (50, 8.0)), "lead_speed": np.full(T, 6.0)}, 51 * 0.05),
        ("max_drac", {"gap": np.append(np.full(T, 8.0), 0.0), "lead_speed": np.full(T, 6.0), "crashed": True}, 1.0),
        ("min_thw", {"gap": steps((50, 20.0), (50, 8.0))}, 0.8),
        ("min_thw", {"gap": steps((100, 8.0)), "speed": np.full(T, 0.5)}, np.nan),
        ("min_ttc", {"gap": steps((50, 20.0), (50, 8.0)), "lead_speed": np.full(T, 6.0)}, 2.0),
        ("min_ttc", {"gap": np.full(T, 8.0), "lead_speed": np.full(T, 12.0)}, np.nan),
        ("max_drac", {"gap": steps((50, 20.0), (50, 8.0)), "lead_speed": np.full(T, 6.0)}, 1.0),
        ("max_drac", {"gap": np.full(T, 8.0), "lead_speed": np.full(T, 12.0)}, 0.0),
        ("time_to_detect", {"degraded": FAULT, "authority": steps((26, 1.0), (74, 0.5))}, 6 * 0.05),
        ("time_to_detect", {"degraded": FAULT, "authority": steps((10, 0.5), (90, 1.0))}, np.nan),
        (
            "time_to_detect",
            {"degraded": FAULT, "authority": steps((100, 0.5)), "sound_authority": steps((100, 0.5))},
            np.nan,
        ),
        ("time_to_detect", {"degraded": FAULT, "sound_authority": np.full(T, np.nan)}, np.nan),
        ("false_alert", {"degraded": FAULT, "alert": steps((5, 1), (95, 0)).astype(bool)}, 0.25),
        ("false_alert", {"alert": steps((50, 1), (50, 0)).astype(bool)}, 0.5),
        ("time_to_alert", {"degraded": FAULT, "alert": steps((26, 0), (74, 1)).astype(bool)}, 6 * 0.05),
        ("time_to_alert", {"degraded": FAULT}, np.nan),
        ("missed_detection", {"degraded": FAULT, "authority": steps((26, 1.0), (74, 0.5))}, 0.0),
        ("missed_detection", {"degraded": FAULT, "authority": steps((100, 0.9))}, 1.0),
        ("false_authority_loss", {"degraded": FAULT, "authority": steps((10, 0.5), (10, 1.0), (80, 0.0))}, 0.25),
        ("false_authority_loss", {"authority": steps((50, 0.5), (50, 1.0))}, 0.25),
        (
            "driver_effort",
            {"driver": np.stack([steps((50, 0.3), (50, 0.0)), steps((50, 0.4), (50, 0.0))], 1)},
            np.sqrt(0.125),
        ),
        (
            "driver_effort_peak",
            {"driver": np.stack([steps((50, 0.3), (50, 0.0)), steps((50, 0.4), (50, 0.0))], 1)},
            0.5,
        ),
        ("authority_min", {"authority": steps((50, 0.4), (50, 0.9))}, 0.4),
        ("conflict", {"driver": np.full((T, 2), 0.5), "automation": np.full((T, 2), [-0.2, 0.2])}, 0.1),
        ("lateral_acceleration_max", {"yaw_rate": steps((50, 0.1), (50, -0.3))}, 3.0),
        ("lateral_jerk_max", {"yaw_rate": steps((50, 0.0), (50, 0.2))}, 4.0),
        ("iso_11270_violation", {"yaw_rate": steps((90, 0.0), (10, 0.31))}, 10 / 100),
        ("iso_11270_violation", {"yaw_rate": steps((80, 0.0), (20, 0.26))}, 9 / 100),
        ("jerk_rms", {"command": np.stack([steps((50, 0.0), (50, 0.1)), np.zeros(T)], 1)}, np.sqrt(100.0 / 99.0)),
        ("speed_rms", {"speed": steps((50, 12.0), (50, 8.0))}, 2.0),
        ("recovery_time", {"degraded": FAULT, "lateral_error": steps((30, 0.0), (10, 1.0), (60, 0.2))}, 20 * 0.05),
        ("recovery_time", {"degraded": FAULT}, 0.0),
        ("recovery_time", {"degraded": FAULT, "lateral_error": steps((30, 0.0), (70, 1.0))}, np.nan),
        ("recovery_time", {"degraded": FAULT, "crashed": True}, np.nan),
        ("solver_failures", {"solver_failures": 3}, 3.0),
        ("human_displacement", {"human": np.array([[0.0, 1.0], [2.0, 1.0], [4.0, 1.0]])}, 2.0),
        ("human_displacement", {}, np.nan),
        ("human_speed_rms", {"human": np.array([[0.0, 3.0], [2.0, -4.0]])}, np.sqrt(12.5)),
        ("human_speed_rms", {}, np.nan),
    ],
)
def test_values(name, changes, expected):
    assert METRICS[name].measure(trajectory(**changes)) == pytest.approx(expected, nan_ok=True)


def test_every_metric_has_a_value_tested():
    (mark,) = test_values.pytestmark
    tested = {name for name, _, _ in mark.args[1]} | {"real_time_factor", "steering_reversal_rate"}
    assert tested == set(METRICS)


@pytest.mark.parametrize(("amplitude", "reversals"), [(0.02, 5), (np.radians(0.09), 0)])
def test_steering_reversals_of_a_sine(amplitude, reversals):
    """Five half periods end in five turning points; one smaller than the gap has none."""
    command = np.zeros((T, 2))
    command[:, 1] = amplitude / 0.5 * np.sin(np.pi * np.arange(T) / 20.0)
    rate = METRICS["steering_reversal_rate"].measure(trajectory(command=command))
    assert rate == pytest.approx(60.0 * reversals / 5.0)


@pytest.mark.parametrize("name", METRICS)
def test_left_and_right_are_the_same(name):
    rng = np.random.default_rng(0)
    signals = {
        "lateral_error": rng.normal(size=T),
        "lateral_speed": rng.normal(size=T),
        "yaw_rate": 0.1 * rng.normal(size=T),
        "degraded": FAULT,
    }
    signals |= {key: 0.1 * rng.normal(size=(T, 2)) for key in ("command", "driver", "automation")}
    mirrored = {key: value if key == "degraded" else -value for key, value in signals.items()}
    for key in ("command", "driver", "automation"):
        mirrored[key] = signals[key] * [1.0, -1.0]
    measure = METRICS[name].measure
    assert measure(trajectory(**signals)) == pytest.approx(measure(trajectory(**mirrored)), nan_ok=True)


def test_short_episodes_have_no_windowed_jerk():
    short = trajectory(**{key: getattr(trajectory(), key)[:6] for key in STATES})
    assert np.isnan(METRICS["lateral_jerk_max"].measure(short))
    assert METRICS["iso_11270_violation"].measure(short) == 0.0


def test_the_lateral_acceleration_is_that_of_the_centre_of_mass():
    """In a slide the car yaws without a force: v_y' takes back what v_x r gives."""
    t = 0.05 * np.arange(T + 1)
    spinning = {"yaw_rate": np.full(T, 1.0), "lateral_speed": -10.0 * t}  # v_x = 10 m/s: a straight path in space
    assert METRICS["lateral_acceleration_max"].measure(trajectory(**spinning)) == pytest.approx(0.0, abs=1e-9)
    assert METRICS["iso_11270_violation"].measure(trajectory(**spinning)) == 0.0


def test_no_drive_of_the_suite_accelerates_beyond_the_friction():
    """The worst driver of the catalogue under every law, on brush tyres: mu g, but for the averaging over a step."""
    table = evaluate("mpc", ["driver_only", "none", "proportional", "paper"], "full", seeds=[0, 1])
    friction = np.where(table["scenario"] == "wet_road", 0.5, 0.9)
    assert (table["lateral_acceleration_max"] <= 1.05 * friction * 9.81).all()
    assert table["lateral_acceleration_max"].max() > 8.0
