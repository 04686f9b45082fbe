"""No more than the scene needs: what is done to one capture, and why.

decision      what one rule decided; the work that results; what rules may look at
loss          squared error per lattice cell, predicted from the scene by the bundle's calibration
tiers         cells shared among plain, Wiener, smaller and full network within a loss
counted       windows and blocks of a plan, counted against doing everything
rule          rules found in `rules/`, one module each, in their order
rules/        the rules themselves
speed         how fast this machine is, measured in a few milliseconds
binned_work   what is done to a mosaic that is averaged over squares
estimate      seconds and peak memory of a piece of work
planner       quality and budgets -> rules -> work, decisions, estimate
tuning        how a method was tuned, as far as bundle and code state it

Rules see the capture and the bundle alone, so what they decide does not depend on tile size,
memory cap or threads; only `--max-seconds` looks at the speed of the machine.
"""
