"""The same rows from a Ray cluster, one of whose two workers is killed midway."""

import threading
import time

import pandas as pd
import pytest

from shared_control_env.evaluation import Suite, evaluate

ray = pytest.importorskip("ray", reason="needs the extra 'ray'")

SUITE = Suite("small", ("lane_keeping", "bend", "cut_in", "s_curve"), ("none", "step_bias", "stuck"))
DRIVERS, AUTHORITIES = ["none", "scripted"], ["fixed", "proportional"]


@pytest.mark.filterwarnings("ignore")
def test_nothing_is_lost_when_a_worker_is_killed(tmp_path):
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
    try:
        workers = [cluster.add_node(num_cpus=1) for _ in range(2)]
        ray.init(address=cluster.address, log_to_driver=False)
        assert ray.cluster_resources()["CPU"] == 2.0
        done = []

        def kill_midway():
            while len(done) < 2:
                time.sleep(0.02)
            cluster.remove_node(workers[0], allow_graceful=False)

        killer = threading.Thread(target=kill_midway)
        killer.start()
        table = evaluate(
            DRIVERS,
            AUTHORITIES,
            SUITE,
            seeds=range(4),
            engine="ray",
            out=tmp_path,
            progress=lambda n, _: done.append(n),
        )
        killer.join()
        deadline = time.monotonic() + 60.0  # the head hears of the loss when the heartbeats stay away
        while ray.cluster_resources()["CPU"] != 1.0:
            assert time.monotonic() < deadline
            time.sleep(0.1)
    finally:
        ray.shutdown()
        cluster.shutdown()
    serial = evaluate(DRIVERS, AUTHORITIES, SUITE, seeds=range(4))
    pd.testing.assert_frame_equal(
        table.drop(columns="real_time_factor"), serial.drop(columns="real_time_factor"), check_dtype=False
    )
