"""Cameras of every kind are trained on one thread."""

from tests.one_thread import one_thread  # noqa: F401
