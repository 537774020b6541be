import numpy as np
import pytest

from shared_control_env.core.authority import fuzzy

GRID = np.linspace(0.0, 1.0, 101)


def surface(operators):
    return np.array([[fuzzy.authority(r_x, r_y, operators) for r_y in GRID] for r_x in GRID])


def test_monotone_in_both_risks_with_product_and_sum():
    values = surface(fuzzy.OPERATORS.index("product-sum"))
    assert np.diff(values, axis=0).max() <= 1e-12
    assert np.diff(values, axis=1).max() <= 1e-12
    assert values[0, 0] == pytest.approx(1.0)
    assert values[-1].max() <= 0.05
    assert values[:, -1].max() <= 0.05


def test_min_max_dips_by_less_than_a_hundredth():
    values = surface(fuzzy.OPERATORS.index("min-max"))
    rise = max(np.diff(values, axis=0).max(), np.diff(values, axis=1).max())
    assert 1e-3 < rise < 1e-2
    assert values[0, 0] == pytest.approx(1.0)


def test_rules_fall_in_both_risks_and_cover_the_terms():
    assert fuzzy.RULES[0, 0] == len(fuzzy.AUTHORITY_TERMS) - 1
    assert (np.diff(fuzzy.RULES, axis=0) <= 0).all()
    assert (np.diff(fuzzy.RULES, axis=1) <= 0).all()
    np.testing.assert_array_equal(fuzzy.RULES, fuzzy.RULES.T)


def membership_by_hand(value, term, n):
    """Z, triangle or S as the textbooks print them."""
    w = 1.0 / (n - 1)
    a, m, b = (term - 1) * w, term * w, (term + 1) * w
    if 0 < term < n - 1:
        return max(0.0, min((value - a) / w, (b - value) / w))
    start, end = (0.0, w) if term == 0 else (a, m)
    middle = 0.5 * (start + end)
    if value <= start:
        s = 0.0
    elif value <= middle:
        s = 2.0 * ((value - start) / (end - start)) ** 2
    elif value < end:
        s = 1.0 - 2.0 * ((value - end) / (end - start)) ** 2
    else:
        s = 1.0
    return 1.0 - s if term == 0 else s


@pytest.mark.parametrize("n", [5, 7])
def test_memberships(n):
    for term in range(n):
        values = [fuzzy.membership(value, term, n) for value in GRID]
        np.testing.assert_allclose(values, [membership_by_hand(v, term, n) for v in GRID], atol=1e-12)


@pytest.mark.parametrize("operators", fuzzy.OPERATORS)
def test_centroid_equals_the_sampled_one(operators):
    rng = np.random.default_rng(0)
    outputs = np.array([[membership_by_hand(z, term, 7) for z in fuzzy.UNIVERSE] for term in range(7)])
    for r_x, r_y in rng.uniform(size=(50, 2)):
        aggregate = np.zeros(501)
        for i in range(5):
            for j in range(5):
                mu_x, mu_y = membership_by_hand(r_x, i, 5), membership_by_hand(r_y, j, 5)
                term = outputs[fuzzy.RULES[i, j]]
                if operators == "product-sum":
                    aggregate += mu_x * mu_y * term
                else:
                    aggregate = np.maximum(aggregate, np.minimum(min(mu_x, mu_y), term))
        expected = (aggregate @ fuzzy.UNIVERSE) / aggregate.sum()
        centroid = fuzzy.centroid_product_sum if operators == "product-sum" else fuzzy.centroid_min_max
        assert centroid(r_x, r_y) == pytest.approx(expected, abs=1e-12)


def test_centroids_span_is_that_of_the_spec():
    assert fuzzy.centroid_product_sum(1.0, 1.0) == pytest.approx(0.048, abs=2e-3)
    assert fuzzy.centroid_product_sum(0.0, 0.0) == pytest.approx(0.952, abs=2e-3)
