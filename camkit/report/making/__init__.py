"""A camera in one command: `camkit.make` and `camkit make`.

work_folder     steps that are done once, and what they took
camera_steps    lens -> recipe -> PSF -> filter -> network -> bundle
camera_judging  developed, filter and network on the same captures
camera_page     what was made, for people
camera_making   the steps in their order, within the minutes
"""
