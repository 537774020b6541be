"""The controllers: the automation (Eq. 12, 13), the driver (Eq. 14-16), and the model of a person at the wheel."""
