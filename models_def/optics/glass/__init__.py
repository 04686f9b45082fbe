"""Glasses: refractive indices by strict name, each with its source.

In the order in which data flows:

- `data/*.json`: catalogues of glass makers and of the literature (made by `tools/build_glass.py`)
- `material`: one glass: formula, coefficients, valid wavelengths
- `encoding`: text of files from other programs, whatever its encoding
- `agf`: the reader of a user's catalogue file
- `model_glass`: glasses known only by index and Abbe number
- `catalogue`: named sets of glasses; finding one by name
- `table`: glasses written into a prescription
- `dispersion`: the index at a wavelength
- `nearness`: glasses near in index and Abbe number
"""
