"""Settings of all tests: examples do not change from run to run, and compiling does not count as slow."""

from hypothesis import settings

settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable")
