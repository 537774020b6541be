"""The report, read by Chromium as a reader would."""

import shutil

import numpy as np
import pandas as pd
import pytest

from shared_control_env.evaluation.metrics import Metric
from shared_control_env.evaluation.report import gallery, summarise, write_report

NAUGHTY = "<script>document.title='broken in'</script>"
METRICS = {
    "collisions": Metric("-", "lower", "1 if so.", lambda t: 0.0),
    "lateral_rms": Metric("m", "lower", f"Error. {NAUGHTY}", lambda t: 0.0),
    "min_ttc": Metric("s", "higher", "Time.", lambda t: 0.0),
    "never": Metric("s", "lower", "Not defined in any episode.", lambda t: 0.0),
}
AUTHORITIES = {"paper": 0.1, "linear": 0.2, NAUGHTY: 0.4}


def episodes():
    rng = np.random.default_rng(0)
    rows = [
        {
            "scenario": scenario,
            "degradation": degradation,
            "driver": driver,
            "authority": authority,
            "seed": seed,
            "terminated": bool(seed == 0 and degradation == "stuck"),
            "duration": 3.25,
            "collisions": float(seed == 0 and degradation == "stuck"),
            "lateral_rms": level + 0.01 * rng.normal() + (0.05 if driver == "scripted" else 0.0),
            "min_ttc": np.nan if scenario == "bend" else 5.0 - level,
            "never": np.nan,
        }
        for scenario in ("bend", "cut_in")
        for degradation in ("none", "stuck")
        for driver in ("mpc", "scripted")
        for authority, level in AUTHORITIES.items()
        for seed in range(4)
    ]
    return pd.DataFrame(rows)


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(episodes(), METRICS, path, {"suite": "small", "seeds": [0, 1, 2, 3], "note": NAUGHTY})
    return path


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    if not shutil.which("chromium") or not shutil.which("chromedriver"):
        pytest.skip("needs Chromium and ChromeDriver (Debian's packages chromium and chromium-driver)")
    webdriver = pytest.importorskip("selenium.webdriver", reason="needs selenium, of the extra 'dev'")
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for argument in (
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-quic",
        "--no-first-run",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        f"--user-data-dir={tmp_path_factory.mktemp('profile')}",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    chrome = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    yield chrome
    chrome.quit()


@pytest.fixture
def page(browser, report):
    browser.get(report.as_uri())
    return browser


def column(page, index):
    """Numbers of a column as they are shown, from the top."""
    cells = page.find_elements("css selector", f"#pairs tbody tr > :nth-child({index})")
    return [cell.text.split("\n")[0] for cell in cells]


def head(page, name):
    heads = page.find_elements("css selector", "#pairs thead th")
    (found,) = [h for h in heads if h.text.split("\n")[0].rstrip(" ▲▼") == name]
    return found, heads.index(found) + 1


def test_nothing_is_loaded_from_elsewhere_and_nothing_goes_wrong(page):
    assert not page.get_log("browser")
    requests = [
        entry["message"] for entry in page.get_log("performance") if "Network.requestWillBeSent" in entry["message"]
    ]
    assert not [message for message in requests if '"url":"http' in message]


def test_names_are_shown_and_not_run(page):
    assert page.title == "Shared control under automation degradation: benchmark"
    assert any(NAUGHTY in name for name in column(page, 1))
    assert NAUGHTY in page.find_element("tag name", "dl").text


def test_a_click_sorts_and_another_reverses(page):
    found, index = head(page, "lateral_rms")
    found.find_element("tag name", "button").click()
    values = [float(text) for text in column(page, index)]
    assert values == sorted(values)
    assert found.get_attribute("aria-sort") == "ascending"
    found.find_element("tag name", "button").click()
    assert [float(text) for text in column(page, index)] == sorted(values, reverse=True)
    assert found.get_attribute("aria-sort") == "descending"
    other, _ = head(page, "authority, driver")
    other.find_element("tag name", "button").click()
    assert found.get_attribute("aria-sort") == "none"
    assert column(page, 1) == sorted(column(page, 1), key=str.lower)


def test_the_statistic_can_be_chosen(page):
    _, index = head(page, "lateral_rms")
    means = column(page, index)
    page.find_element("css selector", "#statistic option:nth-child(2)").click()
    iqms = column(page, index)
    assert len(iqms) == len(means) == 6
    assert iqms != means


def test_the_best_is_marked(page):
    _, index = head(page, "lateral_rms")
    best = page.find_elements("css selector", f"#pairs tbody td:nth-child({index}) .is-mean.best")
    assert len(best) == 1
    row = best[0].find_element("xpath", "ancestor::tr")
    assert row.find_element("tag name", "th").text == "paper, mpc"


def test_failures_have_their_command(page):
    commands = [code.text for code in page.find_elements("css selector", "td code")]
    assert (
        "shared-control replay --scenario bend --degradation stuck --driver mpc --authority paper --seed 0" in commands
    )
    button = page.find_element("css selector", ".copy")
    page.execute_script("arguments[0].scrollIntoView({block: 'center'})", button)
    button.click()
    assert button.text == "copied"


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 1200])
def test_it_fits_the_screen(page, width, scheme):
    page.execute_cdp_cmd(
        "Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
    )
    size = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": width < 500}
    page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    assert page.execute_script("return document.documentElement.scrollWidth") <= width
    background = page.execute_script("return getComputedStyle(document.body).backgroundColor")
    assert (background == "rgb(255, 255, 255)") == (scheme == "light")
    page.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_summary_has_the_numbers():
    rows = {(row.authority, row.driver): row for row in summarise(episodes(), METRICS)}
    table = episodes()
    for (authority, driver), part in table.groupby(["authority", "driver"]):
        cell = rows[authority, driver].cells["lateral_rms"]["mean"]
        assert cell.interval.estimate == pytest.approx(part["lateral_rms"].mean())
        assert cell.interval.low < cell.interval.estimate < cell.interval.high
        assert rows[authority, driver].cells["min_ttc"]["mean"].interval.n == 8
        assert rows[authority, driver].cells["never"]["mean"].interval.n == 0
    assert rows["paper", "mpc"].cells["lateral_rms"]["mean"].best
    assert not rows["linear", "mpc"].cells["lateral_rms"]["mean"].tied


def test_gallery_is_spread_and_short():
    shown = gallery(episodes())
    assert {failure["authority"] for failure in shown} == set(AUTHORITIES)
    assert all(failure["degradation"] == "stuck" and failure["what"] == "collision" for failure in shown)
    assert len(gallery(pd.concat([episodes().assign(authority=f"a{i}") for i in range(40)]))) == 20


def test_same_table_same_bytes(report, tmp_path):
    again = tmp_path / "report.html"
    write_report(episodes(), METRICS, again, {"suite": "small", "seeds": [0, 1, 2, 3], "note": NAUGHTY})
    assert again.read_bytes() == report.read_bytes()


def test_edges(tmp_path):
    write_report(episodes().iloc[:0], METRICS, tmp_path / "empty.html", {})
    assert "There are no episodes yet" in (tmp_path / "empty.html").read_text()
    write_report(episodes().iloc[:1], METRICS, tmp_path / "one.html", {})
    healthy = episodes().assign(terminated=False)
    write_report(healthy, METRICS, tmp_path / "healthy.html", {})
    assert "No episode ended in a collision" in (tmp_path / "healthy.html").read_text()
