import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.render.texture import Texture, look_up

EXACT = 1e-12


def _texture() -> Texture:
    values = torch.rand(3, 5, 7, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    return Texture(values=values, pitch_mm=0.5, axis_px=(2.0, 3.0))


def _slow(texture: Texture, x: float, y: float) -> torch.Tensor:
    """Bilinear, border continued, by definition."""
    _, h, w = texture.values.shape
    row = min(max(texture.axis_px[0] - y / texture.pitch_mm, 0.0), h - 1.0)
    column = min(max(texture.axis_px[1] - x / texture.pitch_mm, 0.0), w - 1.0)
    top, left = min(int(row), h - 2), min(int(column), w - 2)
    v, u = row - top, column - left
    block = texture.values[:, top : top + 2, left : left + 2]
    upper = (1 - u) * block[:, 0, 0] + u * block[:, 0, 1]
    return (1 - v) * upper + v * ((1 - u) * block[:, 1, 0] + u * block[:, 1, 1])


def test_look_up_is_bilinear_and_continues_the_border() -> None:
    texture = _texture()
    points = 3 * torch.rand(2, 40, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    points = points - 1.5
    expected = torch.stack([_slow(texture, float(x), float(y)) for x, y in points.T], dim=1)
    x, y = (p.expand(3, 1, 40) for p in points)
    assert float((look_up(texture, x, y)[:, 0] - expected).abs().max()) < EXACT


def test_rows_hang_towards_negative_y() -> None:
    texture = _texture()
    zero = torch.zeros(3, 1, 1, dtype=torch.float64)
    below = look_up(texture, zero, zero - texture.pitch_mm)[:, 0, 0]
    assert torch.allclose(below, texture.values[:, 3, 3])


def test_gradients_reach_points_and_values() -> None:
    texture = _texture()
    x = torch.full((3, 1, 1), 0.2, dtype=torch.float64, requires_grad=True)
    y = torch.full((3, 1, 1), -0.3, dtype=torch.float64, requires_grad=True)
    values = texture.values.clone().requires_grad_()

    def found(v: torch.Tensor, a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        return look_up(Texture(values=v, pitch_mm=0.5, axis_px=(2.0, 3.0)), a, b)

    assert torch.autograd.gradcheck(found, (values, x, y))


@pytest.mark.parametrize(
    ("values", "pitch_mm"),
    [
        (torch.zeros(4, 4), 1.0),
        (torch.zeros(3, 4, 4, dtype=torch.int64), 1.0),
        (torch.zeros(3, 4, 4), 0.0),
    ],
)
def test_what_is_no_texture_is_refused(values: torch.Tensor, pitch_mm: float) -> None:
    with pytest.raises(ContractError):
        Texture(values=values, pitch_mm=pitch_mm, axis_px=(0.0, 0.0))
