"""The work on one capture.

setup           what all captures of a pipeline share
preparation     what is decided before the first row is computed
reconstruction  the stages joined, rows pulled through them
"""
