"""Measurements of speed, printed as ratios to peers measured in the same run; nothing here is a test."""
