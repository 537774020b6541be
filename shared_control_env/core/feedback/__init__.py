"""Outputs of a step: observation, reward and info."""
