"""Changes to settings: a deep merge in plain types that also removes random draws of the changed settings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from shared_control_env.nearest import hint


def as_plain(value: Any) -> Any:
    """Convert a value of a configuration to built-in Python types.

    Args:
        value: mapping, sequence, NumPy number or array, or tensor; any other value is returned unchanged.
    """
    if isinstance(value, Mapping):
        return {key: as_plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [as_plain(item) for item in value]
    return value.tolist() if hasattr(value, "tolist") else value


def merge(config: dict[str, Any], changes: Mapping[str, Any], path: str = "config") -> dict[str, Any]:
    """Merge nested changes into a config. Lists are replaced as a whole.

    Args:
        config: settings as a plain dict.
        changes: nested dict of changes; None removes an optional section.
        path: path of the settings for error messages.

    Returns:
        The merged settings, a new dict.

    Raises:
        ValueError: for an unknown key, with the nearest valid key.
    """
    if not isinstance(changes, Mapping):
        raise ValueError(f"{path} = {changes!r} must be a dict with keys among {sorted(config)}")
    merged = dict(config)
    for key, value in changes.items():
        if key not in config:
            raise ValueError(f"{path}[{key!r}] is not a setting; {hint(key, config)}")
        if isinstance(config[key], dict) and value is not None:
            if not isinstance(value, Mapping):
                raise ValueError(f"{path}[{key!r}] = {value!r} must be a dict with keys among {sorted(config[key])}")
            value = merge(config[key], value, f"{path}[{key!r}]")
        merged[key] = as_plain(value)
    return merged


def named(
    changes: Mapping[str, Any], config: Mapping[str, Any], path: tuple[str, ...] = ()
) -> Iterator[tuple[str, ...]]:
    """Paths of the settings that the changes name. Sections are split into their fields; other values are not split.

    Args:
        changes: nested dict of changes.
        config: the settings to be changed.
        path: path of the section that ``changes`` belongs to.
    """
    for key, value in changes.items():
        if isinstance(value, Mapping) and isinstance(config.get(key), Mapping):
            yield from named(value, config[key], (*path, key))
        else:
            yield (*path, key)


def at(config: Any, path: tuple[str, ...]) -> Any:
    """The setting at a path.

    Args:
        config: settings as a plain dict.
        path: keys, and indices of lists as text.

    Raises:
        ValueError: if there is no such setting, with the wrong part of the path and the nearest valid key.
    """
    for key in path:
        if isinstance(config, list) and key.isdigit() and str(int(key)) == key and int(key) < len(config):
            config = config[int(key)]
        elif isinstance(config, Mapping) and key in config:
            config = config[key]
        else:
            keys = range(len(config)) if isinstance(config, list) else config if isinstance(config, Mapping) else ()
            raise ValueError(f"no setting {key!r}; {hint(key, keys)}")
    return config


def difference(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """The changes from one config to another, so that ``merge(old, changes)`` equals the new config.

    Args:
        old: settings before the changes.
        new: settings after the changes.

    Raises:
        ValueError: if the new config lacks a setting.
    """
    for key in old:
        if key not in new:
            raise ValueError(f"config lacks {key!r}; a setting can be changed, not removed")
    changes: dict[str, Any] = {}
    for key, value in new.items():
        before = old.get(key)
        if isinstance(value, Mapping) and isinstance(before, Mapping):
            if inner := difference(before, value):
                changes[key] = inner
        elif key not in old or as_plain(value) != before:
            changes[key] = value
    return changes


def change(config: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Merge a user's changes into a config. Settings that the changes name are no longer drawn at random.

    Args:
        config: settings as a plain dict.
        changes: nested dict of changes.

    Returns:
        The changed settings, a new dict.

    Raises:
        ValueError: for an unknown key; or if the changes give a setting a new value and also list it in ``randomise``.
    """
    merged = merge(config, changes)
    paths = {".".join(path): path for path in named(changes, config)}
    if "randomise" not in changes:
        merged["randomise"] = [entry for entry in config["randomise"] if not _concerns(entry["setting"], paths)]
        return merged
    entries = merged["randomise"] if isinstance(merged["randomise"], list) else []
    for i, entry in enumerate(entries):
        setting = entry.get("setting") if isinstance(entry, Mapping) else None
        if isinstance(setting, str) and setting in paths and at(merged, paths[setting]) != at(config, paths[setting]):
            raise ValueError(
                f"config['randomise'][{i}] draws {setting!r}, which is set to {at(merged, paths[setting])!r} too; "
                "remove one of the two"
            )
    return merged


def _concerns(setting: str, paths: Mapping[str, Any]) -> bool:
    """Whether a drawn setting is one of the named settings, or a part of one."""
    return any(setting == path or setting.startswith(f"{path}.") for path in paths)


def _refuse(self: Any, *arguments: Any, **more: Any) -> Any:
    raise TypeError("this config is read only; settings are changed by reset(options={'config': ...})")


class ReadOnly(dict[str, Any]):
    """A read-only dict of settings, nested dicts and lists included. Changes would have no effect, so they raise.

    Args:
        values: settings as a plain dict.
    """

    def __init__(self, values: Mapping[str, Any]) -> None:
        super().__init__({key: _read_only(value) for key, value in values.items()})

    __setitem__ = __delitem__ = __ior__ = update = setdefault = pop = popitem = clear = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles and copies become plain dicts, which may be changed."""
        return dict, (list(self.items()),)


class ReadOnlyList(list[Any]):
    """A read-only list in a :class:`ReadOnly` dict."""

    __setitem__ = __delitem__ = __iadd__ = __imul__ = append = extend = insert = pop = remove = clear = _refuse
    sort = reverse = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles and copies become plain lists, which may be changed."""
        return list, (tuple(self),)


def _read_only(value: Any) -> Any:
    if isinstance(value, Mapping):
        return ReadOnly(value)
    return ReadOnlyList(map(_read_only, value)) if isinstance(value, list) else value
