"""The policies that ship are those that their card is about."""

import json
import re

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the extra 'train'")

from rich.console import Console

from agents import train
from agents.tasks import TASKS
from experiments import policies
from shared_control_env.learned.policy import Policy
from shared_control_env.learned.shipped import POLICIES, shipped


def test_a_small_run_is_published(tmp_path, monkeypatch):
    small = {"environments": 8, "segment": 128, "half_life": 1000, "learning_rate": 1e-3, "n_steps": 16}
    small |= {"batch_size": 64, "policy_kwargs": {"net_arch": [16]}}
    monkeypatch.setattr(train, "hyperparameters", lambda algorithm, ids: dict(small))
    monkeypatch.setattr(train, "VALIDATION_EPISODES", 4)
    for name, value in (
        ("FOLDER", tmp_path / "trainings"),
        ("POLICIES", tmp_path / "shipped"),
        ("IDS", ["SharedControl/Bend-v1", "SharedControl/Bend-v1"]),
        ("SCENARIOS", ("bend",)),
        ("SEEDS", range(2)),
    ):
        monkeypatch.setattr(policies, name, value)
    for task in TASKS:
        for seed in policies.SEEDS:
            policies.train(task, seed, 200)
    policies.publish(1, 1, Console(quiet=True))
    card = (tmp_path / "shipped/README.md").read_text()
    for task in TASKS:
        states = [policies.state_of(task, seed) for seed in policies.SEEDS]
        assert [state["steps"] for state in states] == [256, 256]
        for seed in policies.SEEDS:
            best = Policy.load(tmp_path / f"shipped/{task}-{seed}.npz")
            assert best.card["score"] == max(score for _, score in states[seed]["scores"])
        table = policies.pd.read_parquet(tmp_path / f"trainings/{task}.parquet")
        held_out = table[(table["kind"] == "left out of training") & table["name"].str.startswith("learned")]
        row = next(line for line in card.splitlines() if line.startswith("| left out of training | learned |"))
        if task == "driver":
            assert float(row.split("|")[3].split("[")[0]) == pytest.approx(held_out["lateral_rms"].mean(), rel=1e-2)
    assert "256 steps each" in card
    assert (tmp_path / "shipped/curves.png").stat().st_size > 10_000


def test_what_ships_is_what_its_card_says():
    card = (POLICIES / "README.md").read_text()
    (seeds,) = re.findall(r"with the seeds ([\d, ]+);", card)
    for task in TASKS:
        cards = [Policy.load(path).card for path in shipped(task).values()]
        assert [each["seed"] for each in cards] == [int(seed) for seed in seeds.split(",")]
        for each in cards:
            assert each["task"] == task
            assert ",".join(each["environments"]) in card
            assert each["versions"] in card
            weights = {id: config["reward"] for id, config in each["config"].items()}
            assert all(given == json.loads(json.dumps(TASKS[task].reward)) for given in weights.values())
            assert np.isfinite(each["score"])
