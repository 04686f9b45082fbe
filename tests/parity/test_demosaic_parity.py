import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.cfa import CFA_PATTERNS
from camkit.models_def.sensors import demosaic as in_torch
from camkit.runtime.signal import demosaic as in_numpy

TOLERANCE = 1e-6


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
@given(h=st.integers(3, 40), w=st.integers(3, 40))
@settings(deadline=None, max_examples=15)
def test_fast_demosaic_agrees_for_every_pattern_and_size(cfa, h, w):
    mosaic = np.random.default_rng(h * w).random((h, w), dtype=np.float32)
    twin = in_torch.demosaic(torch.from_numpy(mosaic)[None], cfa)[0].numpy()
    np.testing.assert_allclose(twin, in_numpy.demosaic(mosaic, cfa, "fast"), atol=TOLERANCE)


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
def test_demosaic_keeps_the_samples_it_has(cfa):
    planes = torch.rand((1, 3, 12, 14), generator=torch.Generator().manual_seed(0))
    mosaic = in_torch.mosaic(planes, cfa)
    again = in_torch.mosaic(in_torch.demosaic(mosaic, cfa), cfa)
    torch.testing.assert_close(again, mosaic)
