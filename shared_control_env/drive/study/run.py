"""A study from the command line: with a person on the page, or with simulated people."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from shared_control_env.drive.native import open_wheel
from shared_control_env.drive.run import announce
from shared_control_env.drive.server import Server
from shared_control_env.drive.simulated import Remnant, SimulatedPerson, take_part
from shared_control_env.drive.study.export import ANSWERS, TRIALS, export
from shared_control_env.drive.study.folder import StudyFolder
from shared_control_env.drive.study.plan import Plan
from shared_control_env.drive.study.programme import StudyProgramme
from shared_control_env.evaluation.catalogue import DRIVERS, choose
from shared_control_env.evaluation.progress import progress_bar

LEAVING = 1.0
"""Time for which the page is still served after the last step [s]."""


def with_person(
    plan: Plan, out: Path, code: str, port: int, browser: bool, wheel: str, torque: float, console: Console
) -> None:
    """Run the study with one person on the page, until all is done or it is interrupted.

    Args:
        plan: the plan.
        out: folder of the study.
        code: code of the person; empty for the next free one.
        port: port that is tried first.
        browser: whether to open the page.
        wheel, torque: a wheel on this machine and its force feedback, as for driving freely.
        console: prints.
    """
    if wheel and "wheel" not in plan.devices:
        raise ValueError(f"wheel = {wheel!r}: the plan allows {', '.join(plan.devices)} alone (devices)")
    native = open_wheel(wheel, torque) if wheel else None
    folder = StudyFolder(out, plan, code)
    try:
        if folder.recordings.lost:
            console.print(f"Note: {folder.recordings.lost}; it is driven again.", markup=False)
        server = Server(lambda seat: StudyProgramme(seat, folder), port=port)
        server.seat.native = native
        console.print(f"Person {folder.code}, in {out}. Ctrl+C stops; the same command goes on.", markup=False)
        announce(server, port, console)
        server.run(browser, until=_ended(server))
        done = folder.consent is False or folder.next() is None
        folder.recordings.unmark()
    finally:
        folder.close()
    _tell(out, console)
    console.print(f"{folder.code} is done." if done else f"{folder.code} is not done; --code {folder.code} goes on.")


def with_simulated(
    plan: Plan, out: Path, names: str | Sequence[str], people: int, remnant: Remnant, console: Console
) -> None:
    """Run the whole study with simulated people, through the connection that a page uses.

    Args:
        plan: the plan.
        out: folder of the study.
        names: drivers of the catalogue; person i is number i of them, in turn.
        people: number of people.
        remnant: what they do beside their model.
        console: prints.

    Raises:
        ValueError: for an unknown driver, or as :class:`StudyFolder`.
    """
    drivers = list(choose("driver", names, DRIVERS))
    with progress_bar(console) as bar:
        task = bar.add_task("people", total=people)
        for i in range(people):
            name = drivers[i % len(drivers)]
            noise = f" with a remnant of {remnant.steering:g} rad" if remnant.steering else ""
            folder = StudyFolder(out, plan, f"S{i + 1:02d}", f"{name}{noise}")
            try:
                if folder.consent is None or folder.next() is not None:
                    asyncio.run(_simulate(folder, SimulatedPerson(name, i, remnant)))
            finally:
                folder.close()
            bar.update(task, completed=i + 1)
    _tell(out, console)


async def _simulate(folder: StudyFolder, person: SimulatedPerson) -> None:
    """Let a simulated person take part, in step with the server."""
    server = Server(lambda seat: StudyProgramme(seat, folder), in_step=True, port=0)
    server.seat.with_scene = True
    serving = asyncio.create_task(server.serve())
    try:
        await server.started()
        await take_part(f"ws://127.0.0.1:{server.port}/ws?token={server.token}", server.origins[0], person)
    finally:
        server.stop()
        await serving


async def _ended(server: Server) -> None:
    """Wait until the person is done, and the page has been told."""
    assert isinstance(server.programme, StudyProgramme)
    await server.programme.over.wait()
    await asyncio.sleep(LEAVING)


def _tell(out: Path, console: Console) -> None:
    trials, answers = export(out)
    valid = int(trials["valid"].sum()) if len(trials) else 0
    told = f"{out / TRIALS}" + (f" and {out / ANSWERS}" if len(answers) else "")
    console.print(f"{len(trials)} drives, {valid} of them valid: {told}.", markup=False, soft_wrap=True)
