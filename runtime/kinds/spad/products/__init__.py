"""Products of counts: arrays first, and pictures for people beside them.

settings   what the caller chose, with the timing file
survey     an open capture with its axis and pulse: what every product begins with
strips     in how many rows at once a capture is worked through
depth      depth, time of flight, amplitude and what goes with them
intensity  pictures and frames of counts
transient  light in flight
lifetime   how long fluorescence takes to fade
archive    NAME.npz
points     NAME.ply
preview    NAME.png
video      NAME.mp4
picture    NAME.exr, NAME.tif
"""
