"""Classes derived from highway-env: road, vehicles, viewer and environment base class."""
