"""A camera in one command: `camkit.make` and `camkit make`.

work_folder     steps that are done once, and what they took
camera_steps    lens -> recipe -> PSF -> filter -> network -> bundle
camera_judging  developed, filter and network on the same captures
camera_page     what was made, for people
making_run      the steps in their order, within the minutes
camera_making   `camkit.make`, which needs torch only when it is called
"""
