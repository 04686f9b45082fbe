"""What type checkers see of `camkit.load` and `camkit.process`: their keywords."""
