"""High dynamic range.

- `network_costs`: parameters and multiplications of the thesis's networks and ours
- `leave_one_out`: merging of brackets beside OpenCV's, frame by frame predicted from the others
- `gallery`: a night photographed through a plate and read back, as pictures
- `coded_captures`: real captures through a plate read back, beside their bracket; with
  `coded_scene` (codes to light), `coded_registration` (bracket laid on capture), `coded_optics`
  (the measured PSF) and `coded_judge` (solved, simulated, scored)
- `glare_twin`, `glare_bundle`, `glare_table`: streaks of a windshield, the bundle that removes
  them, and what that gains
- `tables`: optics and networks beside each other, tables 5.4 and 5.5 of the thesis; with `table`
- `residue`: errors beside lamps, tints at their rims, networks over the solve
- `depths`, `moving_lamp`, `speed` (its captures: `speed_captures`): scenes refocused on, a bracket
  beside a snapshot, seconds against what clipped; `record`: what their numbers were measured with
"""
