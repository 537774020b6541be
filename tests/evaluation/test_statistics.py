import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from shared_control_env.evaluation.statistics import STATISTICS, Interval, interquartile_mean, intervals, resample

STRATA = np.repeat(np.arange(8), 6)
VALUES = st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=40).map(np.array)


def generator():
    return np.random.default_rng(0)


def intervals_of(values, strata, rng=None, resamples=1000):
    return intervals({"values": values}, strata, rng or generator(), resamples)["values"]


def test_interquartile_mean_is_the_mean_of_the_middle_half():
    assert interquartile_mean(np.array([100.0, 1.0, 2.0, 3.0, -50.0, 4.0, 5.0, 6.0])) == pytest.approx(3.5)


@pytest.mark.parametrize(("n", "middle"), [(1, 1), (3, 3), (4, 2), (5, 3), (7, 5), (9, 5)])
def test_interquartile_mean_leaves_out_whole_values(n, middle):
    values = np.arange(float(n)) ** 2
    cut = (n - middle) // 2
    assert interquartile_mean(generator().permutation(values)) == pytest.approx(values[cut : n - cut].mean())


@given(VALUES)
def test_interquartile_mean_lies_between_the_ends_and_moves_with_the_values(values):
    iqm = interquartile_mean(values)
    assert values.min() - 1e-6 <= iqm <= values.max() + 1e-6
    assert interquartile_mean(values + 3.0) == pytest.approx(iqm + 3.0, abs=1e-6)
    assert interquartile_mean(values[::-1]) == pytest.approx(iqm, abs=1e-6)


@given(VALUES, st.integers(0, 2**32 - 1))
def test_samples_have_the_statistics_of_the_values_that_they_repeat(values, seed):
    counts = resample(np.arange(len(values)) % 3, np.random.default_rng(seed), 5)
    for statistic in STATISTICS.values():
        found = statistic.of_samples(values, counts)
        expected = [statistic.of_values(np.repeat(values, row.astype(int))) for row in counts]
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-6)


@given(st.floats(-1e3, 1e3), st.sampled_from(list(STATISTICS)))
def test_intervals_move_with_the_values(shift, name):
    values = generator().normal(size=len(STRATA))
    here, there = (intervals_of(v, STRATA, resamples=50)[name] for v in (values, values + shift))
    np.testing.assert_allclose(there[:3], np.add(here[:3], shift), atol=1e-9)


@given(st.permutations(range(6)))
def test_the_order_within_a_stratum_changes_an_interval_by_chance_alone(order):
    values = generator().normal(size=(8, 6))
    here, there = (intervals_of(v.ravel(), STRATA)["mean"] for v in (values, values[:, order]))
    assert here.estimate == pytest.approx(there.estimate)
    np.testing.assert_allclose([here.low, here.high], [there.low, there.high], atol=0.06)  # 0.4 of a standard error


def test_same_seed_same_interval():
    values = generator().normal(size=len(STRATA))
    assert intervals_of(values, STRATA) == intervals_of(values, STRATA)
    assert intervals_of(values, STRATA) != intervals_of(values, STRATA, np.random.default_rng(1))


def test_samples_stay_within_their_strata():
    strata = generator().permutation(np.repeat(["a", "b", "c"], [1, 4, 9]))
    counts = resample(strata, generator(), 200)
    for stratum, size in (("a", 1), ("b", 4), ("c", 9)):
        np.testing.assert_array_equal(counts[:, strata == stratum].sum(axis=1), size)
    assert (counts[:, strata != "a"].max(axis=0) > 1).all()
    np.testing.assert_allclose(counts.mean(axis=0), 1.0, atol=0.25)


@pytest.mark.parametrize(("name", "of"), [("mean", np.mean), ("IQM", lambda v, axis: stats.trim_mean(v, 0.25, axis))])
def test_agrees_with_scipys_bootstrap_where_there_is_one_stratum(name, of):
    values = np.random.default_rng(1).exponential(size=60)
    ours = intervals_of(values, np.zeros(60), resamples=5000)[name]
    theirs = stats.bootstrap((values,), of, method="percentile", n_resamples=5000, rng=2).confidence_interval
    assert ours.estimate == of(values, axis=0)
    assert ours.low == pytest.approx(theirs.low, abs=0.02)
    assert ours.high == pytest.approx(theirs.high, abs=0.02)


def test_agrees_with_a_loop_over_strata():
    values, rng = 2.0 * STRATA + generator().exponential(size=len(STRATA)), np.random.default_rng(5)
    groups = [values[stratum == STRATA] for stratum in range(8)]
    means = [np.mean([rng.choice(group, 6) for group in groups]) for _ in range(4000)]
    ours = intervals_of(values, STRATA, resamples=4000)["mean"]
    np.testing.assert_allclose([ours.low, ours.high], np.percentile(means, [2.5, 97.5]), atol=0.03)


def test_strata_take_the_differences_between_them_out_of_the_interval():
    values = 100.0 * STRATA + np.random.default_rng(1).normal(size=len(STRATA))
    within = intervals_of(values, STRATA)["mean"]
    across = intervals_of(values, np.zeros(len(STRATA)))["mean"]
    assert within.high - within.low < 1.0 < 50.0 < across.high - across.low


@pytest.mark.parametrize(("seeds", "least", "most"), [(3, 0.83, 0.91), (20, 0.92, 0.97)])
def test_intervals_cover_as_often_as_the_documentation_says(seeds, least, most):
    rng, strata = np.random.default_rng(4), np.repeat(np.arange(30), seeds)
    columns = {str(i): strata + rng.normal(size=len(strata)) for i in range(600)}
    found = [entry["mean"] for entry in intervals(columns, strata, rng, 500).values()]
    assert least <= np.mean([interval.low <= 14.5 <= interval.high for interval in found]) <= most


def test_undefined_values_are_left_out():
    found = intervals_of(np.array([1.0, np.nan, 3.0, np.inf, 5.0, -np.inf, 3.0]), np.zeros(7))
    assert found["mean"].estimate == 3.0
    assert found["mean"].n == 4
    nothing = intervals_of(np.full(4, np.nan), np.zeros(4))["IQM"]
    assert np.isnan(nothing.estimate)
    assert nothing.n == 0


def test_columns_with_different_gaps_do_not_disturb_one_another():
    values = generator().normal(size=len(STRATA))
    gaps = np.where(STRATA == 0, np.nan, values)
    found = intervals({"all": values, "gaps": gaps, "twice": 2.0 * values}, STRATA, generator())
    assert found["gaps"]["mean"].n == 42
    assert found["gaps"]["mean"].estimate == pytest.approx(values[6:].mean())
    np.testing.assert_allclose(found["twice"]["IQM"][:3], 2.0 * np.array(found["all"]["IQM"][:3]))


def test_one_seed_has_no_interval_and_tells_nothing_apart():
    alone = intervals_of(np.arange(8.0), np.arange(8))["mean"]
    assert alone.estimate == 3.5
    assert np.isnan([alone.low, alone.high]).all()
    assert not alone.distinct_from(Interval(9.0, 8.0, 10.0, 8))
    assert not Interval(9.0, 8.0, 10.0, 8).distinct_from(alone)


def test_intervals_are_distinct_without_a_common_number():
    assert not Interval(1, 0, 2, 9).distinct_from(Interval(2, 1.5, 3, 9))
    assert not Interval(1, 0, 2, 9).distinct_from(Interval(2, 2, 3, 9))
    assert Interval(1, 0, 2, 9).distinct_from(Interval(3, 2.5, 3, 9))
    assert Interval(3, 2.5, 3, 9).distinct_from(Interval(1, 0, 2, 9))
