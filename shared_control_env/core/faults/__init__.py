"""Faults of the automation: degradations of its command and of its perception."""
