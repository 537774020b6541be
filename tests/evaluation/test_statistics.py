import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from shared_control_env.evaluation.statistics import Interval, interquartile_mean, intervals, resample

STRATA = np.repeat(np.arange(8), 6)


def generator():
    return np.random.default_rng(0)


def test_interquartile_mean_is_the_mean_of_the_middle_half():
    assert interquartile_mean(np.array([100.0, 1.0, 2.0, 3.0, -50.0, 4.0, 5.0, 6.0])) == pytest.approx(3.5)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=40))
def test_interquartile_mean_lies_between_the_ends_and_moves_with_the_values(values):
    values = np.array(values)
    iqm = interquartile_mean(values)
    assert values.min() - 1e-6 <= iqm <= values.max() + 1e-6
    assert interquartile_mean(values + 3.0) == pytest.approx(iqm + 3.0, abs=1e-6)
    assert interquartile_mean(values[::-1]) == pytest.approx(iqm, abs=1e-6)


def test_samples_stay_within_their_strata():
    indices = resample(STRATA, generator(), 200)
    np.testing.assert_array_equal(STRATA[indices], np.broadcast_to(STRATA, indices.shape))
    assert all(len(np.unique(indices[:, i])) == 6 for i in range(len(STRATA)))


def test_mean_agrees_with_scipys_bootstrap_where_there_is_one_stratum():
    values = np.random.default_rng(1).exponential(size=60)
    ours = intervals(values, np.zeros(60), generator(), 5000)["mean"]
    theirs = stats.bootstrap((values,), np.mean, method="percentile", n_resamples=5000, rng=2).confidence_interval
    assert ours.estimate == values.mean()
    assert ours.low == pytest.approx(theirs.low, abs=0.02)
    assert ours.high == pytest.approx(theirs.high, abs=0.02)


def test_strata_take_the_differences_between_them_out_of_the_interval():
    values = 100.0 * STRATA + np.random.default_rng(1).normal(size=len(STRATA))
    within = intervals(values, STRATA, generator())["mean"]
    across = intervals(values, np.zeros(len(STRATA)), generator())["mean"]
    assert within.high - within.low < 1.0 < 50.0 < across.high - across.low


def test_intervals_cover_as_often_as_they_say():
    rng = np.random.default_rng(4)
    truth = np.arange(8).mean()
    covered = [
        interval.low <= truth <= interval.high
        for interval in (intervals(STRATA + rng.normal(size=len(STRATA)), STRATA, rng, 300)["mean"] for _ in range(300))
    ]
    assert 0.85 <= np.mean(covered) <= 0.98  # percentile intervals of six values a stratum are a little short


def test_undefined_values_are_left_out():
    values = np.array([1.0, np.nan, 3.0, np.inf, 5.0, 3.0])
    found = intervals(values, np.zeros(6), generator())
    assert found["mean"].estimate == 3.0
    assert found["mean"].n == 4
    nothing = intervals(np.full(4, np.nan), np.zeros(4), generator())["IQM"]
    assert np.isnan(nothing.estimate)
    assert nothing.n == 0


def test_one_seed_has_no_interval():
    alone = intervals(np.arange(8.0), np.arange(8), generator())["mean"]
    assert alone.estimate == 3.5
    assert np.isnan([alone.low, alone.high]).all()
    assert not alone.overlaps(Interval(3.5, 3.0, 4.0, 8))


def test_overlap():
    assert Interval(1, 0, 2, 9).overlaps(Interval(2, 1.5, 3, 9))
    assert not Interval(1, 0, 2, 9).overlaps(Interval(3, 2.5, 3, 9))
