"""Plates as TOML; read by `camkit.models_def.optics.diffraction.plate`."""
