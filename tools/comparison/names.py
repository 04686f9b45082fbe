"""Names of the rows of the comparison, and what they are called in tables."""

from typing import Final

CLASSICAL: Final = ("skimage_wiener", "skimage_rl", "admm_tv")
TITLES: Final = {
    "input": "input (developed only)",
    "skimage_wiener": "scikit-image Wiener",
    "skimage_rl": "scikit-image Richardson-Lucy",
    "admm_tv": "ADMM-TV",
    "cross_channel": "cross-channel",
    "bank": "our Wiener bank",
    "bank_rl": "our blocks, Richardson-Lucy",
    "bank_admm_tv": "our blocks, ADMM-TV",
    "S": "network S",
    "M": "network M",
    "L": "network L",
}
EARLIER: Final = " before"
"""Ends the name of a row of the bundle that was there before."""


def title_of(name: str) -> str:
    """Return what a row is called in tables."""
    plain = name.removesuffix(EARLIER)
    return TITLES.get(plain, plain) + name[len(plain) :]
