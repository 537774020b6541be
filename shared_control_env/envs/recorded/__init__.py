"""Recorded traffic: readers, smoothing, the road along the ego's lane, and the tracks that the kernel replays."""
