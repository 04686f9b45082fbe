"""RAW frames are decoded in this process: a child for each would take most of the time."""

from functools import partial

import pytest

from camkit.runtime.merging import survey


@pytest.fixture(autouse=True)
def _decoded_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(survey, "read_capture", partial(survey.read_capture, isolate=False))
