# Two commands do everything on a fresh machine: `make demo` and `make test`.
PYTHON ?= python3
VENV := .venv
DEV := .venv-dev
MANUALS := .venv-docs
RUNTIME_STAMP := $(VENV)/.runtime-installed
DEV_STAMP := $(DEV)/.dev-installed
MANUALS_STAMP := $(MANUALS)/.docs-installed
FUZZ_SECONDS ?= 600
SOURCES := camkit runtime export models_def tests tools examples/fastapi setup.py
# else every process that a test starts compiles the product anew
export PYTHONDONTWRITEBYTECODE =

.PHONY: demo pictures test watched test-slow fuzz dist examples check types tidy format docs clean

demo: $(RUNTIME_STAMP)  ## main job on the demo capture, runtime only (no torch)
	@echo "1 of 2: a night scene with streak-hdr, on the way to out/night.png (about ten seconds)"
	$(VENV)/bin/python -m tools.hdr.night_gallery --out-dir out
	@echo "2 of 2: two scenes with duet, photographed, planned, restored, compared (about a minute)"
	$(VENV)/bin/python -m tools.demo --out-dir out

pictures: $(RUNTIME_STAMP)  ## the pictures of README, gallery and guides
	$(VENV)/bin/python -m tools.pictures.gallery --out-dir docs/images
	$(VENV)/bin/python -m tools.pictures.guides --out-dir docs/images

test: tidy  ## set-up with everything, gate, tests with branch coverage; types beside the tests
	@echo "Running all tests: about half an hour on two cores"
	$(MAKE) --no-print-directory -j2 types watched

watched: $(DEV_STAMP)  # tests/conftest.py names the tests that the coverage gate counts
	$(DEV)/bin/python -m coverage erase
	OMP_NUM_THREADS=1 $(DEV)/bin/python -m coverage run -m pytest -q -n auto --dist loadfile --no-loadscope-reorder
	$(DEV)/bin/python -m coverage combine -q
	$(DEV)/bin/python -m tools.coverage_gate

test-slow: $(DEV_STAMP)  ## also the tests that take minutes
	$(DEV)/bin/python -m pytest -q -m slow --timeout=3600

fuzz: $(DEV_STAMP)  ## search for bundles that camkit does not stand (Linux); FUZZ_SECONDS=600
	$(DEV)/bin/python -m pip install -q --disable-pip-version-check -c constraints.txt -e ".[fuzz]"
	OMP_NUM_THREADS=1 FUZZ_SECONDS=$(FUZZ_SECONDS) $(DEV)/bin/python -m tests.hostile.fuzz

dist: $(DEV_STAMP)  ## wheels and sdists of camkit (with duet) and camkit-bundles, in dist/
	$(DEV)/bin/python -m pip install -q --disable-pip-version-check -c constraints.txt build
	$(DEV)/bin/python -m tools.dist -o dist

examples:  ## the page and the programs of examples/, with node and npm
	@echo "Bringing 38 packages, among them onnxruntime (0.5 GB on disk), then building: about a minute"
	cd examples && npm ci && npm run build

docs: $(MANUALS_STAMP)  ## the manuals as a site in site/, links and anchors checked
	$(MANUALS)/bin/python -m tools.site

check: $(DEV_STAMP)  ## weight, format, lint, types, layers, spelling; types beside the rest
	@echo "Checking weight, format, lint, types, layers and spelling: about a minute"
	$(MAKE) --no-print-directory -j2 types tidy

types: $(DEV_STAMP)
	$(DEV)/bin/mypy

tidy: $(DEV_STAMP)
	$(DEV)/bin/python -m tools.weight
	$(DEV)/bin/ruff format --check $(SOURCES)
	$(DEV)/bin/ruff check $(SOURCES)
	$(DEV)/bin/lint-imports
	$(DEV)/bin/codespell $(SOURCES) docs README.md CHANGELOG.md CONTRIBUTING.md

format: $(DEV_STAMP)
	$(DEV)/bin/ruff format $(SOURCES)
	$(DEV)/bin/ruff check --fix $(SOURCES)

$(RUNTIME_STAMP): pyproject.toml constraints.txt
	@echo "Installing camkit and 25 packages, without torch, into $(VENV): about 190 MB to fetch,"
	@echo "0.6 GB on disk, one to four minutes. Nothing outside this folder changes."
	$(PYTHON) -m venv $(VENV)
	$(VENV)/bin/python -m pip install -q --disable-pip-version-check -c constraints.txt -e .
	touch $@

$(DEV_STAMP): pyproject.toml constraints.txt
	@echo "Installing camkit, torch and what the tests need into $(DEV): 1.8 GB on disk,"
	@echo "two to five minutes. Nothing outside this folder changes."
	$(PYTHON) -m venv $(DEV)
	$(DEV)/bin/python -m pip install -q --disable-pip-version-check torch==2.13.0
	$(DEV)/bin/python -m pip install -q --disable-pip-version-check -c constraints.txt -e ".[dev]"
	touch $@

$(MANUALS_STAMP): pyproject.toml constraints.txt
	@echo "Installing zensical and mkdocstrings into $(MANUALS): 0.16 GB on disk, half a minute."
	$(PYTHON) -m venv $(MANUALS)
	$(MANUALS)/bin/python -m pip install -q --disable-pip-version-check -c constraints.txt zensical mkdocstrings-python
	touch $@

clean:
	rm -rf out build dist site .cache .coverage* .mypy_cache .ruff_cache .pytest_cache
