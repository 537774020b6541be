"""The commands that seat a person: what they print, and how they end."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from shared_control_env.drive.folders import RecordingsFolder, locked
from shared_control_env.drive.free import FreeDriving
from shared_control_env.drive.native import open_wheel
from shared_control_env.drive.server import Server
from shared_control_env.drive.session import BESIDE, Choice
from shared_control_env.evaluation.catalogue import DRIVERS


def drive(choice: Choice, out: Path, port: int, browser: bool, wheel: str, torque: float, console: Console) -> None:
    """Serve the page on which a person drives freely, until interrupted.

    Args:
        choice: what is chosen on the page at first.
        out: folder of the recordings.
        port: port that is tried first.
        browser: whether to open the page.
        wheel: name, or a part of it, of a wheel on this machine that is read natively; empty for the page's devices.
        torque: largest torque of its force feedback, as a share of the device's; 0 for none.
        console: prints.

    Raises:
        ValueError: if the choice is not possible, the folder cannot be written to, or there is no such wheel.
    """
    choice.batch((BESIDE, DRIVERS[BESIDE]))
    native = open_wheel(wheel, torque) if wheel else None
    with locked(out):
        folder = RecordingsFolder(out)
        if folder.lost:
            console.print(f"Note: {folder.lost}.", markup=False)
        server = Server(lambda seat: FreeDriving(seat, folder, choice), port=port)
        server.seat.native = native
        announce(server, port, console)
        console.print(f"Recordings go to {out}. Ctrl+C ends.", markup=False)
        server.run(browser)
        console.print("The drive that was under way is lost." if folder.unmark() else "Ended.", markup=False)


def announce(server: Server, port: int, console: Console) -> None:
    """Print the address of the page.

    Args:
        server: the server.
        port: the port that was asked for.
        console: prints.
    """
    if port not in (0, server.port):
        console.print(
            f"Note: port {port} is taken; this is {server.port}, where the page does not know earlier calibrations."
        )
    console.print(f"The page is {server.url}", markup=False, soft_wrap=True)
