"""Identification of a driver's arm, K_h and T_h of Eq. 16, from recorded drives (the paper's Table IV)."""
