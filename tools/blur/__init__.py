"""The measurement of `camkit calibrate blur`, judged where the truth is known or photographed.

transfer_error  a measured PSF beside the frozen one it was measured from
duet_blur       captures of duet from pictures, their blur measured, other captures restored by it
real_lens_blur  photographs of a real lens at f/4, restored by what they show of it, against f/20
"""
