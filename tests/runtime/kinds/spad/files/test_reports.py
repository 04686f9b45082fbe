"""Captures made after public bug reports are read rightly, or asked about."""

import numpy as np
import pytest

from camkit.errors import ContractError, DecodeError
from camkit.runtime.kinds.spad.files.counts_file import Hints
from camkit.runtime.kinds.spad.files.open_counts import open_counts
from tests.data_folder import data_path


def test_a_stream_of_two_detectors_is_asked_about() -> None:
    path = data_path("reports/spc_two_detectors.spc")
    with pytest.raises(ContractError, match="holds channel 0, channel 1; choose one"):
        open_counts(path, Hints())
    for key, photons in (("channel 0", 3000), ("channel 1", 4000)):
        with open_counts(path, Hints(key=key)) as file:
            assert file.rows(0, 1, np.arange(4097) - 0.5).sum() == photons


def test_a_stack_of_two_channels_is_asked_about() -> None:
    path = data_path("reports/tiff_stack_two_channels.tif")
    with pytest.raises(ContractError, match="holds channel 0, channel 1; choose one"):
        open_counts(path, Hints())
    with open_counts(path, Hints(key="channel 0")) as file:
        assert file.bins == 64
        assert np.argmax(file.rows(0, file.height).sum(axis=(0, 1))) == 20  # 2000 ps


def test_a_period_keeps_its_empty_last_bins() -> None:
    with open_counts(data_path("reports/ptu_empty_last_bins.ptu"), Hints()) as file:
        assert file.bins == 256


def test_a_damaged_header_is_refused_in_one_line() -> None:
    with pytest.raises(DecodeError, match="its header is damaged"):
        open_counts(data_path("reports/broken_header.npz"), Hints())
