"""The report, read by Chromium as a reader would."""

import re
import shlex
import xml.etree.ElementTree as ET
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest

from shared_control_env.evaluation.report import gallery, rows_of, write_report

NAUGHTY = "<script>document.title='broken in'</script>"


class Metric(NamedTuple):
    unit: str
    better: str
    definition: str


METRICS = {
    "collisions": Metric("-", "lower", "1 if so."),
    "lateral_rms": Metric("m", "lower", f"Error. {NAUGHTY}"),
    "min_ttc": Metric("s", "higher", "Time."),
    "authority_min": Metric("-", "neither", "Least."),
    "time_to_detect": Metric("s", "lower", "Not defined for some."),
    "never": Metric("s", "lower", "Not defined in any episode."),
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
            "authority_min": level,
            "time_to_detect": np.nan if authority == "linear" else level,
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


@pytest.fixture
def keys():
    return pytest.importorskip("selenium.webdriver.common.keys").Keys


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


def test_the_file_refers_to_nothing_outside(report):
    text = report.read_text()
    assert not re.findall(r"""(?:src|href|url\(|@import)\W{0,3}(?:https?:)?//""", text)
    assert set(re.findall(r"https?://[^\"'<> ]+", text)) == {
        "http://www.w3.org/2000/svg",
        "http://www.w3.org/1999/xlink",
    }
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'(?:url\(|href=")#([^)"]+)', text)) <= set(ids)


def test_plots_are_whole_and_show_names(report):
    pictures = re.findall(r"<svg.*?</svg>", report.read_text(), re.DOTALL)
    shown = ["".join(ET.fromstring(picture).itertext()) for picture in pictures]
    assert len(shown) == 3
    assert all(authority in text for text in shown for authority in AUTHORITIES)


def test_names_are_shown_and_not_run(page):
    assert page.title == "Shared control under automation degradation: benchmark"
    assert any(NAUGHTY in name for name in column(page, 1))
    assert NAUGHTY in page.find_element("tag name", "dl").text
    assert NAUGHTY in head(page, "lateral_rms")[0].get_attribute("title")


def test_heads_say_what_the_metric_is(page):
    assert head(page, "min_ttc")[0].get_attribute("title") == "Time. Unit: s. Higher is better."
    assert head(page, "authority_min")[0].get_attribute("title").endswith("Neither direction is better.")


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


def test_heads_can_be_used_by_keyboard(page, keys):
    found, index = head(page, "lateral_rms")
    found.find_element("tag name", "button").send_keys(keys.ENTER)
    assert found.get_attribute("aria-sort") == "ascending"
    assert page.execute_script("return getComputedStyle(document.activeElement).outlineStyle") == "solid"


def test_undefined_values_come_last_either_way(page):
    found, index = head(page, "time_to_detect")
    for shown in (["0.1", "0.1", "0.4", "0.4", "–", "–"], ["0.4", "0.4", "0.1", "0.1", "–", "–"]):
        found.find_element("tag name", "button").click()
        assert column(page, index) == shown


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


def wait_until_copied(page, button):
    """The clipboard answers after the click has returned."""
    from selenium.webdriver.support.ui import WebDriverWait

    WebDriverWait(page, 10).until(lambda _: button.text == "copied")


def test_failures_have_their_command(page):
    commands = [code.text for code in page.find_elements("css selector", "td code")]
    assert (
        "shared-control replay --scenario bend --degradation stuck --driver mpc --authority paper --seed 0" in commands
    )
    button = page.find_element("css selector", ".copy")
    page.execute_script("arguments[0].scrollIntoView({block: 'center'})", button)
    button.click()
    wait_until_copied(page, button)


def test_the_command_that_is_copied_is_the_one_shown(page):
    button = page.find_element("css selector", ".copy")
    page.execute_script(
        "Object.defineProperty(navigator, 'clipboard', {value: {writeText: async text => { window.copied = text; }}})"
    )
    page.execute_script("arguments[0].scrollIntoView({block: 'center'})", button)
    button.click()
    row = button.find_element("xpath", "ancestor::tr")
    wait_until_copied(page, button)
    assert page.execute_script("return window.copied") == row.find_element("tag name", "code").text


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
    rows = {(row.authority, row.driver): row for row in rows_of(episodes(), METRICS)}
    table = episodes()
    for (authority, driver), part in table.groupby(["authority", "driver"]):
        cell = rows[authority, driver].cells["lateral_rms"]["mean"]
        assert cell.interval.estimate == pytest.approx(part["lateral_rms"].mean())
        assert cell.interval.low < cell.interval.estimate < cell.interval.high
        assert rows[authority, driver].cells["min_ttc"]["mean"].interval.n == 8
        assert rows[authority, driver].cells["never"]["mean"].interval.n == 0
    assert rows["paper", "mpc"].cells["lateral_rms"]["mean"].best
    assert not rows["linear", "mpc"].cells["lateral_rms"]["mean"].tied


def test_one_seed_marks_nothing_as_distinguishable():
    rows = rows_of(episodes().query("seed == 1"), METRICS)
    assert all(row.cells["lateral_rms"]["mean"].tied for row in rows)


def test_no_best_where_all_are_the_same_or_neither_direction_is_better():
    rows = rows_of(episodes().assign(lateral_rms=0.5), METRICS)
    assert not any(row.cells[name]["mean"].best for row in rows for name in ("lateral_rms", "authority_min", "never"))
    assert any(row.cells["min_ttc"]["mean"].best for row in rows)


def test_gallery_is_spread_and_short():
    shown = gallery(episodes())
    assert len(shown) == 12
    assert {failure["authority"] for failure in shown} == set(AUTHORITIES)
    assert all(failure["degradation"] == "stuck" and failure["what"] == "collision" for failure in shown)
    many = pd.concat([episodes().assign(authority=f"a{i}") for i in range(5)])
    shown = pd.DataFrame(gallery(many))
    assert len(shown) == 20
    assert shown["authority"].value_counts().tolist() == [4] * 5
    assert shown["driver"].value_counts().tolist() == shown["scenario"].value_counts().tolist() == [10] * 2


def test_gallery_begins_with_the_worst():
    table = episodes().assign(terminated=True, collisions=0.0, duration=5.0)
    table.loc[[7, 30], "collisions"] = 1.0
    table.loc[30, "duration"] = 1.5
    worst = gallery(table)[0]
    assert [worst[name] for name in ("scenario", "authority", "seed")] == [
        table.loc[30, name] for name in ("scenario", "authority", "seed")
    ]


@pytest.mark.parametrize("name", ["my driver", "$(reboot)", "a; b", "it's", NAUGHTY])
def test_commands_are_safe_to_paste(name):
    command = gallery(episodes().assign(driver=name))[0]["command"]
    words = shlex.split(command)
    assert words[:2] == ["shared-control", "replay"]
    assert words[2::2] == ["--scenario", "--degradation", "--driver", "--authority", "--seed"]
    assert words[7] == name


def test_same_table_same_bytes(report, tmp_path):
    again = tmp_path / "report.html"
    write_report(episodes(), METRICS, again, {"suite": "small", "seeds": [0, 1, 2, 3], "note": NAUGHTY})
    assert again.read_bytes() == report.read_bytes()


@pytest.mark.parametrize("table", [episodes().iloc[:0], pd.DataFrame()], ids=["no rows", "no columns"])
def test_no_episodes(tmp_path, table):
    write_report(table, METRICS, tmp_path / "empty.html", {})
    assert "There are no episodes yet" in (tmp_path / "empty.html").read_text()


@pytest.mark.parametrize(
    "table",
    [
        episodes().iloc[:1],
        episodes().query("authority == 'paper' and driver == 'mpc'"),
        episodes().query("authority == 'paper' and driver == 'mpc' or authority == 'linear' and driver == 'scripted'"),
        episodes().assign(**dict.fromkeys(METRICS, np.nan)),
        episodes().assign(lateral_rms=np.inf),
        episodes().assign(authority="$\\bad{$", driver="_hidden"),
    ],
    ids=["one episode", "one pair", "not every pair", "nothing defined", "infinite", "odd names"],
)
def test_tables_of_all_kinds(tmp_path, table):
    write_report(table, METRICS, tmp_path / "report.html", {})
    assert (tmp_path / "report.html").read_text().count("<svg") == 3


def test_metrics_without_a_plot(tmp_path):
    """The plots' metrics are looked for among the metrics given, not among the table's columns."""
    write_report(episodes(), {"min_ttc": METRICS["min_ttc"]}, tmp_path / "report.html", {})
    assert (tmp_path / "report.html").read_text().count("<svg") == 1


def test_no_failures(tmp_path):
    write_report(episodes().assign(terminated=False), METRICS, tmp_path / "healthy.html", {})
    assert "No episode ended in a collision" in (tmp_path / "healthy.html").read_text()


def test_what_was_there_stays_when_writing_fails(report, tmp_path, monkeypatch):
    path = tmp_path / "report.html"
    path.write_text("before")

    def full(*_, **__):
        raise OSError("disk full")

    monkeypatch.setattr("pathlib.Path.replace", full)
    with pytest.raises(OSError, match="disk full"):
        write_report(episodes(), METRICS, path, {})
    assert path.read_text() == "before"
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]
