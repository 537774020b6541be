import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared_control_env.drive.latency import FLAGGED, Line, summary


@given(st.floats(-1e6, 1e6), st.floats(0.0005, 0.02), st.floats(0.0, 0.03), st.integers(0, 1000))
def test_the_age_of_an_input_is_found_whatever_the_clocks_say(offset, way, most, seed):
    """A page whose clock is off, with a way of varying length: the age is that since the reading, to a few ways."""
    rng, line, now, echo = np.random.default_rng(seed), Line(), 100.0, -1
    arrived = 0.0
    for k in range(60):
        line.sent(k, now)
        echo, arrived = k, now + way
        read = arrived + 0.004
        delay = way + (rng.uniform(0.0, most) if k != 5 else 0.0)
        line.received(read + offset, echo, read - arrived, read + delay)
        now = 100.0 + 0.05 * (k + 1)
    true = now - read
    assert line.age(now) == pytest.approx(true, abs=most + way + 1e-6)
    assert 2.0 * way - 1e-6 <= line.round_trip <= 2.0 * way + most + 1e-6


def test_without_an_input_the_age_is_infinite():
    assert Line().age(3.0) == np.inf
    assert np.isnan(Line().round_trip)


def test_an_echo_of_a_frame_that_was_not_sent_gives_no_round_trip():
    line = Line()
    line.received(1.0, 77, 0.0, 2.0)
    assert np.isnan(line.round_trip)
    assert line.age(2.0) == 0.0


def test_memory_is_bounded():
    line = Line()
    for k in range(5000):
        line.sent(k, 0.05 * k)
        line.received(0.05 * k, k, 0.0, 0.05 * k)
    assert len(line._sent) <= 257
    assert len(line._differences) <= 256


def test_summary():
    columns = {
        "lateness": [0.001] * 99 + [0.009],
        "input_age": [0.01] * 90 + [0.05] * 10,
        "round_trip": [np.nan, 0.002],
    }
    found = summary(columns)
    assert found["flagged"]
    assert found["input_age"]["p95"] > FLAGGED
    assert found["lateness"]["max"] == 0.009
    assert found["round_trip"]["median"] == 0.002
    assert not summary({**columns, "input_age": [0.01] * 100})["flagged"]
