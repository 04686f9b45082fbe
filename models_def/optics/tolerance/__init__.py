"""Fabrication errors of a lens: errors of surfaces and elements, and the light through them.

In the order in which data flows:

- `errors`: classes of errors, how wide each is, what assembly corrects
- `error_table`: the same from a TOML table
- `elements`: which surfaces are one piece of glass
- `deviation`: drawn errors of fabricated copies
- `pose`: where decentred and tilted surfaces stand
- `figure`: power and irregularity of surfaces, in fringes
- `misaligned_trace`: rays through such surfaces
- `refit`: least squares over landing points
- `fabricated`: copies as tensors, their beams aimed, traced and refocused
- `air_gap`: an air gap that is adjusted at assembly, so that rays land as in the design
- `landing`: spots and kernels of copies

`design.tolerance` puts the recovery behind them and draws the yield.
"""
