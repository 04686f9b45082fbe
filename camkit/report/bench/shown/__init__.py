"""A bench as people see it.

looks          which colour a camera has, which marker a method
labels         texts beside markers where they cover nothing
front_panel    time against PSNR, all cameras on common axes
field_panels   PSNR over the field, a panel for every ISO
legend         what colours, markers and lines mean
bench_chart    all of that as one picture
bench_page     the page
"""
