"""Allocation of authority: from the risks to the automation's actual command (Section IV)."""
