"""Search and improvement of lenses: free numbers, merits of spots, damped least squares.

- `variables`: which numbers of a lens are free; batches of lenses as tensors
- `beam_launch`: rays of a batch of lenses, by the paraxial entrance pupil
- `spot_residuals`: residuals of spots, three merits
- `limits`: residuals of what a lens must not be: too thin, too steep, losing rays
- `penalty`: what keeps a design where rays pass
- `problem`: merit and limits of a batch of lenses, as one residual function
- `least_squares`: damped least squares on a batch of starts
- `finish`: a found lens made into a prescription
- `splat`: PSFs of a batch in the colours of a sensor
- `improvement`: a given lens made better
- `joint_states`: several configurations of a lens as one problem
- `own_frame`: its vignetting, and limits no stricter than it keeps
"""
