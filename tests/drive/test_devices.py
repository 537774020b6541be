import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from shared_control_env.core.parameters import Limits
from shared_control_env.drive.calibration import STEPS, calibrated
from shared_control_env.drive.devices import (
    BRAKE_RATE,
    CENTRE_RATE,
    STEER_RATE,
    THROTTLE_RATE,
    Axes,
    Axis,
    Calibration,
    Keyboard,
)

LIMITS, DT = Limits(), 0.05
LEFT, RIGHT, UP, DOWN, NONE = np.eye(4)[0], np.eye(4)[1], np.eye(4)[2], np.eye(4)[3], np.zeros(4)


def held(keyboard, keys, steps):
    return [keyboard.command(keys, DT) for _ in range(steps)][-1]


def test_a_key_turns_the_wheel_at_its_rate_and_it_centres_itself():
    keyboard = Keyboard(LIMITS)
    assert held(keyboard, LEFT, 4).delta == pytest.approx(4 * STEER_RATE * DT)
    assert held(keyboard, NONE, 1).delta == pytest.approx(4 * STEER_RATE * DT - CENTRE_RATE * DT)
    assert held(keyboard, NONE, 10) == (0.0, 0.0)
    assert held(keyboard, RIGHT, 1000).delta == pytest.approx(-LIMITS.delta_max)


def test_a_key_against_the_angle_first_returns_the_wheel():
    keyboard = Keyboard(LIMITS)
    held(keyboard, LEFT, 20)
    before = 20 * STEER_RATE * DT
    assert held(keyboard, RIGHT, 1).delta == pytest.approx(before - CENTRE_RATE * DT)


def test_pedals():
    keyboard = Keyboard(LIMITS)
    assert held(keyboard, UP, 2).a == pytest.approx(2 * THROTTLE_RATE * DT)
    keyboard.reset()
    assert held(keyboard, DOWN, 2).a == pytest.approx(-2 * BRAKE_RATE * DT)
    assert held(keyboard, DOWN, 100).a == -LIMITS.a_max
    assert held(keyboard, LEFT + RIGHT + UP + DOWN, 100) == (0.0, 0.0)


WHEEL = Calibration(
    device="wheel",
    steering=Axis(axis=0, rest=0.05, full=-0.9, other=1.0),
    throttle=Axis(axis=2, rest=1.0, full=-1.0),
    brake=Axis(axis=3, rest=1.0, full=-1.0),
)


def test_a_pedal_that_reads_0_until_it_moves_does_not_brake():
    axes = Axes(WHEEL, LIMITS)
    assert axes.command(np.array([0.05, 0.0, 0.0, 0.0]), DT) == (0.0, 0.0)  # 0 would be half of each pedal
    pressed = axes.command(np.array([0.05, 0.0, -1.0, 0.0]), DT)
    assert pressed == (LIMITS.a_max, 0.0)
    assert axes.command(np.array([0.05, 0.0, 1.0, 0.0]), DT).a == 0.0
    assert axes.command(np.array([0.05, 0.0, 0.0, -1.0]), DT).a == pytest.approx(0.5 * LIMITS.a_max - LIMITS.a_max)


@given(st.floats(-1.0, 1.0))
def test_a_wheel_is_linear_on_either_side_and_within_its_limits(reading):
    delta = Axes(WHEEL, LIMITS).command(np.array([reading, 0.0, 1.0, 1.0]), DT).delta
    span = 0.95
    share = (0.05 - reading) / span if reading <= 0.05 else -(reading - 0.05) / span
    assert delta == pytest.approx(np.clip(share, -1.0, 1.0) * LIMITS.delta_max)


def test_a_stick_is_fine_in_the_middle_and_full_at_the_end():
    pad = WHEEL.model_copy(
        update={"device": "gamepad", "dead_zone": 0.1, "steering": Axis(axis=0, rest=0.0, full=-1.0, other=1.0)}
    )
    axes = Axes(pad, LIMITS)
    steer = [axes.command(np.array([-x, 0.0, 1.0, 1.0]), DT).delta / LIMITS.delta_max for x in (0.05, 0.1, 0.4, 1.0)]
    assert steer[:2] == [0.0, 0.0]
    assert 0.0 < steer[2] < 0.15
    assert steer[3] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"steering": {"axis": 0, "rest": 0.0, "full": 1.0}}, "needs both ends"),
        ({"steering": {"axis": 0, "rest": 0.0, "full": 1.0, "other": 0.9}}, "must lie between"),
        ({"steering": {"axis": 0, "rest": 0.0, "full": 0.1, "other": -1.0}}, "at least 0.2 away"),
        ({"throttle": {"axis": 0, "rest": 1.0, "full": -1.0}}, "cannot be the steering and a pedal"),
        ({"throttle": {"axis": 2, "rest": float("nan"), "full": -1.0}}, "finite"),
        ({"throttle": {"axis": 99, "rest": 1.0, "full": -1.0}}, "less than 32"),
        ({"dead_zone": 0.9}, "less than or equal to 0.3"),
    ],
)
def test_wrong_calibrations(changes, said):
    with pytest.raises(ValidationError, match=said):
        Calibration.model_validate({**WHEEL.model_dump(), **changes})


def samples(**changes):
    at_rest = [0.0, 0.3, 1.0, 1.0, 0.0]
    found = {step: list(at_rest) for step in STEPS}
    found["left"][0], found["right"][0], found["centre"][0] = -0.95, 0.98, 0.02
    found["throttle"][2], found["brake"][3] = -1.0, -0.8
    return {**found, **changes}


def test_the_axes_that_move_are_found():
    made = calibrated("wheel", "G29", samples())
    assert (made.steering.axis, made.throttle.axis, made.brake.axis) == (0, 2, 3)
    assert (made.steering.full, made.steering.other, made.steering.rest) == (-0.95, 0.98, 0.02)
    assert (made.brake.rest, made.brake.full) == (1.0, -0.8)


def test_both_pedals_may_share_an_axis():
    one = samples()
    one["throttle"], one["brake"] = [0.0, 0.3, -1.0, 1.0, 0.0], [0.0, 0.3, 1.0, 1.0, 0.0]
    one["released"] = one["free"] = [0.0, 0.3, 0.0, 1.0, 0.0]
    made = calibrated("gamepad", "pad", one)
    assert made.throttle.axis == made.brake.axis == 2
    assert made.dead_zone > 0.0


def test_what_does_not_move_is_said():
    with pytest.raises(ValueError, match="no axis moved enough between 'brake' and 'free'"):
        calibrated("wheel", "G29", samples(brake=samples()["free"]))
    short = samples()
    del short["centre"]
    with pytest.raises(ValueError, match="lacks centre"):
        calibrated("wheel", "G29", short)
