"""What was measured about plates."""
