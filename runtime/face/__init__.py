"""The public face at use time, for `camkit/__init__.py`.

keywords     options of `camkit.load` and `camkit.process`, as type checkers see them
simulation   `camkit.simulate`
"""
