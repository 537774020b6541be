"""Make the tiny recording that comes with the package: three lanes with a bend, six vehicles, twelve seconds.

It is generated, not recorded: no recorded data may be shipped. Run ``python -m experiments.example_recording``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import shared_control_env
from shared_control_env.core.world.road import point_at, reference_line

FOLDER = Path(shared_control_env.__file__).parent / "envs/recorded"
LINE = reference_line([(60.0, 0.0), (120.0, 1.0 / 400.0), (120.0, -1.0 / 500.0), (100.0, 0.0)])
WIDTHS = (3.6, 3.4, 3.2)
"""Widths of the lanes from the right [m]; the rightmost grows by 0.3 m along the road."""

VEHICLES = (
    # lane, position and speed at the start, length, width, time of a change one lane to the left (0 for none)
    (0, 30.0, 14.0, 4.6, 1.9, 0.0),
    (0, 62.0, 13.0, 12.0, 2.5, 0.0),
    (1, 20.0, 17.0, 4.2, 1.8, 0.0),
    (1, 55.0, 16.0, 4.9, 1.9, 5.0),
    (2, 5.0, 19.0, 4.4, 1.8, 0.0),
    (0, 2.0, 14.5, 4.0, 1.7, 0.0),
)
DURATION, DT, NOISE = 12.0, 0.2, 0.03


def main() -> None:
    """Write the two tables."""
    rng = np.random.default_rng(0)
    lanes = ["lane,side,x,y"]
    for lane in range(3):
        for side in ("left", "right"):
            for s in np.arange(0.0, 396.0, 5.0):
                x, y, _ = point_at(LINE, s, border(lane + (side == "left"), s))
                lanes.append(f"{lane},{side},{x:.3f},{y:.3f}")
    tracks = ["id,t,x,y,heading,length,width"]
    t = np.arange(0.0, DURATION + 0.5 * DT, DT)
    for i, (lane, start, speed, length, width, change) in enumerate(VEHICLES):
        s = start + speed * t + 0.8 * np.sin(0.5 * t + i)
        share = np.clip((t - change) / 4.0, 0.0, 1.0) if change else np.zeros_like(t)
        share = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        for k, time in enumerate(t):
            here = 0.5 * (border(lane, s[k]) + border(lane + 1, s[k]))
            beside = 0.5 * (border(lane + 1, s[k]) + border(lane + 2, s[k])) if change else here
            x, y, heading = point_at(LINE, s[k], (1.0 - share[k]) * here + share[k] * beside)
            x, y = np.array([x, y]) + NOISE * rng.normal(size=2)
            tracks.append(f"{i + 1},{time:.1f},{x:.3f},{y:.3f},{heading:.4f},{length},{width}")
    (FOLDER / "example.lanes.csv").write_text("\n".join(lanes) + "\n")
    (FOLDER / "example.tracks.csv").write_text("\n".join(tracks) + "\n")
    print(f"{len(VEHICLES)} vehicles in {FOLDER / 'example.tracks.csv'}")


def border(number: int, s: float) -> float:
    """Offset of a border from the right edge of the road [m].

    Args:
        number: number of the border from the right.
        s: path length [m].
    """
    return sum(WIDTHS[:number]) + (0.3 * s / 400.0 if number else 0.0)


if __name__ == "__main__":
    main()
