"""Speed against accuracy, in the order in which a bench works.

settings        what a caller may ask for
trial           one way to do the work, and the axes along which trials vary
part            what a kind of camera brings: how it photographs, rows, metrics
common_rows     which trials any bundle gives
own_rows        kinds that measure themselves: their rows in one report
line_up         the makers and metrics of a camera, and all trials
timed/          one capture through fresh processes, watched: seconds, memory, noise
machine, gemm   what the machine is, and the fastest it multiplies
known_captures  captures with a known truth
metric          the type of a metric
metrics/        what is measured on a result; a new metric is one new file
accuracy        every method on every known capture
edge            how sharp captures and pictures are, by one slanted edge
crops           the same patch of every method
split           accuracy by ISO and by place in the field
row             all that is known about a trial as one record
tuning          how every method was tuned
run             the whole bench
pareto          who is beaten by nobody
shown/          the chart and the page for people
output          all files written
"""
