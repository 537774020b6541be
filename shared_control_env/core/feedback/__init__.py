"""What a step gives back: observation, reward and info."""
