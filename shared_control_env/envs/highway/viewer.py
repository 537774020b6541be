"""Rendering: highway-env's world with safe area, prediction and path, above a panel of gauges."""

from __future__ import annotations

from typing import Any, Protocol
from weakref import WeakSet

import numpy as np
import pygame
from highway_env.envs.common.graphics import EnvViewer
from highway_env.road.graphics import RoadGraphics, WorldSurface

from shared_control_env.core.risk.safe_area import REACHED
from shared_control_env.core.world.road import point_at
from shared_control_env.envs.settings.schema import PANEL_HEIGHT

_SHAPE = ("screen_width", "screen_height", "centering_position", "scaling", "offscreen_rendering")
"""Settings that determine a viewer; a change requires a new viewer."""

BACKGROUND, INK, FAINT = (250, 250, 250), (30, 30, 30), (205, 205, 205)
AUTOMATION, DEGRADED, LIMITED, DRIVER = (0, 110, 200), (215, 45, 45), (150, 90, 200), (20, 140, 60)
SAFE, BLOCKED = (70, 200, 120, 70), (230, 150, 40, 90)
PREDICTION, PATH = (0, 230, 60), (255, 210, 0)
RISK, AUTHORITY = (220, 110, 0), (90, 60, 190)


_WINDOWS: WeakSet[SharedControlViewer] = WeakSet()
"""Viewers that draw on pygame's window."""


class Drawn(Protocol):
    """Attributes of an environment that a picture needs; see :class:`envs.shared_control.SharedControlEnv`."""

    config: dict[str, Any]
    episode: Any
    road: Any
    vehicle: Any
    scene: np.ndarray
    signals: np.ndarray
    noted: np.ndarray
    parameters: np.ndarray
    line: np.ndarray
    path: np.ndarray


class SharedControlViewer(EnvViewer):
    """Viewer of one environment.

    highway-env draws y downwards. Here y points to the left of the driving direction, so the picture of the world is
    flipped after drawing. Text is drawn after the flip.

    Args:
        env: the environment, see :class:`Drawn`.

    Attributes:
        env: the environment.
        config: the settings that determine this viewer.
        offscreen: whether no window is opened.
    """

    def __init__(self, env: Any) -> None:
        # The parent's constructor opens a display even for offscreen rendering, so it is not called.
        drawn: Drawn = env
        self.env, self.config = drawn, {name: env.config[name] for name in _SHAPE}
        self.offscreen = self.config["offscreen_rendering"]
        self.observer_vehicle = None
        size = (self.config["screen_width"], self.config["screen_height"])
        if not self.offscreen:
            pygame.display.init()
            pygame.display.set_caption("shared_control_env")
            self.screen = pygame.display.set_mode(size)
            _WINDOWS.add(self)
        pygame.font.init()
        self.font = pygame.font.Font(None, 20)
        self.clock = pygame.time.Clock()
        self.frame_surface = pygame.Surface(size)
        world = (size[0], size[1] - PANEL_HEIGHT)
        self.sim_surface = WorldSurface(world, 0, pygame.Surface(world))
        self.sim_surface.scaling = self.config["scaling"]
        self.sim_surface.centering_position = list(self.config["centering_position"])

    def display(self) -> None:
        """Draw the present scene on the frame and, in human mode, on the window."""
        self._draw_world()
        self._draw_panel()
        if not self.offscreen:
            self.screen.blit(self.frame_surface, (0, 0))
            if self.env.episode.real_time_rendering:
                self.clock.tick(self.env.episode.policy_frequency)
            pygame.display.flip()

    def get_image(self) -> np.ndarray:
        """The frame as an array of bytes, shape (height, width, 3)."""
        return np.ascontiguousarray(np.moveaxis(pygame.surfarray.array3d(self.frame_surface), 0, 1))

    def close(self) -> None:
        """Close the window. pygame has a single window, which stays open while another environment draws on it."""
        _WINDOWS.discard(self)
        if not self.offscreen and not _WINDOWS:
            pygame.display.quit()

    def shows(self, config: dict[str, Any]) -> bool:
        """Whether this viewer fits a configuration.

        Args:
            config: settings of the environment.
        """
        return all(config[name] == value for name, value in self.config.items())

    def _draw_world(self) -> None:
        surface, env = self.sim_surface, self.env
        env.road.mark_collisions()
        surface.move_display_window_to(self.window_position())
        RoadGraphics.display(env.road, surface)
        self._draw_safe_area()
        if len(env.path) > 1:
            pygame.draw.lines(surface, PATH, False, [surface.vec2pix(point) for point in env.path], 2)
        RoadGraphics.display_traffic(
            env.road, surface, simulation_frequency=env.episode.simulation_frequency, offscreen=True
        )
        self._draw_prediction()
        self.frame_surface.blit(pygame.transform.flip(surface, False, True), (0, 0))

    def _draw_safe_area(self) -> None:
        """Fill the safe area C between its boundaries, which bend with the road."""
        area, surface = self.env.scene["area"], self.sim_surface
        outline = np.vstack([_curved(area["lower"]), _curved(area["upper"])[::-1]])
        if len(outline) < 3:
            return
        points = [surface.vec2pix(point_at(self.env.line, s, d)[:2]) for s, d in outline]
        layer = pygame.Surface(surface.get_size(), pygame.SRCALPHA)
        pygame.draw.polygon(layer, SAFE if area["outcome"] == REACHED else BLOCKED, points)
        pygame.draw.polygon(layer, (*SAFE[:3], 255), points, 1)
        surface.blit(layer, (0, 0))

    def _draw_prediction(self) -> None:
        """Draw the CTRA prediction as a green diamond."""
        x, y = self.sim_surface.vec2pix(self.env.signals["prediction"][:2])
        diamond = [(x - 9, y), (x, y - 9), (x + 9, y), (x, y + 9)]
        pygame.draw.polygon(self.sim_surface, PREDICTION, diamond)
        pygame.draw.polygon(self.sim_surface, INK, diamond, 1)

    def _draw_panel(self) -> None:
        """Draw gauges of risk and authority on the left, and of the commands on the right.

        Gauges and fault show the step that led to the present scene. Time, speed and position are those of the
        present scene.
        """
        env, noted = self.env, self.env.noted
        width, top = self.frame_surface.get_width(), self.frame_surface.get_height() - PANEL_HEIGHT
        pygame.draw.rect(self.frame_surface, BACKGROUND, (0, top, width, PANEL_HEIGHT))
        self._write(
            f"t = {env.scene['t']:.2f} s     v = {env.vehicle.speed:.1f} m/s     "
            f"y = {env.scene['z'][1] - env.scene['y_target']:+.2f} m     law: {env.episode.authority.law}     "
            f"fault: {'active' if noted['fault_active'] else 'none'}",
            (14, top + 10),
        )
        for i, (name, key, colour) in enumerate(
            (
                ("longitudinal risk r_x", "r_x", RISK),
                ("lateral risk r_y", "r_y", RISK),
                ("authority alpha_a", "alpha_a", AUTHORITY),
            )
        ):
            self._bar(name, float(noted[key]), (14, top + 42 + 36 * i), 0.32 * width, colour, False)
        limits = env.parameters["limits"]
        for channel, (title, text, bound) in enumerate(
            (
                ("acceleration", _acceleration, float(limits["a_max"])),
                # Steering to the left is positive; the negative bound makes its bar point to the left.
                ("steering", _steering, -float(limits["delta_max"])),
            )
        ):
            left = (0.37 + 0.32 * channel) * width
            for i, (name, key, colour) in enumerate(
                (
                    ("automation", "u_a_des", AUTOMATION),
                    ("degraded", "u_a_f", DEGRADED),
                    ("limited", "u_a_act", LIMITED),
                    ("driver", "u_h_act", DRIVER),
                )
            ):
                value = float(noted[key][channel])
                self._bar(
                    f"{title}, {name}: {text(value)}",
                    value / bound,
                    (left, top + 42 + 36 * i),
                    0.3 * width,
                    colour,
                    True,
                )

    def _bar(
        self,
        label: str,
        value: float,
        corner: tuple[float, float],
        width: float,
        colour: tuple[int, int, int],
        centred: bool,
    ) -> None:
        """Draw a labelled bar for a value in [0, 1], or for a value in [-1, 1] about the middle."""
        x, y = corner
        self._write(label if centred else f"{label} = {value:.2f}", (x, y))
        pygame.draw.rect(self.frame_surface, FAINT, (x, y + 17, width, 9))
        value = min(max(value, -1.0), 1.0)
        if centred:
            middle = x + 0.5 * width
            length = 0.5 * width * abs(value)
            pygame.draw.rect(self.frame_surface, colour, (middle if value > 0 else middle - length, y + 17, length, 9))
            pygame.draw.line(self.frame_surface, INK, (middle, y + 15), (middle, y + 27))
        else:
            pygame.draw.rect(self.frame_surface, colour, (x, y + 17, width * value, 9))

    def _write(self, text: str, corner: tuple[float, float]) -> None:
        self.frame_surface.blit(self.font.render(text, True, INK), corner)


def _acceleration(value: float) -> str:
    return f"{round(value, 2) + 0.0:+.2f} m/s2"


def _steering(value: float) -> str:
    degrees = round(np.degrees(value), 2)
    side = "left" if degrees > 0.0 else "right" if degrees < 0.0 else ""
    return f"{abs(degrees):.2f} deg {side}"


def _curved(chain: np.ndarray, spacing: float = 2.0) -> np.ndarray:
    """A boundary without repeated points, resampled every ``spacing`` [m] so that it bends with the road."""
    steps = np.hypot(*np.diff(chain, axis=0).T)
    chain = chain[: np.count_nonzero(steps) + 1]
    pieces = [
        np.linspace(a, b, max(2, int(np.hypot(*(b - a)) / spacing) + 1))
        for a, b in zip(chain[:-1], chain[1:], strict=True)
    ]
    return np.vstack(pieces) if pieces else chain
