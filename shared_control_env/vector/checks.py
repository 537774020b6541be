"""Checks of what users pass to the vectorised environment: actions, masks, seeds, modes and settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode

from shared_control_env.controllers.arrays import as_array
from shared_control_env.core.risk.triangulation import MAX_HOLES
from shared_control_env.envs import settings as configuration
from shared_control_env.envs.scenarios import Scenario
from shared_control_env.envs.seeds import checked_seed
from shared_control_env.envs.settings import OWN_TRAFFIC, Settings
from shared_control_env.envs.slots import AUTHORITY, BOUNDS, DRIVER, SLACK, TAKEN, Clipping

ONE_FOR_ALL = ("simulation_frequency", "policy_frequency", "duration", "other_vehicles_type", "reward_terms")
"""Settings that must be equal in all environments."""


class Actions(NamedTuple):
    """Both slots of the actions of all environments.

    Attributes:
        commands: the driver's commands as shares of their limits, zeros where a driver is bound, shape (N, 2) [-].
        alphas: authorities over acceleration and steering, NaN where an allocator is bound, shape (N, 2) [-].
    """

    commands: np.ndarray
    alphas: np.ndarray


class OpenSlots:
    """The slots of the action that are not bound, and the check of their values.

    Args:
        num_envs: number of environments N.
        slots: names of the open slots.

    Attributes:
        num_envs: number of environments N.
        slots: names of the open slots.
        no_actions: actions with both slots bound.
        clipping: counts the values beyond their bounds.
    """

    def __init__(self, num_envs: int, slots: tuple[str, ...]) -> None:
        self.num_envs, self.slots = num_envs, slots
        self.no_actions = Actions(np.zeros((num_envs, 2)), np.full((num_envs, 2), np.nan))
        self.clipping = Clipping(num_envs)

    def checked(self, actions: Any) -> Actions:
        """Check the actions of one step, and fill the bound slots.

        Args:
            actions: values of the open slot, shape (N, size) [-], or a dict of both slots.

        Returns:
            Commands and authorities of all environments.

        Raises:
            ValueError: if a slot is missing, its shape is wrong, or an entry is not finite.
        """
        n = self.num_envs
        given = actions if len(self.slots) == 2 else dict.fromkeys(self.slots, actions)
        if len(self.slots) == 2 and (not isinstance(actions, dict) or set(actions) != set(self.slots)):
            raise ValueError(f"actions must be a dict with the keys {sorted(self.slots)}, each of shape ({n}, n)")
        values = {DRIVER: self.no_actions.commands, AUTHORITY: self.no_actions.alphas}
        for slot in self.slots:
            low, high, size = BOUNDS[slot]
            array = _numbers(given[slot])
            if array is None or array.shape not in [(n, taken) for taken in TAKEN[slot]]:
                what = f"shape {array.shape}" if array is not None else f"the value {given[slot]!r}"
                raise ValueError(f"actions[{slot!r}] has {what}; it must be numbers of shape ({n}, {size})")
            finite = np.isfinite(array)
            if not finite.all():
                index = int(np.argwhere(~finite)[0, 0])
                raise ValueError(
                    f"action of environment {index}, slot {slot!r}, is {array[index]}; "
                    f"it must be finite, in [{low:g}, {high:g}]"
                )
            self.clipping.note(slot, array, bool(array.max() > high + SLACK or array.min() < low - SLACK))
            values[slot] = np.repeat(array, 2, axis=1) if array.shape[1] == 1 else array
        return Actions(values[DRIVER], values[AUTHORITY])


def checked_mask(mask: Any, num_envs: int, started: bool) -> np.ndarray:
    """Check the mask of a reset.

    Args:
        mask: the mask that the user gave; None for all environments.
        num_envs: number of environments.
        started: whether all environments have been reset before.

    Returns:
        Mask of the environments to reset, a new bool array of shape (num_envs,).

    Raises:
        ValueError: if the mask is no bool array of this shape, is False everywhere, or omits an environment at the
            first reset.
    """
    if mask is None:
        return np.ones(num_envs, dtype=bool)
    given, mask = mask, np.asarray(mask)
    if mask.shape != (num_envs,) or mask.dtype != np.bool_:
        raise ValueError(f"options['reset_mask'] = {given!r} must be a bool array of shape ({num_envs},)")
    if not mask.any():
        raise ValueError("options['reset_mask'] names no environment; at least one entry must be True")
    if not started and not mask.all():
        raise ValueError("options['reset_mask'] must name every environment at the first reset")
    return mask.copy()


def checked_generators(
    seed: int | Sequence[int | None] | None, num_envs: int
) -> list[tuple[np.random.Generator, int] | None]:
    """Generator and seed of each environment; None for an environment without a given seed.

    Args:
        seed: an integer, so that environment i gets seed + i, or one seed for each environment.
        num_envs: number of environments.

    Raises:
        ValueError: for an invalid seed, or a wrong number of seeds.
    """
    if seed is None:
        return [None] * num_envs
    one = np.ndim(seed) == 0  # type: ignore[arg-type]
    seeds: Any = [checked_seed(seed) + i for i in range(num_envs)] if one else seed  # type: ignore[operator]
    if isinstance(seeds, str) or not hasattr(seeds, "__len__") or len(seeds) != num_envs:
        raise ValueError(f"seed = {seed!r} must be an integer, or have one for each of {num_envs} environments")
    numbers = [checked_seed(value, f"seed of environment {i}") for i, value in enumerate(seeds)]
    return [None if number is None else seeding.np_random(number) for number in numbers]


def checked_count(name: str, value: Any, otherwise: str = "") -> int:
    """Check a count, which is an integer of at least 1.

    Args:
        name: name of the argument, for the error message.
        value: the value that the user gave.
        otherwise: text for the error message about other allowed values.

    Raises:
        ValueError: if the value is no integer of at least 1.
    """
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < 1:
        raise ValueError(f"{name} = {value!r} must be an integer of at least 1{otherwise}")
    return int(value)


def checked_mode(mode: AutoresetMode | str) -> AutoresetMode:
    """Convert an autoreset mode to Gymnasium's enumeration.

    Args:
        mode: the mode, its name or its value, such as ``same_step`` or ``SameStep``.

    Raises:
        ValueError: for an unknown mode.
    """
    if isinstance(mode, AutoresetMode):
        return mode
    spellings = {each.name.lower().replace("_", ""): each for each in AutoresetMode}
    text = str(mode).lower().replace("_", "").replace("-", "")
    if text not in spellings:
        names = [each.name.lower() for each in AutoresetMode]
        raise ValueError(f"autoreset_mode = {mode!r} must be an AutoresetMode or one of {sorted(names)}")
    return spellings[text]


def settings_for_kernel(scenario: Scenario, config: Mapping[str, Any]) -> Settings:
    """Settings of a scenario with changes, after all checks, including those for the kernel.

    Args:
        scenario: scenario that provides the defaults.
        config: changes to the settings.

    Raises:
        ValueError: for a wrong setting, or a setting that only the single environment supports.
    """
    settings = configuration.combined(scenario.settings, config)
    _check_for_kernel(settings)
    return settings


def changed_settings(config: Any, settings: Settings, templates: Sequence[Settings]) -> tuple[Settings, list[Settings]]:
    """Apply changes to the settings of all environments, or separate changes to those of each environment.

    Args:
        config: changes for all environments, a dict; or a list with one dict for each environment.
        settings: present common settings.
        templates: present settings of each environment.

    Returns:
        The changed common settings, and the changed settings of each environment. A list leaves the common settings
        unchanged.

    Raises:
        ValueError: for a wrong setting, or different values of a setting that all environments share.
    """
    n = len(templates)
    if isinstance(config, Mapping):
        changed, entries = _merged(settings, config), [config] * n
    elif isinstance(config, list | tuple) and len(config) == n:
        changed, entries = settings, list(config)
    else:
        raise ValueError(
            f"options['config'] = {config!r} must be a dict, or a list of one for each of {n} environments"
        )
    _check_for_kernel(changed)
    if changed.observation != settings.observation:
        raise ValueError(
            f"config['observation']['type'] = {changed.observation.type!r}: the spaces of these environments are made "
            f"for {settings.observation.type!r}; make new ones"
        )
    merged = {(id(settings), id(config)): changed}
    new = []
    for template, entry in zip(templates, entries, strict=True):
        key = id(template), id(entry)
        if key not in merged:
            merged[key] = _merged(template, entry)
        new.append(merged[key])
    for i, template in enumerate(new):
        for name in (*ONE_FOR_ALL, "observation"):
            if getattr(template, name) != getattr(changed, name):
                raise ValueError(f"options['config'][{i}][{name!r}] must be that of all environments")
        if len(template.vehicles) != len(changed.vehicles):
            raise ValueError(f"options['config'][{i}]['vehicles'] must have as many entries as in all")
    return changed, new


def check_shared_settings(settings: Settings, present: Settings) -> None:
    """Check that new settings keep what running environments share.

    Args:
        settings: new settings.
        present: settings of the running episodes.

    Raises:
        ValueError: if a shared setting or the number of vehicles differs.
    """
    for name in ONE_FOR_ALL:
        if getattr(settings, name) != getattr(present, name):
            raise ValueError(
                f"config[{name!r}] = {getattr(settings, name)!r} is shared by all environments, and some of them are "
                "in the middle of an episode; change it by reset(options={'config': ...})"
            )
    if len(settings.vehicles) != len(present.vehicles):
        raise ValueError(
            f"config['vehicles'] has {len(settings.vehicles)} entries, but {len(present.vehicles)} at present; "
            "change their number by reset(options={'config': ...})"
        )


def _merged(settings: Settings, changes: Mapping[str, Any]) -> Settings:
    """Settings with changes, after the check."""
    return configuration.check(configuration.change(configuration.plain(settings), changes))


def _check_for_kernel(settings: Settings) -> None:
    """Raise ValueError for settings that only the single environment supports."""
    if settings.other_vehicles_type != OWN_TRAFFIC:
        raise ValueError(
            f"config['other_vehicles_type'] = {settings.other_vehicles_type!r} is not in the kernel; allowed is "
            f"{OWN_TRAFFIC!r}; for others use gym.make_vec(..., vectorization_mode='sync')"
        )
    for i, entry in enumerate(settings.randomise):
        if entry.setting in ONE_FOR_ALL:
            raise ValueError(
                f"config['randomise'][{i}]['setting'] = {entry.setting!r} is shared by all environments of the kernel, "
                "so it cannot be drawn; use gym.make_vec(..., vectorization_mode='sync')"
            )
    if len(settings.vehicles) > MAX_HOLES:
        raise ValueError(f"config['vehicles'] has {len(settings.vehicles)} entries; the kernel takes 0 to {MAX_HOLES}")


def _numbers(value: Any) -> np.ndarray | None:
    """A new array of real numbers; None if the value is not numeric."""
    try:
        array = np.asarray(as_array(value))
    except ValueError:  # rows of different lengths
        return None
    return array.astype(np.float64) if array.dtype.kind in "fiub" else None
