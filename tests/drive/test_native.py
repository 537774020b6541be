"""The wheel that the server reads itself, against a device with the same interface; the real one needs hardware."""

import numpy as np
import pytest

from shared_control_env.drive.devices import Axis, Calibration
from shared_control_env.drive.free import FreeDriving
from shared_control_env.drive.native import FULL_FORCE, STRONGEST, Feedback, NativeWheel, choose, feedback_of
from shared_control_env.drive.session import Choice
from shared_control_env.recordings.trial import Trial
from tests.drive.conftest import Page, Serving

try:
    import evdev
    from evdev import ecodes, ff
except ImportError:
    evdev = None
    from tests.drive.fake_evdev import ecodes, ff


class Joystick:
    def __init__(self, *axes, name="Made Up Wheel"):
        self.axes, self.name, self.there = list(axes), name, True

    def get_name(self):
        return self.name

    def get_numaxes(self):
        return len(self.axes)

    def get_axis(self, axis_number):
        return self.axes[axis_number]

    def attached(self):
        return self.there


class Device:
    """What evdev.InputDevice does with forces."""

    name = "Made Up Wheel"

    def __init__(self, *effects):
        self.effects = effects or (ecodes.FF_CONSTANT, ecodes.FF_SPRING)
        self.uploaded, self.written, self.count = {}, [], 0

    def capabilities(self):
        return {ecodes.EV_FF: list(self.effects)}

    def upload_effect(self, effect):
        number = effect.id if effect.id >= 0 else self.count
        self.count = max(self.count, number + 1)
        self.uploaded[number] = effect
        return number

    def write(self, kind, code, value):
        self.written.append((kind, code, value))


WHEEL = Calibration(
    device="wheel",
    steering=Axis(axis=0, rest=0.0, full=-1.0, other=1.0),
    throttle=Axis(axis=1, rest=1.0, full=-1.0),
    brake=Axis(axis=2, rest=1.0, full=-1.0),
)


def test_the_axes_are_read_at_the_tick():
    joystick = Joystick(-0.5, 1.0, 1.2)
    readings, age = NativeWheel(joystick, joystick.attached).read(3.0)
    np.testing.assert_array_equal(readings, [-0.5, 1.0, 1.0])
    assert age == 0.0
    joystick.there = False
    assert NativeWheel(joystick, joystick.attached).read(3.0)[1] == np.inf


def test_a_wheel_is_chosen_by_a_part_of_its_name():
    found = [Joystick(name="Pad"), Joystick(name="G29 Racing Wheel")]
    assert choose(found, "g29") is found[1]
    assert choose(found, "any") is found[0]
    with pytest.raises(ValueError, match="connected are 'Pad', 'G29 Racing Wheel'"):
        choose(found, "T300")
    with pytest.raises(ValueError, match="connected are none"):
        choose([], "any")


def level(device):
    return device.uploaded[1].u.ff_constant_effect.level


def test_the_force_pulls_towards_the_automation_and_is_capped():
    device = Device()
    feedback = Feedback(device, 0.2, ff, ecodes)
    spring = device.uploaded[0]
    assert spring.type == ecodes.FF_SPRING
    assert spring.u.ff_condition_effect[0].left_coeff == round(0.2 * FULL_FORCE)
    feedback.push(0.05)
    assert device.uploaded[1].direction == 0x4000  # the kernel's left, so that a positive level pulls to the left
    assert level(device) == round(0.1 * FULL_FORCE)
    feedback.push(5.0)
    assert level(device) == round(0.2 * FULL_FORCE)
    feedback.push(-5.0)
    assert level(device) == round(-0.2 * FULL_FORCE)
    feedback.rest()
    assert level(device) == 0
    assert len(device.uploaded) == 2  # one effect is changed, not one added a tick
    assert device.written == [(ecodes.EV_FF, 0, 1), (ecodes.EV_FF, 1, 1)]


def test_the_wheel_is_pushed_by_its_difference_to_the_automation():
    device, joystick = Device(), Joystick(-0.2, 1.0, 1.0)
    wheel = NativeWheel(joystick, joystick.attached, Feedback(device, 0.1, ff, ecodes))
    wheel.push(0.2 * 0.5, 0.5, WHEEL)  # the automation holds the same angle
    assert level(device) == 0
    wheel.push(0.0, 0.5, WHEEL)  # it holds less: back to the right
    assert level(device) < 0
    wheel.rest()
    assert level(device) == 0


@pytest.mark.parametrize("torque", [0.31, -0.1, 1.0])
def test_forces_that_a_hand_could_not_hold_are_refused(torque):
    with pytest.raises(ValueError, match=f"must lie in \\(0, {STRONGEST}"):
        Feedback(Device(), torque, ff, ecodes)


def test_a_device_without_forces_is_refused():
    with pytest.raises(ValueError, match="has no spring and constant force"):
        Feedback(Device(ecodes.FF_RUMBLE), 0.1, ff, ecodes)
    assert feedback_of("Made Up Wheel", 0.0) is None
    with pytest.raises(ValueError, match="no event device 'Made Up Wheel'" if evdev else "needs Linux and the extra"):
        feedback_of("Made Up Wheel", 0.1)


def serving_with(joystick, device, folder):
    """Serve free drives by a wheel with forces."""

    def make(seat):
        seat.native = NativeWheel(joystick, joystick.attached, Feedback(device, 0.1, ff, ecodes))
        return FreeDriving(seat, folder, Choice())

    return Serving(make)


def test_it_drives_and_the_page_does_not(folder):
    """Two devices never mix: while the wheel drives, the page's inputs count for nothing."""
    joystick, device = Joystick(0.0, 1.0, 1.0), Device()
    serving = serving_with(joystick, device, folder)
    with serving.connect() as connection:
        page = Page(connection)
        assert page.until("welcome")["native"] == "Made Up Wheel"
        for step, axes in zip(
            ("left", "right", "centre", "throttle", "released", "brake", "free"),
            ([-1, 1, 1], [1, 1, 1], [0, 1, 1], [0, -1, 1], [0, 1, 1], [0, 1, -1], [0, 1, 1]),
            strict=True,
        ):
            joystick.axes = axes
            page.say(type="sample", step=step, device="wheel", name="")
            if step != "free":
                time_for_it(page)
        calibration = page.until("calibration")["calibration"]
        assert calibration["name"] == "Made Up Wheel"
        page.start(scenario="lane_keeping", degradation="none", device="wheel", calibration=calibration)
        page.say(type="begin")
        joystick.axes = [-0.1, 1.0, 1.0]
        got = page.drive(20.0, readings=(0.0, 1.0, 0.0, 0.0))
        assert got[-1]["state"] == "over"
        trial = Trial.read(folder.path / page.until("result")["recording"])
        assert trial.header["device"] == "wheel"
        np.testing.assert_allclose(trial.columns["command"][:, 1], 0.1 * np.radians(30.0))
        assert level(device) == 0
    serving.stop()


def test_a_wheel_that_is_unplugged_pauses_and_forces_end_with_the_drive(folder):
    joystick, device = Joystick(0.0, 1.0, 1.0), Device()
    serving = serving_with(joystick, device, folder)
    with serving.connect() as connection:
        page = Page(connection)
        page.start(degradation="bias_ramp", authority="none", device="wheel", calibration=WHEEL.model_dump())
        page.say(type="begin")
        joystick.axes = [-0.5, 1.0, 1.0]
        page.drive(0.5)
        assert level(device) != 0
        joystick.there = False
        assert "no input" in page.until("state", state="paused")["reason"]
        assert level(device) == 0
        joystick.there = True
        page.say(type="resume")
        page.drive(0.3)
        assert level(device) != 0
        page.say(type="leave")
        page.until("state", state="empty")
        assert level(device) == 0
        joystick.axes = [0.0]
        page.say(
            type="start",
            **{"scenario": "bend", "degradation": "own", "authority": "paper"},
            device="wheel",
            calibration=WHEEL.model_dump(),
        )
        assert "fewer axes" in page.until("refused")["message"]
    serving.stop()


def time_for_it(page):
    """The server takes messages in order; an answer to a later one shows that it has taken this one."""
    page.say(type="recordings")
    page.until("recordings")


def test_the_stand_in_has_the_numbers_and_structures_of_the_package():
    if evdev is None:
        pytest.skip("needs the extra 'wheel'")
    from tests.drive import fake_evdev

    for name, value in vars(fake_evdev.ecodes).items():
        assert getattr(ecodes, name) == value
    for name, made in vars(fake_evdev.ff).items():
        assert getattr(ff, name) is not None
        if name != "EffectType":
            assert [field[0] for field in made._fields_] == [field[0] for field in getattr(ff, name)._fields_]


def test_a_virtual_device_where_the_machine_allows_it():
    if evdev is None:
        pytest.skip("needs the extra 'wheel'")
    try:
        made = evdev.UInput(
            {ecodes.EV_ABS: [(ecodes.ABS_X, evdev.AbsInfo(0, -100, 100, 0, 0, 0))]}, name="virtual wheel"
        )
    except (evdev.uinput.UInputError, OSError) as error:
        pytest.skip(f"this machine has no writable /dev/uinput: {error}")
    with made:
        assert made.name == "virtual wheel"
        assert feedback_of("virtual wheel", 0.0) is None
        with pytest.raises(ValueError, match=r"spring and constant|no event device"):
            feedback_of("virtual wheel", 0.1)
