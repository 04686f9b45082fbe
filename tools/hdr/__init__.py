"""High dynamic range.

- `leave_one_out`: merging of brackets beside OpenCV's, frame by frame predicted from the others
"""
