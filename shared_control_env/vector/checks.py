"""What users give the vectorised environment, checked: actions, masks, seeds, modes and settings."""

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
from shared_control_env.envs.slots import AUTHORITY, DRIVER, SLACK, SLOT_SPACES, Clipping

ONE_FOR_ALL = ("simulation_frequency", "policy_frequency", "duration", "other_vehicles_type", "reward_terms")
"""Settings that all environments share."""


class Actions(NamedTuple):
    """Both slots of every environment's action; zeros for a bound one.

    Attributes:
        commands: driver's commands over their limits, (N, 2).
        alphas: authorities, (N, 1).
    """

    commands: np.ndarray
    alphas: np.ndarray


class OpenSlots:
    """The slots of the action that nobody bound, and the check of what is given for them.

    Args:
        num_envs: of how many environments.
        slots: names of the open ones.
    """

    def __init__(self, num_envs: int, slots: tuple[str, ...]) -> None:
        self.num_envs, self.slots = num_envs, slots
        self.nothing = Actions(np.zeros((num_envs, 2)), np.zeros((num_envs, 1)))
        self.clipping = Clipping(num_envs)
        self._bounds = {slot: (SLOT_SPACES[slot].low[0], SLOT_SPACES[slot].high[0]) for slot in slots}

    def checked(self, actions: Any) -> Actions:
        """Commands and authorities of one step, with zeros for what is bound.

        Args:
            actions: of the open slot, or a dict of both.

        Raises:
            ValueError: if a slot is missing, or has another shape, or an entry is not finite.
        """
        n = self.num_envs
        given = actions if len(self.slots) == 2 else dict.fromkeys(self.slots, actions)
        if len(self.slots) == 2 and (not isinstance(actions, dict) or set(actions) != set(self.slots)):
            raise ValueError(f"actions must be a dict with the keys {sorted(self.slots)}, each of shape ({n}, n)")
        values = {DRIVER: self.nothing.commands, AUTHORITY: self.nothing.alphas}
        for slot in self.slots:
            size, (low, high) = SLOT_SPACES[slot].shape[0], self._bounds[slot]
            array = _numbers(given[slot])
            if array is None or array.shape != (n, size):
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
            values[slot] = array
        return Actions(values[DRIVER], values[AUTHORITY])


def checked_mask(mask: Any, num_envs: int, started: bool) -> np.ndarray:
    """The environments that a reset names, a new array of shape (num_envs,).

    Args:
        mask: as given; None for all.
        num_envs: how many there are.
        started: whether all have been reset before.

    Raises:
        ValueError: if it is no bool array of this shape, or names none, or leaves any out at the first reset.
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
    """Generator and seed of each environment, None where none is given.

    Args:
        seed: one for all, which counts up from environment to environment, or one for each.
        num_envs: how many there are.

    Raises:
        ValueError: for what is no seed, or another number of them.
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
    """A number of things, at least one.

    Args:
        name: of the argument.
        value: as given.
        otherwise: what else is allowed, for the message.

    Raises:
        ValueError: if it is no integer of at least 1.
    """
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < 1:
        raise ValueError(f"{name} = {value!r} must be an integer of at least 1{otherwise}")
    return int(value)


def checked_mode(mode: AutoresetMode | str) -> AutoresetMode:
    """Gymnasium's autoreset mode.

    Args:
        mode: itself, its name or its value, such as ``same_step`` or ``SameStep``.

    Raises:
        ValueError: for another.
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
    """Settings of a scenario with changes, checked, those too that the kernel alone refuses.

    Args:
        scenario: whose settings are the defaults.
        config: what differs.

    Raises:
        ValueError: for a wrong setting, or one that the single environment alone has.
    """
    default = configuration.merge(configuration.plain(Settings()), scenario.settings)
    settings = configuration.check(configuration.change(default, config))
    _check_for_kernel(settings)
    return settings


def changed_settings(config: Any, settings: Settings, templates: Sequence[Settings]) -> tuple[Settings, list[Settings]]:
    """Settings of all environments and of each, changed by a dict, or those of each by one entry of a list.

    Args:
        config: a dict, or a list of one for each.
        settings: of all so far.
        templates: of each so far.

    Raises:
        ValueError: for a wrong setting, or one that would differ where all environments share it.
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


def check_same_shape(settings: Settings, present: Settings) -> None:
    """Raise ValueError if settings change what environments in the middle of an episode share.

    Args:
        settings: new ones.
        present: those of the episodes under way.
    """
    for name in ONE_FOR_ALL:
        if getattr(settings, name) != getattr(present, name):
            raise ValueError(
                f"config[{name!r}] = {getattr(settings, name)!r} is shared by all environments, some of which are "
                "in the middle of an episode; change it by reset(options={'config': ...})"
            )
    if len(settings.vehicles) != len(present.vehicles):
        raise ValueError(
            f"config['vehicles'] has {len(settings.vehicles)} entries, and {len(present.vehicles)} now; "
            "their number is changed by reset(options={'config': ...})"
        )


def _merged(settings: Settings, changes: Mapping[str, Any]) -> Settings:
    """Settings with some changes, checked."""
    return configuration.check(configuration.change(configuration.plain(settings), changes))


def _check_for_kernel(settings: Settings) -> None:
    """Raise ValueError for settings that the single environment alone has."""
    if settings.other_vehicles_type != OWN_TRAFFIC:
        raise ValueError(
            f"config['other_vehicles_type'] = {settings.other_vehicles_type!r} is not in the kernel; allowed is "
            f"{OWN_TRAFFIC!r}; for others use gym.make_vec(..., vectorization_mode='sync')"
        )
    for i, entry in enumerate(settings.randomise):
        if entry.setting in ONE_FOR_ALL:
            raise ValueError(
                f"config['randomise'][{i}]['setting'] = {entry.setting!r} is shared by all environments of the kernel, "
                "so that it cannot be drawn; use gym.make_vec(..., vectorization_mode='sync')"
            )
    if len(settings.vehicles) > MAX_HOLES:
        raise ValueError(f"config['vehicles'] has {len(settings.vehicles)} entries; the kernel takes 0 to {MAX_HOLES}")


def _numbers(value: Any) -> np.ndarray | None:
    """A new array of real numbers, None where the value is something else."""
    try:
        array = np.asarray(as_array(value))
    except ValueError:  # rows of different lengths
        return None
    return array.astype(np.float64) if array.dtype.kind in "fiub" else None
