"""RAW frames are decoded in this process."""

from tests.decoded_here import decoded_here  # noqa: F401
