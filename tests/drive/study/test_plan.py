from collections import Counter

import numpy as np
import pytest

from shared_control_env.drive.study.order import order_of, williams
from shared_control_env.drive.study.plan import read_plan
from shared_control_env.drive.study.questionnaires import QUESTIONNAIRES, checked

PLAN = """
title = "Two authorities"
seed = 3
repetitions = 2
devices = ["keyboard"]
questionnaires = ["nasa_tlx", "van_der_laan"]

[practice]
scenario = "lane_keeping"
degradation = "none"
below = 0.5
most = 2

[[conditions]]
name = "fuzzy"
scenario = "two_lane"
authority = "proportional"

[[conditions]]
name = "unlimited"
scenario = "two_lane"
authority = "none"
show = []
"""


def written(tmp_path, text=PLAN):
    path = tmp_path / "plan.toml"
    path.write_text(text)
    return path


def test_a_plan_is_read(tmp_path):
    plan = read_plan(written(tmp_path))
    assert [condition.name for condition in plan.conditions] == ["fuzzy", "unlimited"]
    assert plan.seed_of(1) == 3001
    assert plan.practice_seed(0) not in [plan.seed_of(r) for r in range(plan.repetitions)]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('title = "Two authorities"', "", "title is missing"),
        ("repetitions = 2", "repetitons = 2", "repetitons is no field; did you mean 'repetitions'"),
        ("repetitions = 2", "repetitions = 0", "repetitions = 0"),
        ("repetitions = 2", 'repetitions = "2"', "repetitions = '2'"),
        ('"nasa_tlx"', '"nasa_tlk"', "did you mean 'nasa_tlx'"),
        ('devices = ["keyboard"]', 'devices = ["keybord"]', "devices[0] = 'keybord'"),
        ('devices = ["keyboard"]', "devices = []", "devices"),
        ('name = "unlimited"', 'name = "fuzzy"', "'fuzzy' is given twice"),
        ('name = "unlimited"', 'name = "../up"', "letters, digits"),
        ('name = "unlimited"', 'name = "Fuzzy"', "'fuzzy' is given twice"),
        ('name = "unlimited"', 'name = "practice"', "is that of the practice drives"),
        (
            'authority = "none"',
            'authority = "nonne"',
            "conditions[1]: authority = 'nonne' is not known; did you mean 'none'",
        ),
        ('authority = "none"', 'autority = "none"', "conditions[1].autority is no field; did you mean 'authority'"),
        ("show = []", 'show = ["authorty"]', "did you mean 'authority'"),
        ('degradation = "none"', 'degradation = "bias:steering:9:-"', "practice"),
        ("below = 0.5", 'metric = "lateral_rmz"', "did you mean 'lateral_rms'"),
        ("seed = 3", "seed = = 3", "is no TOML"),
    ],
)
def test_everything_is_checked_before_the_first_person_sits_down(tmp_path, old, new, said):
    assert old in PLAN
    with pytest.raises(ValueError, match=r"plan\.toml") as error:
        read_plan(written(tmp_path, PLAN.replace(old, new)))
    assert said in str(error.value)


def test_a_plan_that_is_not_there(tmp_path):
    with pytest.raises(ValueError, match="cannot be read"):
        read_plan(tmp_path / "none.toml")


@pytest.mark.parametrize("n", range(1, 9))
def test_williams_squares_balance_positions_and_what_comes_before(n):
    square = williams(n)
    assert all(sorted(row) == list(range(n)) for row in square)
    for position in square.T:
        assert set(Counter(position.tolist()).values()) == {len(square) // n}
    if n > 1:
        pairs = Counter((a, b) for row in square.tolist() for a, b in zip(row[:-1], row[1:], strict=True))
        assert len(pairs) == n * (n - 1)
        assert len(set(pairs.values())) == 1


def test_a_seed_gives_an_order_for_each_person():
    orders = [order_of(person, 4, seed=1) for person in range(8)]
    assert orders[:4] == orders[4:]
    assert len({tuple(order) for order in orders}) == 4
    assert orders == [order_of(person, 4, seed=1) for person in range(8)]
    assert any(orders != [order_of(person, 4, seed=s) for person in range(8)] for s in (2, 3))
    assert sorted(np.ravel(orders[0])) == [0, 1, 2, 3]


def test_scores():
    tlx = checked("nasa_tlx", {item.name: 5.0 * i for i, item in enumerate(QUESTIONNAIRES["nasa_tlx"].items)})
    assert tlx["raw_tlx"] == pytest.approx(12.5)
    items = QUESTIONNAIRES["van_der_laan"].items
    # The best answer to each item: its left end, but for items 3, 6 and 8.
    best = {item.name: item.least if i not in (2, 5, 7) else -item.least for i, item in enumerate(items)}
    assert set(best.values()) == {2.0}
    scored = checked("van_der_laan", best)
    assert (scored["usefulness"], scored["satisfaction"]) == (2.0, 2.0)
    best["item_3"] = -2.0
    assert checked("van_der_laan", best)["usefulness"] == pytest.approx(1.2)


@pytest.mark.parametrize(
    ("changes", "said"), [({"mental": 7.0}, "no answer of its scale"), ({"mantal": 5.0}, "missing or unknown: mantal")]
)
def test_wrong_answers(changes, said):
    answers = {item.name: 50.0 for item in QUESTIONNAIRES["nasa_tlx"].items}
    with pytest.raises(ValueError, match=said):
        checked("nasa_tlx", {**answers, **changes})
