# Everything happens in .venv, against what is installed there, never against the working directory.
#   ARGS     passed on: make validate ARGS=--quick, make test ARGS="-k column"
#   PYTHON   the interpreter that .venv is made with: make test PYTHON=python3.12

PYTHON = python3
VENV = .venv
BIN = $(VENV)/bin
# Wheels only: a source archive would need a compiler or build tools that a fresh machine does not have. What is
# imported is compiled then: of 30 000 modules that is every tenth.
PIP_INSTALL = $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-input --no-compile --only-binary :all:
# The tests in as many processes as there are cores; those of a file share what they set up. In the order of the
# folders: by the number of their tests, files with a few long ones would come last, when other processes are idle.
SHARED = -n auto --dist loadfile --no-loadscope-reorder
# The directories count too: a deleted module changes only its directory's time.
SOURCES := $(shell find src fea validation -not -name __pycache__ -not -name '*.pyc')

# The matrices here are small (6 to a few hundred rows): BLAS threads cost more than they save, 5 to 100
# times as much in the eigenproblems, and they compete with the worker processes of `validate --jobs`.
export OMP_NUM_THREADS = 1
export OPENBLAS_NUM_THREADS = 1
export MKL_NUM_THREADS = 1

# Where nothing is compiled at the installation, each command would compile what it imports again.
unexport PYTHONDONTWRITEBYTECODE

# Two installations into one .venv would meet; `make test` alone runs two targets at a time, of which one installs.
ifndef INSTALLED
.NOTPARALLEL:
endif
.DELETE_ON_ERROR:
.PHONY: help validate report docs test test-all bench bench-table fresh fuzz lint kernels ready checked schemas lock clean

help:
	@echo 'make validate   every comparison (validate all $$ARGS); says where the report is'
	@echo 'make report     the same, and the reference report in reports/reference anew'
	@echo 'make docs       the site in docs/_build, its gallery run; -W'
	@echo 'make test       ruff, mypy and the tests that are not slow'
	@echo 'make test-all   ruff, mypy and all tests'
	@echo 'make bench      the benchmarks; writes bench.json'
	@echo 'make bench-table  the table in docs/how-well-it-works.md from bench.json'
	@echo 'make fresh      hides causes in made-up readings, scores their diagnoses ($$ARGS="--seed SEED")'
	@echo 'make fuzz       mutated files for every loader ($$SECONDS; an hour, from $$SEED)'
	@echo 'make lint       ruff and mypy only'
	@echo 'make schemas    the JSON schemas in docs/schemas anew'
	@echo 'make lock       constraints.txt anew, from the ranges in pyproject.toml'
	@echo 'make clean      removes .venv and the caches'

validate: ready
	@echo 'Running every comparison: some eight minutes on two cores.'
	@$(BIN)/validate all $(ARGS)

# The reference report that is kept in git: words and the figures that they rest on, with every engine.
report: $(VENV)/.test ready
	$(BIN)/validate all --out reports/runs/reference $(ARGS)
	mkdir -p reports/reference/figures
	cp reports/runs/reference/findings.md reports/reference/README.md
	cd reports/runs/reference/figures && cp link_lumping.png lumping_convergence.png foot_law.png end_conditions.png published.png robot_curves.png robot_critical.png discovery.png verification.png $(CURDIR)/reports/reference/figures/

# A warning fails it. `VJM_DOCS_QUICK=1` leaves the gallery's programs out.
docs: $(VENV)/.test ready
	MPLBACKEND=agg $(BIN)/sphinx-build -q -W --keep-going docs docs/_build
	@echo 'docs/_build/index.html'

test: checked
	$(BIN)/pytest $(SHARED) -m 'not slow' --ignore=tests/benchmarks $(ARGS)

test-all: checked
	$(BIN)/pytest $(SHARED) --ignore=tests/benchmarks $(ARGS)
	$(BIN)/pytest tests/benchmarks

bench: $(VENV)/.test ready
	$(BIN)/pytest tests/benchmarks $(ARGS)

# From the whole of bench.json, which `make bench` wrote without ARGS.
bench-table: ready
	PYTHONPATH=tests $(BIN)/python tests/benchmarks/bench_table.py

# Sets of several generators; ARGS="--seed SEED" with a seed that was never used before. Interrupted, it goes on.
fresh: ready
	PYTHONPATH=tests $(BIN)/python -m hidden_effects.fresh --renew docs/how-well-it-works.md $(ARGS)

# Mutated files for every loader, for SECONDS (an hour).
fuzz: ready
	PYTHONPATH=tests $(BIN)/python -m fuzz $(or $(SECONDS),3600) $(or $(SEED),0)

lint: $(VENV)/.test
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

# The kernels are compiled while what they do not need is loaded and installed.
ready: $(VENV)/.installed
	@$(MAKE) --no-print-directory --jobs=2 --output-sync=line INSTALLED=yes $(VENV)/.runtime $(VENV)/.project

# The kernels are compiled on one core while what tests need is installed and types are checked on another.
checked: $(VENV)/.installed
	@$(MAKE) --no-print-directory --jobs=2 --output-sync=target INSTALLED=yes $(VENV)/.project lint kernels

# Those of the tests, which each process of the tests would compile else.
kernels: $(VENV)/.runtime
	PYTHONPATH=tests $(BIN)/python -m hidden_effects.warm_up

# What paths and stiffness need. Interrupted, it goes on: pip keeps what it has loaded. The build backend is in .venv
# too, so that it is pinned like everything else and a changed source is reinstalled without asking the package index.
$(VENV)/.base: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; sys.exit(0 if (3, 11) <= v < (3, 15) else "Python 3.11 to 3.14 is needed, $(PYTHON) is %d.%d: say make PYTHON=python3.12, for example" % v)'
	@echo 'Loading and installing what paths need into $(VENV).'
	@$(PYTHON) -m venv $(VENV)
	@$(PIP_INSTALL) -c constraints.txt hatchling
	@$(PIP_INSTALL) -c constraints.txt --no-build-isolation .
	@touch $@

# What every comparison needs. By its name, the project that is installed is left as it is.
$(VENV)/.runtime: $(VENV)/.base | $(VENV)/.installed
	@echo 'Loading and installing what the comparisons need: 640 MB to load, 1.6 GB on disk, one to three minutes.'
	@$(PIP_INSTALL) -c constraints.txt 'vjm-stiffness[all]'
	@$(BIN)/python -c 'import exudyn' || { echo 'exudyn does not load. Where libGL.so.1 is missing, install it (Debian: apt-get install libgl1).' >&2; exit 1; }
	@touch $@

# What it takes to test, on top.
$(VENV)/.test: $(VENV)/.runtime | $(VENV)/.installed
	@echo 'Loading and installing what the tests need: 370 MB more, a minute.'
	@$(PIP_INSTALL) -c constraints.txt 'vjm-stiffness[test]'
	@touch $@

# The project as it now stands.
$(VENV)/.installed: $(VENV)/.base $(SOURCES)
	@echo 'Installing the project: a few seconds.'
	@$(PIP_INSTALL) --no-build-isolation --no-deps --force-reinstall .
	@touch $@

$(VENV)/.project: $(VENV)/.installed
	@echo 'Compiling the kernels: some three minutes, once for these sources. Interrupted, it goes on with the next kernel.'
	@$(BIN)/python -m vjm_updating.warm_up
	@touch $@

schemas: ready
	$(BIN)/python -m vjm_validation.schemas docs/schemas

# The newest versions that the ranges allow, with the oldest Python that the project supports: they have to
# exist for that one. The project is installed to be resolved, and left out of the list.
lock:
	rm -rf $(VENV)-lock
	$(PYTHON) -m venv $(VENV)-lock
	$(VENV)-lock/bin/python -m pip install --quiet --disable-pip-version-check --no-input hatchling '.[test]'
	@{ echo '# Exact versions of everything that is installed, the test tools and the build backend included.'; \
	   echo '# Made by `make lock` on Linux with Python 3.11; they also install on 3.12, 3.13 and 3.14.'; \
	   $(VENV)-lock/bin/python -m pip freeze --exclude vjm-stiffness; } > constraints.txt.new
	mv constraints.txt.new constraints.txt
	rm -rf $(VENV)-lock

clean:
	rm -rf $(VENV) $(VENV)-lock constraints.txt.new docs/_build docs/gallery_built build dist bench.json .pytest_cache .mypy_cache .ruff_cache .hypothesis
