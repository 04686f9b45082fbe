"""The thesis's way to snapshot HDR (Sun 2021, chapter 5) trained in this house, to compare with.

star         what a windshield writes beside a light
coded_samples   captures behind a plate, the bare lens or a windshield, and the layers within
layers       what its networks are made of; tables 5.1 to 5.3
splitting    a capture into the picture without streaks, and the streaks
highlight    the lights of the streaks
fusion       picture and lights put together
chain        all three in a row
networks     the same between planes of roots, by name
thesis_losses   eqs. (5.6) to (5.11)
thesis_fitter   one step by these losses
validation   fixed captures to choose by

Planes of these samples are the square roots of linear light, 1.0 = white.
"""
