"""Settings of all tests: examples do not change from run to run, and compiling does not count as slow."""

import pytest
from hypothesis import settings

from shared_control_env.evaluation.additions import additions
from tests.browser import browser  # noqa: F401

settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable")


@pytest.fixture(scope="module", autouse=True)
def _nothing_stays_added():
    """Tests of one module do not depend on what another one has added to the tables of the package."""
    assert not additions()
    yield
    assert not additions()
