"""The signal before and behind the restoration, in the order of one photograph.

tone_curve    codes of developed pictures to light
halves        two halves of dual pixels as one capture
binned_capture    a mosaic as smaller planes, averaged over squares
noise         noise of a capture that states none; repair of broken samples
glow          whether a sample that stands out is light
demosaic      mosaic to three planes
directional   its slower, better method
stabilise     k-sigma and square root around the network
"""
