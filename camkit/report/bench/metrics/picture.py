"""PSNR and SSIM on sRGB values, by the protocol of `camkit.report.quality`."""

from camkit.arrays import FloatArray
from camkit.report.bench.metric import Column, Metric
from camkit.report.quality import judge


def measure(restored: FloatArray, sharp: FloatArray) -> dict[str, float]:
    """Compare a linear Rec.709 picture with sRGB values of the truth."""
    score = judge(restored, sharp)
    return {"psnr_db": score.psnr_db, "ssim": score.ssim}


METRIC = Metric(
    name="picture",
    columns=(
        Column(name="psnr_db", spread="psnr_std_db", of_input="input_psnr_db"),
        Column(name="ssim", spread="ssim_std", of_input="input_ssim"),
    ),
    measure=measure,
)
