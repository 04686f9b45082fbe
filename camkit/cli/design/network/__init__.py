"""`camkit network`: trained networks of others, looked at and added to a camera."""
