"""A bundle proves what it says about itself."""
