"""The check that the packages are there which charts, pages and scores of pictures need.

`camkit process` uses none of them, so they are an extra.
"""

from camkit.entry_points import JUDGE, require_packages


def require_judge() -> None:
    """Raise an error that says how to install what is missing.

    Raises:
        UnsupportedError: If matplotlib or scikit-image cannot be imported.
    """
    require_packages("pages, charts and scores of pictures need", "judge", JUDGE)
