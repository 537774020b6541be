"""The studies: what is measured, against a drift computed by hand, and a page whose numbers come from its run."""

import numpy as np
import pytest
from typer.testing import CliRunner

from experiments import studies
from shared_control_env.core.parameters import PERSONS

QUICK = studies.Condition("paula", "hands_on", 22.2, 300.0, (1.18, 1.74))


def test_a_car_that_nobody_steers_is_over_the_line_when_the_drift_says_so(monkeypatch):
    """Hands off for 30 s: the time of the parabola, but for the yaw that dies out first. Nobody counts as acting."""
    monkeypatch.setitem(PERSONS, "hands_off", PERSONS["hands_off"]._replace(response=30.0, response_spread=0.0))
    condition = QUICK._replace(person="hands_off")
    table = studies.simulate(condition, 4)
    assert table["reaction"].isna().all()
    assert condition.drift == pytest.approx(np.sqrt(2.0 * 0.825 * 300.0) / 22.2)
    assert (table["crossed"] > 0.9 * condition.drift).all()
    assert (table["crossed"] < condition.drift + 0.5).all()


def test_who_acts_acts_after_noticing_and_less_late_on_the_wheel():
    tables = {
        name: studies.simulate(QUICK._replace(person=name, radius=1000.0), 40) for name in ("hands_on", "hands_off")
    }
    times = {name: table["reaction"].mean() for name, table in tables.items()}
    assert 0.5 < times["hands_on"] < times["hands_off"]
    for table in tables.values():
        assert table["reaction"].notna().mean() > 0.9  # the road is wide enough to act on
        assert table["reaction"].min() > 0.3  # nobody acts before having noticed
    again = studies.simulate(QUICK._replace(radius=1000.0), 40)
    np.testing.assert_array_equal(again["reaction"], tables["hands_on"]["reaction"])


def test_shares_and_means_are_those_of_the_table():
    table = studies.pd.DataFrame(
        {"reaction": [1.0, 2.0, np.nan, 3.0], "crossed": [np.nan, 1.5, 1.0, 4.0], "largest": [0.1, 1.0, 2.0, 1.0]}
    )
    outcome = studies.summarise(QUICK, table)
    assert outcome.reaction[0] == 2.0
    assert 1.0 <= outcome.reaction[1] < 2.0 < outcome.reaction[2] <= 3.0
    assert outcome.acted[0] == 0.5
    assert outcome.kept[0] == 0.25
    assert 0.0 < outcome.kept[1] < 0.25 < outcome.kept[2] < 0.8
    nobody = studies.summarise(QUICK, table.assign(reaction=np.nan))
    assert np.isnan(nobody.reaction).all()
    assert nobody.acted[0] == 0.0


def test_the_page_has_the_numbers_of_its_run(tmp_path):
    result = CliRunner().invoke(studies_app(), ["--people", "12", "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    page = (tmp_path / "studies.md").read_text()
    assert "with 12 persons" in page
    assert page.count("| `hands_on` |") == page.count("| `hands_off` |") == 6
    outcome = studies.summarise(studies.CONDITIONS[0], studies.simulate(studies.CONDITIONS[0], 12))
    assert f"| 3 | `hands_on` | {outcome.acting} of 12 | 3.7 | " in page
    assert "| 3.7 | {:.1f} ({:.1f} to {:.1f}) | 100 |".format(*outcome.reaction) in page
    assert (tmp_path / "studies.png").stat().st_size > 20_000


def studies_app():
    app = studies.typer.Typer()
    app.command()(studies.main)
    return app
