"""Ways to run batches: one after the other, in processes, or on a Ray cluster. All give the same rows."""

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
from shared_control_env.evaluation.episodes import Batch, run

Rows = list[dict[str, Any]]

ATTEMPTS = 3
"""Times that Ray starts a batch again whose worker was lost."""


class WorkersLostError(RuntimeError):
    """Processes were killed, or could not begin."""


def serial(batches: Sequence[Batch]) -> Iterator[tuple[Batch, Rows]]:
    """One batch after the other, here."""
    for batch in batches:
        yield batch, run(batch)


def processes(batches: Sequence[Batch], jobs: int) -> Iterator[tuple[Batch, Rows]]:
    """Batches in some processes, as they are done; the processes end with this one, even if it is killed.

    The first batch of either kind, with the driver in the kernel and without, runs here, so that what it compiles is
    in the cache before the processes look for it.

    Raises:
        WorkersLostError: if a process was killed, or could not begin.
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
                f"jobs = {jobs}: driver {batch.driver[0]!r} or authority {batch.authority[0]!r} cannot be sent to "
                f"another process ({error}); define it in a file, under a name, or use jobs=1"
            ) from None
    first: dict[bool, Batch] = {}
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
    """Processes that end with the one that starts them, however that ends, and know what this one has added.

    Args:
        jobs: how many.
    """
    return ProcessPoolExecutor(
        jobs, mp_context=get_context("spawn"), initializer=_begin_worker, initargs=(additions(),)
    )


def _begin_worker(added: Mapping[str, Mapping[str, Any]]) -> None:
    """Take over what the parent has added, and end with it."""
    adopt(added)
    _end_with_parent()


def _run_elsewhere(added: Mapping[str, Mapping[str, Any]], batch: Batch) -> Rows:
    """:func:`episodes.run` in a process that may not know what was added."""
    adopt(added)
    return run(batch)


def _end_with_parent() -> None:
    """Watch the parent in a thread: one that is killed tells nobody, and its workers would wait for it for ever."""
    parent = parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    Thread(target=watch, daemon=True).start()


def ray_cluster(batches: Sequence[Batch], jobs: int, address: str | None = None) -> Iterator[tuple[Batch, Rows]]:
    """Batches as tasks of a Ray cluster, as they are done; one whose worker is lost is started again.

    Args:
        batches: to run.
        jobs: cores of a cluster that is started here, where there is none.
        address: of a running cluster; ``auto`` finds one on this machine.

    Raises:
        ImportError: without Ray.
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
