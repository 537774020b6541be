"""Drivers that plug into :class:`shared_control_env.wrappers.DriverModel`."""
