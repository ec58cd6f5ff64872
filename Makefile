# The two main commands are make demo and make test. Both install what they need, given Python 3.11 and make.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
BIN := .venv/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet --constraint .ci/constraints.txt

# Python compiles a module when it first imports it: a quarter of what is installed.
install = $(PIP) --no-compile --editable '.$(1)'

.PHONY: demo test quick lint check docs bench calibrate examples dist clean

demo: .venv/installed
	$(BIN)/mcnav demo

# Four workers for two processors, as tests wait for processes that they have started, and for files of others.
test: .venv/tested
	$(BIN)/python -m pytest --numprocesses 4 --dist worksteal

# Under a minute: lint, and the unit tests but for the slow ones.
quick: lint
	$(BIN)/python -m pytest --numprocesses 2 --dist worksteal -m "not slow" tests/unit

lint: .venv/tested
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

check: lint test

# The documentation as a site, build/site/index.html, without a network; a warning is an error.
docs: .venv/documented
	$(BIN)/python .github/site/build.py

# Compare mcnav with its peers, into reports/benchmarks: a quarter of an hour on an otherwise idle machine. BENCH=--full
# adds 10^8 samples, BENCH="--only inertial" measures one of the chapters.
bench: .venv/benched
	$(BIN)/python -m tests.benchmarks $(BENCH)

# Measure error rates of intervals, tests and verdicts on campaigns whose truth is known, into reports/calibration.
# CALIBRATE="--trials 300" gives the number of campaigns of each kind; "--alone rare", "--alone judge" or
# "--alone processes" measures these alone.
calibrate: .venv/tested
	$(BIN)/python -m tests.calibration $(CALIBRATE)

# The small reports under reports/examples; simulated again only where their inputs have changed.
# The README shows text and picture of the demonstration, which is too large to be stored there.
README := 01_tn_d1772_trajectory_4
EXAMPLES := 01_tn_d1772_trajectory_4 11_cruise 14_polar
examples: .venv/installed
	for name in $(EXAMPLES); do \
	  run="$(BIN)/mcnav run campaigns/$$name.toml --samples 1000 --jobs 1 --out reports/examples/$$name"; \
	  $$run >/dev/null 2>&1 || $$run --fresh || exit 1; \
	done
	$(BIN)/mcnav report --index reports/examples
	run="$(BIN)/mcnav run campaigns/$(README).toml --jobs 1 --out build/examples/$(README)"; \
	  mkdir -p build/examples; $$run >/dev/null 2>&1 || $$run --fresh
	$(BIN)/python -m tests.readme build/examples/$(README)
	$(BIN)/python -m tests.campaign_list

$(BIN)/python:
	$(PYTHON) -m venv .venv

.venv/installed: pyproject.toml .ci/constraints.txt | $(BIN)/python
	$(call install,)
	touch $@

# What the tests need includes all of the rest. Their processes would compile modules side by side; some packages hold
# files that are not for this Python.
.venv/tested: pyproject.toml .ci/constraints.txt | $(BIN)/python
	$(call install,[test])
	$(BIN)/python -m compileall -qq -j 0 -x '/tests?/' .venv/lib mcnav || true
	touch .venv/installed .venv/documented $@

.venv/documented: .venv/installed
	$(call install,[docs])
	touch $@

# Each peer is installed separately: one that fails is listed with its reason, and the others continue.
.venv/benched: .venv/installed
	$(BIN)/python -m tests.benchmarks.install $@

# The wheel, with machine code for two levels of processors of which this one must have the higher, and the source
# distribution, into dist/; beside them what they need, at the versions of .ci/constraints.txt: requirements.txt with
# hashes, and a software bill of materials in the format of CycloneDX.
OBJECTS := mcnav/compiled/objects
dist: .venv/installed
	$(PIP) build
	rm -rf dist build/lib $(OBJECTS)
	for level in x86-64-v3 x86-64-v4; do $(BIN)/mcnav dev compile --out $(OBJECTS) --level $$level || exit 1; done
	$(BIN)/python -m build --sdist
	$(BIN)/python -m build --wheel
	rm -rf $(OBJECTS)
	$(PYTHON) -m venv --clear build/tools
	build/tools/bin/python -m pip --disable-pip-version-check install --quiet cyclonedx-bom pip-tools
	build/tools/bin/pip-compile --quiet --strip-extras --generate-hashes --no-header --no-annotate --no-emit-index-url \
	  --no-emit-find-links --no-emit-trusted-host --constraint .ci/constraints.txt \
	  --output-file dist/requirements.txt pyproject.toml
	build/tools/bin/cyclonedx-py requirements --pyproject pyproject.toml --output-reproducible \
	  --output-file dist/mcnav.cdx.json dist/requirements.txt

clean:
	rm -rf .venv build dist mcnav.egg-info
