"""The extras of the package: what each is for, and what of it is not installed."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, requires, version

from packaging.requirements import Requirement

PACKAGE = "shared_control_env"

EXTRAS = {
    "benchmark": "the command shared-control: benchmark, controllability, reports, videos",
    "drive": "a person at the wheel in the browser, and studies with people",
    "wheel": "a steering wheel that the server reads itself (Linux)",
    "minari": "datasets of recorded drives",
    "train": "training with Stable-Baselines3",
    "ray": "the benchmark on a Ray cluster",
    "rllib": "training with RLlib, in a virtual environment of its own",
    "experiments": "everything that make reproduce needs",
    "docs": "the documentation as web pages",
    "dev": "the tests",
}
"""Extras by name, with what they are for."""


def missing_for(extra: str) -> list[str]:
    """Names of the distributions that an extra needs and that are not installed here in a version that fits.

    Args:
        extra: key of :data:`EXTRAS`.
    """
    missing = []
    for text in requires(PACKAGE) or ():
        requirement = Requirement(text)
        if requirement.marker is None or not requirement.marker.evaluate({"extra": extra}):
            continue
        if requirement.name.replace("-", "_") == PACKAGE:
            missing += [name for other in requirement.extras for name in missing_for(other)]
        elif not _is_installed(requirement):
            missing.append(requirement.name)
    return list(dict.fromkeys(missing))


def _is_installed(requirement: Requirement) -> bool:
    try:
        return requirement.specifier.contains(version(requirement.name), prereleases=True)
    except PackageNotFoundError:
        return False
