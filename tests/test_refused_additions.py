"""What a user adds is checked when it is added, so that no compiled code runs what cannot work."""

import numpy as np
import pytest

from shared_control_env.core.faults.kinds import KINDS, SHARE, Kind, add_kind
from shared_control_env.core.feedback.observation import OBSERVATIONS, Observation, add_observation
from shared_control_env.core.feedback.reward import TERMS, Term, add_term
from shared_control_env.core.world.tyre import TYRES, add_tyre
from shared_control_env.envs.degradations import DEGRADATIONS, Degradation, add_degradation
from shared_control_env.envs.scenarios import SCENARIOS, TWO_LANE, add_scenario


def halve(u, share, onset, fault, memory, k, dt, out):
    out[0] = share * u


def first_entry(scene, memory, line, p, out):
    out[0] = scene.z[1]


def ninth_entry(scene, memory, line, p, out):
    out[8] = scene.z[1]


def cautious(step):
    if step.scene.z[1] > 2.0:
        raise ValueError("too far left")
    return 0.0


def flat(slip, C, mu, F_z):
    assert mu > 0.0
    return 0.0, 0.0


ONE = (("lateral position [m]", 4.0),)
REFUSED = {
    "kind without a name": (lambda: add_kind(Kind("", SHARE, act=halve)), "name"),
    "kind that does nothing": (lambda: add_kind(Kind("idle", SHARE)), "give it act or perceive"),
    "kind that heeds what is not set": (lambda: add_kind(Kind("half", SHARE, act=halve, heeds=("sed",))), "'seed'"),
    "kind that heeds a text": (lambda: add_kind(Kind("half", SHARE, act=halve, heeds="seed")), "must be a tuple"),
    "kind of no channel": (lambda: add_kind(Kind("half", SHARE, act=halve, channels=())), "no channels"),
    "kind of an unknown channel": (lambda: add_kind(Kind("half", SHARE, act=halve, channels=("brake",))), "channels"),
    "observation beyond its features": (lambda: add_observation(Observation("b", ONE, ninth_entry)), "entry 8"),
    "observation without features": (lambda: add_observation(Observation("b", (), first_entry)), "feature"),
    "observation with a scale of 0": (lambda: add_observation(Observation("b", (("y", 0.0),), first_entry)), "scale"),
    "term that raises": (lambda: add_term(Term("cautious", 0.1, cautious)), "raises errors"),
    "term that is no function": (lambda: add_term(Term("three", 0.1, 3.0)), "must be a function"),
    "tyre that asserts": (lambda: add_tyre("flat", flat), "raises errors"),
    "degradation of an unknown kind": (
        lambda: add_degradation("d", Degradation("shift", "biass", ("steering",))),
        "'bias'",
    ),
    "degradation of no channel": (
        lambda: add_degradation("d", Degradation("shift", "bias", (), (0.1, 0.2))),
        "channels",
    ),
    "degradation without a size": (lambda: add_degradation("d", Degradation("shift", "bias", ("steering",))), "size"),
    "scenario whose name is no identifier": (lambda: add_scenario("my road", TWO_LANE), "identifier"),
    "scenario whose id is taken": (lambda: add_scenario("my_road", TWO_LANE), "registered already"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_work_is_refused_and_leaves_the_tables_alone(case):
    tables = KINDS, OBSERVATIONS, TERMS, TYRES, DEGRADATIONS, SCENARIOS
    before = [dict(table) for table in tables]
    act, words = REFUSED[case]
    with pytest.raises(ValueError, match=words):
        act()
    assert [dict(table) for table in tables] == before


def test_the_check_of_an_observation_lets_a_right_one_pass():
    try:
        add_observation(Observation("first", ONE, first_entry))
        np.testing.assert_array_equal(OBSERVATIONS["first"].scales, [4.0])
    finally:
        OBSERVATIONS.pop("first", None)
