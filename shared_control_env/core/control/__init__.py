"""The controllers: the automation's (Eq. 12, 13), the driver's (Eq. 14-16), and the person around the latter."""
