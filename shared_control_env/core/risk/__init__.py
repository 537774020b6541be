"""Risk assessment of the degraded automation (Section III)."""
