"""Lenses as TOML; read by `camkit.models_def.optics.prescription`."""
