"""High dynamic range.

- `night_gallery`: a night photographed through a plate and read back, as pictures
- `glare_twin`, `glare_bundle`: streaks of a windshield, and the bundle that removes them
"""
