"""Plates that diffract, before an ordinary lens.

- `chirp_z`: a Fourier transform onto any grid
- `geometry`: source, lens and sensor, and the paths between them
- `wave`: a height map -> the PSF on the sensor's pixels
- `heights`: few numbers -> a height map
- `etching`: a height map -> levels, masks, errors of depth
- `gratings`: streaks that are wanted -> heights, in closed form
- `patterns`: height maps that a few numbers describe
- `map_numbers`: the numbers of a map as tensors, and the heights that follow
- `plate`: a plate as a file
- `references`: the plates to compare with, which come with camkit
- `shares`: where the light goes, and where the streaks lie
- `plate_optics`: a plate as freezing sees it, and its kernels as arrays
- `plate_streaks`, `streak_fit`: dense kernels as core, arms and haze
- `freezing`: its PSF, frozen as streaks or whole
- `pinhole`: a hole and no lens, by its shadow and its diffraction
"""
