"""The table of trained drivers beside the others."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the extra 'train'")

from agents.evaluate import COMPARED, LEARNED, METRICS, compared, measure
from agents.history import HISTORY
from agents.policy import Policy
from agents.tasks import HELD_OUT_SEED


def idle_policy(bias):
    """A policy that always gives the same small command."""
    layers = [(np.zeros((2, 25 * HISTORY)), np.array([0.0, bias]))]
    return Policy(layers, "tanh", False, -1.0, 1.0, {})


def test_table():
    table = measure([idle_policy(0.0), idle_policy(0.02)], ("bend",), 2)
    assert table["seed"].min() >= HELD_OUT_SEED
    assert set(table["kind"]) == {"left out of training", "seen in training"}
    values = compared(table)
    assert {driver for _, driver in values} == {LEARNED, *COMPARED}
    for (kind, driver), row in values.items():
        part = table[(table["kind"] == kind) & table["driver"].str.startswith(driver)]
        for name in METRICS:
            assert row[name].estimate == pytest.approx(part[name].mean())
        assert row["lateral_rms"].n == (2 if driver == LEARNED else len(part))
