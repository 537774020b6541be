"""An experiment with people: the plan, the order of the conditions, and the protocol from consent to export."""
