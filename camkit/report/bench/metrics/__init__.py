"""Metrics: every module here defines `METRIC`, a `camkit.report.bench.metric.Metric`.

picture    PSNR and SSIM on sRGB values
"""
