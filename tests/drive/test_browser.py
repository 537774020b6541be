"""The page in a browser: it loads, keys move the wheel, a drive ends with a result and a recording, and it goes again."""

import time

import pytest

from shared_control_env.recordings.trial import Trial


@pytest.fixture
def opened(browser, serving):
    browser.get(serving.server.url)
    wait(browser, "empty")
    yield browser
    errors = [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    assert not errors, errors
    browser.get("about:blank")


def wait(browser, *states, seconds=60.0):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        state = browser.execute_script("return window.drive && window.drive.state")
        if state in states:
            return state
        if state == "paused":  # the machine is so busy that an input came too late
            key(browser, " ")
        time.sleep(0.02)
    raise AssertionError(f"no {states}, but {state}: {browser.find_element('tag name', 'body').text}")


def press(browser, text):
    button = next(each for each in browser.find_elements("tag name", "button") if each.text == text)
    button.click()


def key(browser, name, down=True):
    browser.execute_script(
        "document.body.dispatchEvent(new KeyboardEvent(arguments[1], {key: arguments[0], bubbles: true}))",
        name,
        "keydown" if down else "keyup",
    )


def choose(browser, **fields):
    for name, value in fields.items():
        browser.execute_script(
            "const e = document.getElementById(arguments[0]); e.value = arguments[1]; e.dispatchEvent(new Event('change'))",
            name,
            value,
        )


def frame(browser):
    return browser.execute_script("return window.drive.world.frame")


def test_a_newcomer_drives_and_sees_the_result(opened, folder):
    begin = time.monotonic()
    choose(opened, scenario="lane_keeping", degradation="step_bias", authority="none", seed="1")
    press(opened, "Drive")
    wait(opened, "ready")
    key(opened, " ")
    wait(opened, "driving")
    assert time.monotonic() - begin < 60.0  # of which compiling takes most, once on a machine
    key(opened, "ArrowLeft")
    time.sleep(0.5)
    turned = frame(opened)["wheel"][1]
    key(opened, "ArrowLeft", down=False)
    assert turned > 0.03
    time.sleep(1.0)
    assert abs(frame(opened)["wheel"][1]) < turned
    key(opened, "v")
    assert opened.execute_script("return window.drive.world.top")
    wait(opened, "over", seconds=20.0)
    end = time.monotonic() + 20.0
    while "Recorded as" not in opened.find_element("id", "card").text:
        assert time.monotonic() < end
        time.sleep(0.05)
    text = opened.find_element("id", "card").text
    assert "internal model" in text
    (name,) = folder.names()
    assert name in text
    trial = Trial.read(folder.path / name)
    assert trial.columns["raw"][:, 0].sum() >= 5.0
    press(opened, "Next seed")
    wait(opened, "ready")
    assert "seed 2" in opened.find_element("id", "what").text


def test_the_page_pauses_and_goes_on(opened):
    choose(opened, scenario="bend", degradation="none")
    press(opened, "Drive")
    wait(opened, "ready")
    key(opened, " ")
    wait(opened, "driving")
    time.sleep(0.3)
    key(opened, "p")
    wait(opened, "paused")
    assert "invalid" in opened.find_element("id", "notice").text
    key(opened, " ")
    wait(opened, "driving")
    press(opened, "Choose")
    wait(opened, "empty")


def test_motion_is_smooth_between_the_frames(opened):
    """20 frames a second become a pose for each picture, which never jumps by more than the car can move."""
    choose(opened, scenario="two_lane", degradation="none")
    press(opened, "Drive")
    wait(opened, "ready")
    key(opened, " ")
    wait(opened, "driving")
    time.sleep(0.5)
    script = """
        const done = arguments[0], seen = [];
        const note = () => {
          const world = window.drive.world;
          seen.push([performance.now() / 1000, ...world.poses(performance.now() / 1000)[0], world.frame.n]);
          if (seen.length < 90) requestAnimationFrame(note); else done(seen);
        };
        requestAnimationFrame(note);
    """
    seen = opened.execute_async_script(script)
    moves = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in zip(seen[:-1], seen[1:], strict=True) if b[0] - a[0] > 0.004]
    assert len({row[4] for row in seen}) < len(seen)  # more pictures than frames
    assert min(moves) > 0.0
    assert max(moves) < 30.0  # twice the speed


@pytest.mark.parametrize("width", [1024, 1600])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_and_follows_the_colours_of_the_reader(opened, width, scheme):
    opened.set_window_size(width, 800)
    opened.execute_cdp_cmd(
        "Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
    )
    assert opened.execute_script("return document.documentElement.scrollWidth <= innerWidth")
    card = opened.find_element("id", "card").rect
    assert card["x"] >= 0
    assert card["x"] + card["width"] <= width
    paper = opened.execute_script("return getComputedStyle(document.body).backgroundColor")
    assert (paper == "rgb(255, 255, 255)") == (scheme == "light")
    assert opened.execute_script("return window.drive.world.colour('ink')") != ""


PLUG_IN = """
window.pad = {id: 'made up', connected: true, axes: arguments[0], buttons: []};
navigator.getGamepads = () => [window.pad];
"""


def drive_with_a_gamepad(opened):
    """Plug a made-up gamepad in, calibrate it, and begin to drive."""
    opened.execute_script(PLUG_IN, [0, 0, 0])
    choose(opened, scenario="lane_keeping", degradation="none", device="gamepad")
    press(opened, "Drive")
    for axes in ([-1, 0, 1], [1, 0, 1], [0, 0, 1], [0, -1, 1], [0, 0, 1], [0, 0, -1], [0, 0, 1]):
        opened.execute_script("window.pad.axes = arguments[0]", axes)
        press(opened, "Next")
        time.sleep(0.05)
    wait(opened, "ready")
    key(opened, " ")
    wait(opened, "driving")


def test_a_gamepad_is_calibrated_and_drives(opened):
    """A made-up gamepad: the page asks for movements, the server finds the axes, and the stick turns the wheel."""
    drive_with_a_gamepad(opened)
    opened.execute_script("window.pad.axes = [-0.6, 0, 1]")
    time.sleep(0.4)
    assert frame(opened)["wheel"][1] > 0.05


def test_after_a_reload_the_page_drives_with_the_same_device(opened):
    """And not with the keyboard, whose keys would be taken for axes."""
    drive_with_a_gamepad(opened)
    opened.refresh()
    wait(opened, "paused")
    opened.execute_script(PLUG_IN, [0, 0, 1])
    assert opened.execute_script("return window.drive.input.device") == "gamepad"
    key(opened, "ArrowLeft")
    key(opened, " ")
    wait(opened, "driving")
    time.sleep(0.3)
    assert frame(opened)["wheel"][1] == 0.0
    opened.execute_script("window.pad.axes = [-0.6, 0, 1]")
    time.sleep(0.4)
    assert frame(opened)["wheel"][1] > 0.05
