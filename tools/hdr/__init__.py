"""High dynamic range.

- `night_gallery`: a night photographed through a plate and read back, as pictures
- `glare_twin`, `glare_bundle`: streaks of a windshield, and the bundle that removes them
- `tables`: optics and networks beside each other, tables 5.4 and 5.5 of the thesis; with `table`
"""
