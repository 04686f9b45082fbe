"""The site of the manuals.

__main__        builds it into site/: `make docs`
file_worker.js  a worker for pages opened as files, where browsers allow none: the search needs it
"""
