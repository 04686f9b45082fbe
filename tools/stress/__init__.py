"""What is drawn of stress reports."""
