"""Drivers that are trained; drivers that follow rules are in :mod:`shared_control_env.controllers.scripted`."""
