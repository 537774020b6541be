"""A picture of the page on which people drive, taken in headless Chromium: ``docs/drive.png``.

Run ``python -m experiments.screenshot``. It needs Chromium with its driver, and the extra ``dev``.
"""

from __future__ import annotations

import asyncio
import shutil
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from shared_control_env.drive.folders import RecordingsFolder
from shared_control_env.drive.free import FreeDriving
from shared_control_env.drive.server import Server
from shared_control_env.drive.session import Choice

CHOICE = Choice("curve_with_lead", "step_bias", "proportional", "", 6)
"""What is driven."""

SIZE = (1280, 860)
"""Size of the window [px]."""

AFTER = 3.0
"""Time of the picture after the start [s]."""


def main() -> None:
    """Take the picture."""
    path = Path("docs/drive.png")
    with tempfile.TemporaryDirectory() as folder:
        recordings = RecordingsFolder(Path(folder))
        server = Server(lambda seat: FreeDriving(seat, recordings, CHOICE), port=0)
        thread = threading.Thread(target=lambda: asyncio.run(server.serve()))
        thread.start()
        try:
            take(server.url, path)
        finally:
            server.stop()
            thread.join()
    print(path)


def take(url: str, path: Path) -> None:
    """Drive in the browser for a while, and keep what it shows.

    Args:
        url: address of the page.
        path: PNG file to write.
    """
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or sys.exit("Chromium is not installed")
    for argument in ("--headless", "--no-sandbox", "--disable-gpu", f"--window-size={SIZE[0]},{SIZE[1]}"):
        options.add_argument(argument)
    browser = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    try:
        browser.get(url)
        wait(browser, "empty")
        next(button for button in browser.find_elements("tag name", "button") if button.text == "Drive").click()
        wait(browser, "ready")
        press(browser, " ")
        wait(browser, "driving")
        time.sleep(AFTER)
        press(browser, "ArrowLeft")
        time.sleep(0.3)
        browser.save_screenshot(str(path))
    finally:
        browser.quit()


def wait(browser: Any, state: str) -> None:
    """Wait until the page is in a state.

    Args:
        browser: the browser.
        state: the state.
    """
    end = time.monotonic() + 120.0
    while browser.execute_script("return window.drive && window.drive.state") != state:
        if time.monotonic() > end:
            raise TimeoutError(f"the page does not become {state!r}")
        time.sleep(0.05)


def press(browser: Any, key: str) -> None:
    """Press a key and hold it.

    Args:
        browser: the browser.
        key: name of the key.
    """
    browser.execute_script(
        "document.body.dispatchEvent(new KeyboardEvent('keydown', {key: arguments[0], bubbles: true}))", key
    )


if __name__ == "__main__":
    main()
