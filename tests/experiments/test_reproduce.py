import json

import pandas as pd
import pytest
import typer

from experiments import reproduce
from experiments.case_runs import all_runs


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    out = tmp_path_factory.mktemp("results") / "paper"
    reproduce.main(out=out, fresh=False)
    return out


def test_writes_everything(results):
    names = {path.name for path in results.iterdir()}
    pictures = {f"case{case}_{kind}.png" for case in (1, 2) for kind in ("path", "risk", "commands")}
    pictures |= {"memberships.png", "authority_surface.png", "dpf_surface.png"}
    assert pictures <= names
    assert {"case1.mp4", "case2.mp4", "signals.parquet", "claims.md", "claims.json"} <= names
    signals = pd.read_parquet(results / "signals.parquet")
    assert signals.groupby(["case", "law", "preset", "driver"]).ngroups == len(all_runs())
    assert json.loads((results / "claims.json").read_text())["provenance"]["seed"] == 0
    assert not list(results.rglob(".draft-*"))


def test_goes_on_where_it_was_stopped(results, monkeypatch):
    first = results / "runs" / f"{all_runs()[0].name}.parquet"
    first.unlink()
    (results / "case1_risk.png").unlink()
    simulated = []
    simulate = reproduce.simulate
    monkeypatch.setattr(reproduce, "simulate", lambda run: simulated.append(run) or simulate(run))
    monkeypatch.setattr(reproduce.video, "record", lambda *a, **k: pytest.fail("the videos are there already"))
    reproduce.main(out=results, fresh=False)
    assert simulated == [all_runs()[0]]
    assert (results / "case1_risk.png").is_file()


def test_results_repeat_to_the_byte(results):
    path = results / "runs" / f"{all_runs()[3].name}.parquet"
    before = pd.read_parquet(path)
    path.unlink()
    again = reproduce.load_or_simulate(all_runs()[3], results / "runs")
    pd.testing.assert_frame_equal(before, again, check_exact=True)


def test_refuses_what_it_did_not_write(tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(typer.BadParameter, match="no results of this command"):
        reproduce.prepare(tmp_path, fresh=False)
    reproduce_fresh = tmp_path / "thesis.tex"
    with pytest.raises(typer.BadParameter, match="no results of this command"):
        reproduce.prepare(tmp_path, fresh=True)
    assert reproduce_fresh.read_text() == "mine"


def test_refuses_results_of_other_sources(tmp_path):
    (tmp_path / reproduce.STAMP).write_text("0" * 64)
    with pytest.raises(typer.BadParameter, match="--fresh"):
        reproduce.prepare(tmp_path, fresh=False)
    reproduce.prepare(tmp_path, fresh=True)
    assert (tmp_path / reproduce.STAMP).read_text().strip() == reproduce.fingerprint()
