"""Many captures: which files, which bundle for each, where the pictures go, what is done already.

sources     files, folders, globs -> captures
tasks       bundle, name of the picture, clashes: errors before any work
making      one capture claimed, made, told as a result
batch_progress    how many are done, and how much of those under way
cluster/    the same on the workers of a dask cluster
processing  all of them, `jobs` at once
worker_pool       processes with a camera loaded, for services: a future for each capture
pool_process      such a process, seen from its parent
pool_worker       what runs in it

Pictures and sidecars are claimed, written to part files and renamed. One file's failure never stops
the others; `resume` skips only what a sidecar proves done.
"""

from camkit.runtime.batch.making import Pipelines
from camkit.runtime.batch.processing import kind_of_run, process
from camkit.runtime.batch.sources import expand, unmatched_text
from camkit.runtime.batch.tasks import Task, list_tasks

__all__ = ["Pipelines", "Task", "expand", "kind_of_run", "list_tasks", "process", "unmatched_text"]
