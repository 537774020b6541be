"""The benchmark with an automation of the user's own, whose episodes run one by one."""

import numpy as np
import pytest

from shared_control_env.controllers import Solution
from shared_control_env.evaluation import DriverEntry, Suite, evaluate, metric
from shared_control_env.evaluation.catalogue import DRIVERS, chosen_drivers
from shared_control_env.evaluation.metrics import IDENTITY, METRICS
from shared_control_env.evaluation.runner import _described

ONE = Suite("one", ("two_lane",), ("none",))
PERSON = {"person": {"active": True, "engaged": False}}


class Cruise:
    def reset(self):
        pass

    def act(self, scene):
        z = scene["z"]
        command = np.array([0.5 * (scene["v_target"] - z[3]), -0.1 * (z[1] - scene["y_target"]) - z[2]])
        return Solution(command, found=True, status=0, iterations=0, primal_residual=0.0, dual_residual=0.0, time=0.0)


class Meddler:
    """A driver that tries to change what it is shown."""

    def reset(self, seed=None):
        pass

    def act(self, observation, scene):
        scene["z"][1] = 3.0
        return np.zeros(2)


class Steady:
    def reset(self, seed=None):
        pass

    def act(self, observation, scene):
        return np.array([1.0, 0.0])


@pytest.mark.parametrize("drivers", [["mpc", "scripted"], ["scripted", "mpc"]])
@pytest.mark.parametrize("automation", [None, Cruise])
def test_a_person_beside_another_driver_is_refused_in_any_order(drivers, automation):
    with pytest.raises(ValueError, match="would not act: 'scripted'"):
        evaluate(drivers, "proportional", ONE, seeds=[0], config=PERSON, automation=automation)


def test_every_episode_lasts_as_long_as_drawn():
    config = {"randomise": [{"setting": "duration", "low": 1.0, "high": 4.0}]}
    alone = [
        evaluate("scripted", "none", ONE, seeds=[seed], config=config, automation=Cruise)["duration"].item()
        for seed in (0, 1, 2)
    ]
    together = (
        evaluate("scripted", "none", ONE, seeds=[0, 1, 2], config=config, automation=Cruise)
        .sort_values("seed")["duration"]
        .tolist()
    )
    assert together == alone
    assert len(set(alone)) > 1


@pytest.mark.parametrize("automation", [None, Cruise])
def test_a_driver_cannot_change_what_it_is_shown(automation):
    with pytest.raises(ValueError, match="read-only"):
        evaluate({"meddler": Meddler}, "none", ONE, seeds=[0], automation=automation)


def test_an_automation_that_cannot_be_made_is_refused():
    class Needy(Cruise):
        def __init__(self, gain):
            self.gain = gain

    with pytest.raises(ValueError, match=r"automation: .*gave an error, TypeError"):
        evaluate("scripted", "none", ONE, seeds=[0], automation=Needy)


def test_commands_are_shares_of_the_limits_of_their_episode():
    config = {"randomise": [{"setting": "limits.a_max", "low": 2.0, "high": 2.0}], "driver_lag": {"K_h": 1.0}}
    fixed = {"limits": {"a_max": 2.0}, "driver_lag": {"K_h": 1.0}}
    efforts = [
        evaluate({"steady": Steady}, "none", ONE, seeds=[0], config=each)
        .loc[0, ["driver_effort", "speed_rms"]]
        .tolist()
        for each in (config, fixed)
    ]
    assert efforts[0] == efforts[1]


def test_rows_hold_identity_and_metrics_alone():
    table = evaluate("scripted", "none", ONE, seeds=[0])
    assert set(table.columns) == {*IDENTITY, *METRICS}

    def seed(trajectory):
        """A name that the table needs."""

    with pytest.raises(ValueError, match="'seed' is there already"):
        metric("-", "lower")(seed)


def test_entries_of_the_catalogue_are_described_as_such():
    for name, entry in chosen_drivers("all").items():
        assert _described("driver", name, entry, DRIVERS)["origin"] == "catalogue"
    mine = chosen_drivers({"mpc": DriverEntry("another", config={"driver": {"H_p": 8}})})["mpc"]
    assert _described("driver", "mpc", mine, DRIVERS)["origin"] == "settings"


def test_the_report_says_where_an_episode_can_be_replayed(tmp_path):
    config = {"faults": [{"channel": "steering", "onset": 0.5, "size": 0.5}], "duration": 4.0}
    evaluate("none", "none", config=config, seeds=[0], automation=lambda: Cruise(), out=tmp_path)
    report = (tmp_path / "report.html").read_text()
    assert "in the program that has the automation" in report
    assert "shared-control replay" not in report
