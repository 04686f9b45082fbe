"""RAW files decoded in this process: a child for each would take most of a test's time; to import.

`tests/runtime/test_raw.py`, the examples and the faults decode in children, as users do.
"""

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest

from camkit.runtime import raw
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.files import decoder
from camkit.runtime.raw_worker import decode_raw


@pytest.fixture(autouse=True)
def decoded_here(monkeypatch: pytest.MonkeyPatch) -> None:
    def decoded(path: Path, _limits: object, options: MosaicOptions) -> Capture:
        return replace(decode_raw(path, options), sha256=raw.file_sha256(path))

    monkeypatch.setattr(raw, "_read_isolated", decoded)
    monkeypatch.setattr(decoder, "decoder_ahead", nullcontext)
