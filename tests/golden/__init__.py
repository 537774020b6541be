"""Golden rollouts: what every registered environment gives, to the bit; ``python -m tests.golden`` makes them anew."""
