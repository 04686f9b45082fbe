"""A batch on many machines: dask.distributed carries camkit's tasks, one file is one task.

connection   an address or a number of workers -> a client, or one line that says why not
remote       what runs on a worker: what it is, bundles taken by hash, one picture made
crew         the workers of a run: looked at before work, named if they do not fit
losses       whose fault a worker's death was
link         the way to the scheduler, found again
run          the queue, on the caller's side: no more in flight than the workers hold

The claim of an output makes a task idempotent: a file whose worker was lost is made again by
another, and what was done before is proved by its sidecar. Nothing lies in the scheduler but the
files in flight, so that it may be lost too. All machines see the same files under the same names.
"""
