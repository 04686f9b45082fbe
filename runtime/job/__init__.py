"""The work on one capture.

setup           what all captures of a pipeline share
choices         options held against what a camera can do with them
kind_capture    a capture of any kind, as the engine sees it
coarse_cells    a capture in coarse cells, for stages that look at all of it first
job             what is known of the capture, made once
log             what is found of it on the way
photograph      what is known of a photograph, and planned for it
stage_work      a stage made ready
stream          a plane on its way from one stage to the next
meter           progress, and the wish to stop
walker          the stages joined, given their share of memory, rows pulled through them
reconstruction  planned, then walked: bands of a product
"""
