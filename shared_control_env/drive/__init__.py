"""A person at the wheel: an episode in real time, driven in the browser or with a wheel (extra ``drive``).

The server owns the time and the model; the page draws and sends what the device reads. :mod:`drive.session` is one
episode, :mod:`drive.rig` what the page asks for, :mod:`drive.server` the connection, :mod:`drive.study` an experiment.
"""
