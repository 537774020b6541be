"""Drivers that are trained; those that follow rules are in :mod:`shared_control_env.controllers.scripted`."""
