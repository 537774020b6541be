"""No row is lost, mixed or made up: names of any kind, damaged and foreign files, two runs at once, changed drivers."""

import os
import subprocess
import sys
import threading
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shared_control_env.controllers.scripted import OverreactingDriver, ScriptedDriver
from shared_control_env.evaluation import AUTHORITIES, DRIVERS, AuthorityEntry, DriverEntry, Suite, evaluate
from shared_control_env.evaluation import storage as storage_module
from shared_control_env.evaluation.episodes import EpisodeBatch, make_environment, settings_of
from shared_control_env.evaluation.fingerprint import fingerprint
from shared_control_env.evaluation.replay import entries_of, replay_episode
from shared_control_env.evaluation.storage import IDENTITY, ResultsFolder, read_manifest

ONE = Suite("one", ("two_lane",), (None,))
MANIFEST = {"suite": "s", "seeds": [0], "config": {}, "versions": "v", "drivers": {"d": {}}, "authorities": {"a": {}}}


class Coast:
    def reset(self, seed=None):
        pass

    def act(self, observation, scene):
        return np.zeros(2)


class Brake(Coast):
    def act(self, observation, scene):
        return np.array([-5.0, 0.0])


NAMES = ["ppo/1M", "../x", "a" * 300, "NUL\0", "CON", "Ümläut 日本", "mpc-paper", "x-", "-x", "A", "a"]


def test_names_of_any_kind_keep_their_rows(tmp_path):
    drivers = dict.fromkeys(NAMES, Coast)
    table = evaluate(drivers, "none", ONE, out=tmp_path / "out")
    assert sorted(table["driver"]) == sorted(NAMES)
    assert not table.duplicated(IDENTITY).any()
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_pairs_of_names_do_not_fall_together(tmp_path):
    table = evaluate(
        {"a-b": Coast, "a": Brake},
        {"c": AuthorityEntry("", "none"), "b-c": AuthorityEntry("", "none")},
        ONE,
        out=tmp_path,
    )
    assert len(table) == 4
    assert table.groupby("driver")["driver_effort"].nunique().eq(1).all()


def shards(path):
    return sorted((path / "episodes").glob("*.parquet"))


DAMAGES = {
    "empty": lambda content: b"",
    "cut": lambda content: content[: len(content) // 2],
    "flipped": lambda content: content[:100] + bytes([content[100] ^ 1]) + content[101:],
    "flipped late": lambda content: content[:-9] + bytes([content[-9] ^ 1]) + content[-8:],
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=list(DAMAGES))
def test_damaged_files_are_run_again(tmp_path, damage):
    whole = evaluate(["none", "scripted"], "none", ONE, out=tmp_path)
    path = shards(tmp_path)[0]
    path.write_bytes(damage(path.read_bytes()))
    told = []
    with pytest.warns(UserWarning, match="1 damaged file"):
        again = evaluate(["none", "scripted"], "none", ONE, out=tmp_path, progress=lambda *n: told.append(n))
    assert told[:2] == [(0, 2), (1, 2)]
    pd.testing.assert_frame_equal(again.drop(columns="real_time_factor"), whole.drop(columns="real_time_factor"))
    assert len(shards(tmp_path)) == 2


def test_foreign_files_are_left_out_and_named(tmp_path):
    evaluate("none", "none", ONE, out=tmp_path / "mine")
    evaluate("none", "none", ONE, seeds=[5], out=tmp_path / "other")
    own, other = shards(tmp_path / "mine")[0], shards(tmp_path / "other")[0]
    (own.parent / "mine again.parquet").write_bytes(own.read_bytes())
    (own.parent / other.name).write_bytes(other.read_bytes())
    with pytest.warns(UserWarning, match=rf"left out.*{other.name}.*mine again.parquet"):
        table = evaluate("none", "none", ONE, out=tmp_path / "mine")
    assert table["seed"].tolist() == [0]


def test_fresh_removes_results_alone(tmp_path):
    evaluate("none", "none", ONE, out=tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "episodes" / "mine.parquet").write_text("mine")
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep/thesis.tex").write_text("mine")
    with pytest.warns(UserWarning, match="mine.parquet"):
        table = evaluate("none", "none", ONE, seeds=[7], out=tmp_path, fresh=True)
    assert table["seed"].tolist() == [7]
    assert (tmp_path / "notes.txt").exists()
    assert (tmp_path / "deep/thesis.tex").exists()
    assert (tmp_path / "episodes" / "mine.parquet").exists()
    assert len(shards(tmp_path)) == 2


@pytest.mark.parametrize("text", ["", "{", "[]", "3", "null", '{"machine_info": {}}', '{"suite": 1, "drivers": []}'])
@pytest.mark.parametrize("fresh", [False, True])
def test_a_manifest_of_another_kind_is_refused(tmp_path, text, fresh):
    (tmp_path / "benchmark.json").write_text(text)
    (tmp_path / "mine").write_text("mine")
    with pytest.raises(ValueError, match="no results of a benchmark of this version"):
        evaluate("none", "none", ONE, out=tmp_path, fresh=fresh)
    assert (tmp_path / "mine").exists()
    assert (tmp_path / "benchmark.json").read_text() == text


def test_two_runs_do_not_share_a_folder(tmp_path):
    first = ResultsFolder(tmp_path, MANIFEST)
    with pytest.raises(ValueError, match="another run is writing there"):
        ResultsFolder(tmp_path, MANIFEST)
    first.close()
    ResultsFolder(tmp_path, MANIFEST).close()


def test_a_run_that_was_killed_keeps_nobody_out(tmp_path):
    code = (
        "import os, sys\nfrom pathlib import Path\nfrom shared_control_env.evaluation.storage import ResultsFolder\n"
        f"folder = ResultsFolder(Path(sys.argv[1]), {MANIFEST!r})\nos._exit(9)"
    )
    assert subprocess.run([sys.executable, "-c", code, str(tmp_path)]).returncode == 9
    (tmp_path / ".draft-benchmark.json").write_text("half")
    (tmp_path / ".draft-thesis.txt").write_text("mine")
    ResultsFolder(tmp_path, MANIFEST).close()
    assert not (tmp_path / ".draft-benchmark.json").exists()
    assert (tmp_path / ".draft-thesis.txt").exists()


def test_what_counts_is_on_the_disk(tmp_path, monkeypatch):
    order = []
    real_flush, real_replace = storage_module._flush, storage_module.Path.replace
    monkeypatch.setattr(storage_module, "_flush", lambda path: (order.append(("flush", path.name)), real_flush(path)))
    monkeypatch.setattr(
        storage_module.Path, "replace", lambda self, to: (order.append(("move", to.name)), real_replace(self, to))[1]
    )
    storage_module.write_atomically(tmp_path / "x", lambda draft: draft.write_text("whole"))
    assert order == [("flush", ".draft-x"), ("move", "x"), ("flush", tmp_path.name)]


def test_a_changed_driver_is_run_again_and_the_old_one_found_again(tmp_path):
    coasting = evaluate({"mine": Coast}, "none", ONE, out=tmp_path)
    with pytest.warns(UserWarning, match="changed since the last run.*drivers: mine"):
        braking = evaluate({"mine": Brake}, "none", ONE, out=tmp_path)
    assert len(braking) == 1
    assert braking["driver_effort"][0] > coasting["driver_effort"][0]
    told = []
    with pytest.warns(UserWarning, match="changed since"):
        again = evaluate({"mine": Coast}, "none", ONE, out=tmp_path, progress=lambda *n: told.append(n))
    assert told == [(0, 1), (1, 1)]
    pd.testing.assert_frame_equal(again, coasting)


def test_one_seed_gives_every_driver_the_same_episode():
    suite = Suite("x", ("cut_in", "bend"), ("bias_ramp", "stuck", "white_noise"))
    batches = [
        EpisodeBatch(scenario, (name, entry), ("none", AUTHORITIES["none"]), ((degradation, seed),), {})
        for scenario in suite.scenarios
        for degradation in suite.degradations
        for seed in (0, 7)
        for name, entry in DRIVERS.items()
    ]
    episodes = {}
    for batch in batches:
        env = make_environment(batch, 1)
        (degradation, seed), *_ = batch.episodes
        env.reset(seed=seed, options={"config": settings_of(batch, degradation)})
        drawn = env.episodes[0].model_dump(exclude={"driver_lag", "internal_model", "person"})
        episodes.setdefault((batch.scenario, degradation, seed), []).append(drawn)
    for same in episodes.values():
        assert len(same) == len(DRIVERS)
        assert all(episode == same[0] for episode in same)


def test_the_same_scenario_twice_is_run_once(tmp_path):
    suite = Suite("x", ("two_lane", "two_lane"), (None, None))
    assert len(evaluate("none", "none", suite)) == len(evaluate("none", "none", suite, out=tmp_path)) == 1


def test_numbers_of_numpy_in_entries():
    entry = DriverEntry(
        "",
        None,
        {"driver_lag": {"K_h": np.float32(1.1)}},
        draws=[{"setting": "driver_lag.T_h", "median": np.float64(0.2), "spread": 0.1}],
    )
    assert evaluate({"mine": entry}, "none", ONE)["K_h"][0] == pytest.approx(1.1)


def test_a_given_fingerprint_is_trusted_when_an_episode_is_replayed(tmp_path):
    evaluate({"mine": DriverEntry("", Coast, fingerprint="v1")}, "none", ONE, out=tmp_path)
    driver, *_ = entries_of(tmp_path, "mine", "none")
    assert driver.make is Coast


def test_results_of_another_version_are_replayed_with_a_word(tmp_path):
    evaluate("none", "none", ONE, out=tmp_path)
    path = tmp_path / "benchmark.json"
    path.write_text(path.read_text().replace("numba ", "numba 9."))
    with pytest.warns(UserWarning, match="numba 9"):
        entries_of(tmp_path, "none", "none")


def test_what_cannot_be_sent_to_a_process_is_said():
    with pytest.raises(RuntimeError, match="driver 'mine' or authority 'none' cannot be sent to another process"):
        evaluate({"mine": lambda: Coast()}, "none", ONE, jobs=2)


SET_OF_TEXTS = """
import sys; sys.path.insert(0, {root!r})
from shared_control_env.evaluation.fingerprint import fingerprint
class Own:
    def act(self, observation, scene):
        return observation in {{"alpha", "beta", "gamma"}}
print(fingerprint(Own))
"""


def test_fingerprints_repeat_in_other_processes():
    found = set()
    for seed in ("1", "2", "3"):
        code = SET_OF_TEXTS.format(root=str(Path(__file__).parent.parent.parent))
        result = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, "PYTHONHASHSEED": seed}
        )
        assert result.returncode == 0, result.stderr
        found.add(result.stdout)
    assert len(found) == 1


def test_fingerprints_see_defaults_and_what_inner_functions_use():
    def with_defaults(first, second):
        class Own:
            def reset(self, seed=first):
                pass

            def act(self, observation, scene=second):
                pass

        return Own

    def with_inner(gain):
        space = {"GAIN": gain, "__name__": "elsewhere"}
        exec(
            "class Own:\n    def act(self, o, s):\n        return [GAIN * e for e in o] + list(map(lambda e: GAIN, o))",
            space,
        )
        return space["Own"]

    torch = pytest.importorskip("torch")
    variants = [with_defaults(1, 2), with_defaults(1, 3), with_defaults(2, 2), with_inner(1.0), with_inner(2.0)]
    variants += [partial(Needs, torch.tensor([1.0])), partial(Needs, torch.tensor([2.0]))]
    variants += [partial(Needs, pd.DataFrame({"a": [1]})), partial(Needs, pd.DataFrame({"a": [2]}))]
    assert len({fingerprint(each) for each in variants}) == len(variants)


def made_like(body, helper=1.0):
    space = {"np": np, "HELPER": helper, "__name__": "elsewhere"}
    exec(
        "class Own:\n    def reset(self, seed=None):\n        pass\n    def act(self, observation, scene):\n        "
        + body
        + "\ndef scale():\n    return HELPER\n",
        space,
    )
    return space["Own"]


def test_fingerprints_tell_code_constants_helpers_and_arguments_apart():
    same = made_like("return np.array([HELPER, 0.0])"), made_like("return np.array([HELPER, 0.0])  # a comment")
    assert fingerprint(same[0]) == fingerprint(same[1])
    others = [
        made_like("return np.array([HELPER, 0.1])"),
        made_like("return np.array([HELPER, 0.0])", helper=2.0),
        made_like("return np.array([scale(), 0.0])"),
        made_like("return np.array([scale(), 0.0])", helper=2.0),
        partial(OverreactingDriver, 2.0),
        partial(OverreactingDriver, 3.0),
        partial(OverreactingDriver, excess=3.0),
        ScriptedDriver,
        Coast,
        Brake,
        lambda: Brake(),
    ]
    assert len({fingerprint(each) for each in (same[0], *others)}) == len(others) + 1


def test_what_cannot_be_told_needs_a_fingerprint(tmp_path):
    drivers = {"mine": partial(Keeps, threading.Lock())}
    with pytest.raises(ValueError, match="give a fingerprint"):
        evaluate(drivers, "none", ONE, out=tmp_path)
    entry = DriverEntry("keeps a file", drivers["mine"], fingerprint="1")
    assert len(evaluate({"mine": entry}, "none", ONE, out=tmp_path)) == 1
    with pytest.warns(UserWarning, match="changed since"):
        evaluate({"mine": entry._replace(fingerprint="2")}, "none", ONE, out=tmp_path)


class Keeps(Coast):
    def __init__(self, file):
        self.file = file


FAULTS = [{"channel": "acceleration", "onset": 0.5, "size": 5.0}]


def test_an_episode_is_replayed_as_it_was(tmp_path, monkeypatch):
    config = {"faults": FAULTS, "duration": 4.0}
    drivers = {"coast": Coast, "local": lambda: Coast()}
    table = evaluate({**drivers}, "none", "paper", config=config, out=tmp_path / "run", seeds=[3])
    assert table["terminated"].any()
    failed = table[table["terminated"] & (table["driver"] == "coast")].iloc[0]
    report = (tmp_path / "run/report.html").read_text()
    assert f"--from {tmp_path / 'run'}" in report
    assert "in the program that has the driver" in report
    driver, authority, found, _ = entries_of(tmp_path / "run", "coast", "none")
    again = replay_episode(failed["scenario"], ("coast", driver), ("none", authority), None, 3, config=found)
    for name in ("lateral_rms", "driver_effort", "collisions", "min_ttc"):
        np.testing.assert_equal(again[name], failed[name])
    with pytest.raises(ValueError, match="cannot be imported; replay"):
        entries_of(tmp_path / "run", "local", "none")
    monkeypatch.setattr(Coast, "act", lambda self, observation, scene: np.ones(2))
    with pytest.raises(ValueError, match="has changed since"):
        entries_of(tmp_path / "run", "coast", "none")


def test_the_manifest_says_what_the_drivers_are(tmp_path):
    evaluate(
        {"mine": Coast, "lagged": DriverEntry("", config={"driver_lag": {"K_h": 0.9}})}, "fixed", ONE, out=tmp_path
    )
    manifest = read_manifest(tmp_path)
    assert manifest["drivers"]["mine"]["origin"] == f"{__name__}:Coast"
    assert manifest["drivers"]["lagged"]["config"] == {"driver_lag": {"K_h": 0.9}}
    assert manifest["authorities"]["fixed"] == {"origin": "catalogue", "fingerprint": None, "law": "proportional"}


CLASHES = [
    ({"driver": "none"}, {"driver_lag": {"K_h": 1.0}}, "'driver_lag.K_h', which the driver 'none' sets to 0.0"),
    ({"driver": ["mpc_1", "mpc_2"]}, {"driver_lag": {"T_h": 0.3}}, "the driver 'mpc_1' sets"),
    ({"driver": "none"}, {"randomise": [{"setting": "driver_lag.K_h", "low": 0.5, "high": 1.0}]}, "'driver_lag.K_h'"),
    ({"authority": "paper"}, {"authority": {"law": "none"}}, "the authority 'paper' sets"),
    ({"suite": "full"}, {"degradations": ["stuck"]}, "'degradations', which the suite sets"),
]


@pytest.mark.parametrize(("arguments", "config", "message"), CLASHES)
def test_what_makes_an_entry_what_it_is_cannot_be_changed(arguments, config, message):
    with pytest.raises(ValueError, match=message):
        evaluate(**arguments, config=config)


def test_what_agrees_with_an_entry_is_taken():
    assert len(evaluate("none", "paper", ONE, config={"driver_lag": {"K_h": 0.0}, "authority": {"law": "paper"}})) == 1
    assert evaluate("mpc", "none", ONE, config={"driver_lag": {"K_h": 0.0}})["driver_effort"][0] == 0.0


class Needs(Coast):
    def __init__(self, needed):
        self.needed = needed


class NoSeed(Coast):
    def reset(self):
        pass


class Allocates:
    def reset(self, seed=None):
        pass

    def allocate(self, scene, signals):
        return "much"


WRONG = {
    "an instance of a driver": ({"driver": {"mine": Coast()}}, "driver 'mine'.*such as a class, not one itself"),
    "an instance of an allocator": ({"authority": {"mine": Allocates()}}, "authority 'mine'.*such as a class"),
    "what makes no driver": ({"driver": {"mine": dict}}, r"driver 'mine'.*reset\(seed\) and act"),
    "no drivers": ({"driver": []}, r"driver = \[\] names nothing"),
    "no driver at all": ({"driver": None}, "driver = None must be"),
    "an empty name": ({"driver": {"": Coast}}, "text that is not empty"),
    "a number as a name": ({"driver": {3: Coast}}, "driver = 3 must be a name"),
    "an unknown law": ({"authority": {"mine": AuthorityEntry("", "papr")}}, "law = 'papr'; did you mean 'paper'"),
    "one seed": ({"seeds": 3}, r"seeds = 3 must be several integers, such as range\(10\)"),
    "no seeds": ({"seeds": []}, "seeds is empty"),
    "a seed below 0": ({"seeds": [-1]}, "seeds: an entry = -1"),
    "a seed beyond a column": ({"seeds": [2**70]}, "must be an integer in"),
    "too many seeds": ({"seeds": range(10**9)}, "largest number"),
    "jobs of None": ({"jobs": None}, "jobs = None must be an integer"),
    "a suite of an unknown scenario": ({"suite": Suite("x", ("two_lan",), (None,))}, "did you mean 'two_lane'"),
    "a suite of an unknown degradation": ({"suite": Suite("x", ("bend",), ("stuk",))}, "did you mean 'stuck'"),
    "an empty suite": ({"suite": Suite("x", (), (None,))}, "tuple of names, not empty"),
    "a suite without degradations": ({"suite": Suite("x", ("bend",), ())}, "tuple of names, not empty"),
    "a suite of a text": ({"suite": Suite("x", "bend", (None,))}, "tuple of names, not empty"),
    "all suites": ({"suite": "all"}, "suite = 'all' must be one name"),
    "several suites": ({"suite": ["paper", "full"]}, "must be one name"),
    "all engines": ({"engine": "all"}, "engine = 'all' must be one name"),
    "nobody": ({"driver": {"mine": None}}, "driver 'mine' is None"),
    "an entry by itself": ({"driver": DriverEntry("mine", Coast)}, "driver"),
    "draws of another kind": ({"driver": {"mine": DriverEntry("", Coast, draws=3)}}, "'mine' has draws = 3"),
    "draws in the config": ({"driver": {"mine": DriverEntry("", Coast, {"randomise": []})}}, "what is drawn in draws"),
    "a class that needs arguments": ({"driver": {"mine": Needs}}, "driver 'mine'.*gave an error, TypeError"),
    "a reset without a seed": ({"driver": {"mine": NoSeed}}, "driver 'mine': its reset must take a seed"),
    "a driver with another law": (
        {"driver": {"mine": DriverEntry("", Coast, {"authority": {"law": "paper"}})}},
        "'mine' changes 'authority.law', which the authority 'none' sets to 'none'",
    ),
    "a person who does not drive": (
        {"driver": {"mine": Coast}, "config": {"person": {"active": True}}},
        "would not act",
    ),
    "half a character": ({"driver": {"\ud800": Coast}}, "must be a name"),
    "fresh as a text": ({"fresh": "no"}, "fresh = 'no' must be True or False"),
    "randomise of None": ({"config": {"randomise": None}}, "randomise"),
    "a config that is none": ({"config": 3}, "config = 3 must be a dict"),
    "a setting that is none": ({"config": {"duratoin": 3.0}}, "did you mean 'duration'"),
    "what the kernel does not know": (
        {"config": {"vehicles": [], "other_vehicles_type": "highway_env.vehicle.behavior.IDMVehicle"}},
        "not in the kernel",
    ),
    "jobs as a text": ({"jobs": "2"}, "jobs = .2."),
}


@pytest.mark.parametrize(("arguments", "message"), WRONG.values(), ids=list(WRONG))
def test_wrong_kinds_are_refused_by_name(arguments, message, tmp_path):
    with pytest.raises((ValueError, TypeError), match=message):
        evaluate(**{"driver": "none", "authority": "none", "out": tmp_path / "out", **arguments})
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("value", [None, [np.nan, 0.0], [1.0], "left"])
def test_a_drivers_answer_is_checked_with_its_name(value):
    class Odd(Coast):
        def act(self, observation, scene):
            return value

    with pytest.raises(ValueError, match=r"driver 'mine': act\(\) gave"):
        evaluate({"mine": Odd}, "paper", ONE)
    with pytest.raises(ValueError, match=r"authority 'mine': allocate\(\) gave 'much'"):
        evaluate("none", {"mine": Allocates}, ONE)


def test_paths_of_all_kinds(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    evaluate("none", "none", ONE, out="~/res")
    assert (tmp_path / "res/benchmark.json").exists()
    assert not (tmp_path / "~").exists()
    (tmp_path / "file").write_text("mine")
    for path in (tmp_path / "file", tmp_path / "file/below"):
        with pytest.raises(ValueError, match=r"is a file|cannot be written"):
            evaluate("none", "none", ONE, out=path)
