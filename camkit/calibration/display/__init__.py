"""A display as the photographed object: its targets, and captures of them as pairs for training.

displayed_picture  pictures as light, upright, whatever their profile
marks      blocks in the corners of a screen that say which target it shows, drawn and found
screen     where things lie on a screen: marks, picture, board
targets    all that is shown, drawn, written, and read back
camera_file  what `camkit calibrate geometry`, `tone` and `flat` found, for captures
view         a capture as grey light, and where each pixel would lie without distortion
sorting    which capture shows which target, and about where
alignment  from the marks' tenth of a cell to a hundredth of a pixel, by the picture itself
tiles      what is left between capture and picture, place by place
primaries  the colours of the display as the camera sees them
reference  the shown picture in the geometry of the capture, without distortion
pairs      all of it: captures and targets to a folder that `camkit train --pairs` reads
"""
