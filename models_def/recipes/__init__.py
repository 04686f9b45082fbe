"""Cameras, training and lens searches as TOML; unknown keys are errors."""
