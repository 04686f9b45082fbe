"""Types that checkers see of `camkit.load` and `camkit.process`: their keywords."""
