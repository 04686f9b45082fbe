"""Lens files: TOML, .zmx, and the JSON of optiland and DeepLens, read and written by suffix.

In the order in which data flows:

- `zmx_records`: the lines of a .zmx file, sorted into system and surfaces
- `zmx_completion`: what a .zmx file leaves out
- `zmx_glass`: glasses named as .zmx files name them
- `zmx_surface`: one surface of a .zmx file
- `zmx_field`: fields of any type as field angles
- `wavelength_weights`: the wavelengths that count
- `zmx_configurations`: each configuration of a .zmx file as a file of its own
- `zmx_reader`: a .zmx file as a `Lens`, with notes on what was left out
- `zmx_configuration_writer`: fields and configurations as lines of a .zmx file
- `zmx_writer`: a `Lens` as a .zmx file
- `json_table`: values of lens files in JSON
- `optiland_glass`: glasses as optiland's JSON has them
- `optiland_reader`: a JSON file of optiland as a `Lens`
- `optiland_writer`: a `Lens` as a JSON file of optiland
- `deeplens_reader`: a JSON file of DeepLens as a `Lens`
- `states`: a lens with configurations, and the lens in one of them
- `placing`: a lens stopped and focused, and where its objects lie
- `lens_file`: read or write a lens by the suffix of its file
"""
