"""Launch points of rays that pass wanted points of the stop."""
