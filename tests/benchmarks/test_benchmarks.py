"""The benchmark's parts run and count what they say; their times are not tested."""

import numpy as np

from benchmarks import controllers, environments, parts, suite, vectors
from benchmarks.timing import Timing, time_block
from shared_control_env.core.compile.cold_start import cores


def test_timing():
    calls = []
    timing = time_block(lambda: calls.append(1) or 2, repeats=5)
    assert len(calls) == 6
    assert 0.0 <= timing.low <= timing.median <= timing.high
    assert str(Timing(1e-6, 5e-7, 2e-6)) == "1.0 us (0.5 to 2.0)"


def test_every_part_runs():
    for part in (environments.highway, environments.limited, environments.closed_loop):
        assert part(1).median > 0.0
    found = controllers.scenes(30)
    assert len(found) == 30
    assert not np.array_equal(found[0]["z"], found[-1]["z"])
    ours, slsqp, gaps = controllers.automation(found, 1)
    assert 0.0 < ours.median < slsqp.median
    assert np.isfinite(gaps).all()


def test_parts_and_vectors_run():
    assert all(timing.median > 0.0 for timing in parts.times(1).values())
    one = vectors.kernel(1, True, 1)
    assert one.one.median > 0.0
    assert (one.all, one.ratio) == (None, 1.0)
    several = vectors.kernel(64, False, 1, "SharedControl/DenseTraffic-v1")
    assert (several.all is not None) == (len(cores()) > 1)
    assert several.ratio > 0.0
    allowed = cores()
    many = vectors.kernel(1024, False, 1)
    assert cores() == allowed
    assert (many.all is None) is (len(allowed) == 1)
    assert many.ratio > 0.0
    (seconds,) = suite.seconds_for(10, 1, "paper")
    assert seconds > 0.0
    assert 0 < vectors.bytes_per_environment() <= 4400
