"""Engines that run batches: one after the other, in processes, or on a Ray cluster. All return the same rows."""

from __future__ import annotations

import os
import pickle
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context, parent_process
from threading import Thread
from typing import Any

from shared_control_env.evaluation.additions import additions, adopt
from shared_control_env.evaluation.episodes import EpisodeBatch, run

Rows = list[dict[str, Any]]

ATTEMPTS = 3
"""Number of times that Ray restarts a batch after the loss of its worker."""


class WorkersLostError(RuntimeError):
    """Worker processes were killed or could not start."""


def serial(batches: Sequence[EpisodeBatch]) -> Iterator[tuple[EpisodeBatch, Rows]]:
    """Run one batch after the other in this process.

    Args:
        batches: batches to run.

    Returns:
        Each batch with its rows, as an iterator.
    """
    for batch in batches:
        yield batch, run(batch)


def processes(batches: Sequence[EpisodeBatch], jobs: int) -> Iterator[tuple[EpisodeBatch, Rows]]:
    """Run batches in several processes, and return them in the order of completion.

    The worker processes end with this process, even if it is killed. The first batch with the driver in the kernel and
    the first without run in this process. The compiled functions are then in the cache before the workers need them.

    Args:
        batches: batches to run.
        jobs: number of worker processes.

    Returns:
        Each batch with its rows, as an iterator.

    Raises:
        WorkersLostError: if a process was killed or could not start, or if a batch cannot be sent to a process.
    """
    for table, entries in additions().items():
        try:
            pickle.dumps(entries)
        except Exception as error:
            raise WorkersLostError(
                f"jobs = {jobs}: what was added to the {table} cannot be sent to another process ({error}); define it "
                "in a file, under a name, or use jobs=1"
            ) from None
    for batch in batches:
        try:
            pickle.dumps((batch.driver, batch.authority, batch.automation))
        except Exception as error:
            raise WorkersLostError(
                f"jobs = {jobs}: driver {batch.driver[0]!r} or authority {batch.authority[0]!r}"
                f"{' or the automation' if batch.automation else ''} cannot be sent to "
                f"another process ({error}); define it in a file, under a name, or use jobs=1"
            ) from None
    first: dict[bool, EpisodeBatch] = {}
    for batch in batches:
        first.setdefault(batch.driver[1].make is None, batch)
    yield from serial(list(first.values()))
    rest = [batch for batch in batches if batch not in first.values()]
    with worker_pool(jobs) as pool:
        try:
            futures = {pool.submit(run, batch): batch for batch in rest}
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BrokenProcessPool:
            raise WorkersLostError(
                f"jobs = {jobs}: a process was killed, or could not begin. Processes import the program that starts "
                'them: in a script, call evaluate() under if __name__ == "__main__":, and give drivers and allocators '
                "that are defined in a file and not at a prompt or in a notebook"
            ) from None
        finally:
            pool.shutdown(cancel_futures=True)


def worker_pool(jobs: int) -> ProcessPoolExecutor:
    """A pool of processes that end with this process, however it ends, and that have its additions to the tables.

    Args:
        jobs: number of processes.
    """
    return ProcessPoolExecutor(
        jobs, mp_context=get_context("spawn"), initializer=_begin_worker, initargs=(additions(),)
    )


def _begin_worker(added: Mapping[str, Mapping[str, Any]]) -> None:
    """Adopt the additions of the parent process, and end when the parent ends."""
    adopt(added)
    _end_with_parent()


def _run_elsewhere(added: Mapping[str, Mapping[str, Any]], batch: EpisodeBatch) -> Rows:
    """Call :func:`episodes.run` in a process that may lack the additions."""
    adopt(added)
    return run(batch)


def _end_with_parent() -> None:
    """End this process when its parent ends: the workers of a parent that is killed would wait forever."""
    parent = parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    Thread(target=watch, daemon=True).start()


def ray_cluster(
    batches: Sequence[EpisodeBatch], jobs: int, address: str | None = None
) -> Iterator[tuple[EpisodeBatch, Rows]]:
    """Run batches as tasks on a Ray cluster, and return them in the order of completion.

    A batch whose worker is lost is started again.

    Args:
        batches: batches to run.
        jobs: number of cores of the cluster that is started if none is running.
        address: address of a running cluster; ``auto`` finds one on this machine.

    Returns:
        Each batch with its rows, as an iterator.

    Raises:
        ImportError: if Ray is not installed.
    """
    try:
        import ray
    except ImportError:
        raise ImportError('the engine ray needs Ray: pip install "shared_control_env[ray]"') from None
    started = not ray.is_initialized()
    if started:
        ray.init(address=address, num_cpus=None if address else jobs, include_dashboard=False, log_to_driver=False)
    remote = ray.remote(num_cpus=1, max_retries=ATTEMPTS)(_run_elsewhere)
    added: Any = ray.put(additions())
    waiting = {remote.remote(added, batch): batch for batch in batches}
    try:
        while waiting:
            done, _ = ray.wait(list(waiting))
            for reference in done:
                yield waiting.pop(reference), ray.get(reference)
    finally:
        if started:
            ray.shutdown()
