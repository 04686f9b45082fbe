"""Focal length, optical centre and distortion, from photographs of a checkerboard.

board       a board and the places of its inner corners
grey        a photograph of any kind as one grey plane
blur        how blurred the edges of a board are
saddle      corners that strong blur has rounded
detector    the corners of a board in a picture
corner_file  corners that were found before
camera_model      models from simple to rich, and where points fall
determination  parts of a camera that the views determine
adjustment  camera and poses that explain corners best
start       where that search starts, for every model
choice      the model by pictures left out, and views that contradict the others
coverage    where in the picture the board was seen
distortion_profile     distortion along a radius: known range, folds, the polynomial of `undistort`
unfolded    the model whose distortion does not fold inside the picture
geometry    all of it
"""
