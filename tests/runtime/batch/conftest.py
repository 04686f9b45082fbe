"""RAW files are decoded in this process; workers of a cluster are processes of their own."""

from tests.decoded_here import decoded_here  # noqa: F401
