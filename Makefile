# Every target sets up what it needs, once; `make help` lists them.
.DEFAULT_GOAL := help
.PHONY: help setup demo check test lint fmt docs page bench dist wheels clean

PYTHON := .venv/bin/python
READY  := .venv/ready
# the march in C, beside the Python package; built anew when its sources change
LIBRARY := src/antiosc/libantiosc_march.so
TOOLS  := .venv/tools

# Open MPI: root is allowed (containers, CI), more ranks than cores too, and no chatter about the machine.
export OMPI_ALLOW_RUN_AS_ROOT = 1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM = 1
export OMPI_MCA_rmaps_base_oversubscribe = 1
export PRTE_MCA_rmaps_default_mapping_policy = :oversubscribe
export UCX_LOG_LEVEL ?= fatal
# A process that runs alone starts no daemon and looks for no network: MPI_Init 0.33 -> 0.05 s.
export OMPI_MCA_ess_singleton_isolated ?= 1
export OMPI_MCA_pml ?= ob1
export HWLOC_HIDE_ERRORS ?= 2
# What Python has compiled serves the next process too.
unexport PYTHONDONTWRITEBYTECODE
# Tests are many small problems: one thread each, unless the caller says otherwise.
test check: export OMP_NUM_THREADS ?= 1
# OpenBLAS has kernels for each kind of processor, which round differently. 0.3.21 does not know those of
# 2023 and takes the slowest for them, PRESCOTT's: a factor of 650 000 dofs 19 s, with HASWELL's 8 s.
CORE ?= $(if $(shell grep -wm1 avx2 /proc/cpuinfo 2>/dev/null),HASWELL)
ifneq ($(CORE),)
export OPENBLAS_CORETYPE := $(CORE)
endif

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / { printf "make %-14s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: $(READY) ## Debian packages, .venv, antiosc in editable form (all other targets do this themselves)

demo: $(READY) ## a steel sphere strikes the bracket: table, force plot, model and fields in out/
	$(PYTHON) demos/impact_on_bracket.py

bench: ## what `make bench-NAME` measures
	@benchmarks/run || true

bench-%: $(READY)
	benchmarks/run $* $(PYTHON)

docs: $(READY) ## the pages, in out/docs/index.html; a warning is an error
	.ci/install .ci/packages-docs
	$(PYTHON) -m sphinx -W --keep-going -q -b html docs out/docs

# Two processes share the test files; `make test WORKERS=0` runs them in one.
WORKERS ?= 2

test: $(READY) ## all tests, those on several MPI ranks included
	$(PYTHON) -m pytest -n $(WORKERS) --dist loadfile

check: $(READY) ## the quick tests on one rank, a case of each; CORE=HASWELL: rounded as there
	$(PYTHON) -m pytest -n $(WORKERS) -m "not slow and not mpi"

page: ## the engine of live reports for WebAssembly, which the repository keeps (clang and lld, or ziglang)
	/usr/bin/python3 packaging/library.py --page

dist: $(READY) ## wheel and source archive in out/dist, checked by twine
	.ci/dist out/dist $(PYTHON)
	.ci/install .ci/packages-dist
	twine check --strict out/dist/*

wheels: ## wheels of all platforms in out/wheels, compiled here by zig
	.ci/wheels out/wheels

lint: $(READY) $(TOOLS)/ready ## style, format and types
	$(TOOLS)/bin/ruff check .
	$(TOOLS)/bin/ruff format --check .
	$(TOOLS)/bin/mypy --python-executable $(PYTHON)

fmt: $(TOOLS)/ready ## put the code in its format
	$(TOOLS)/bin/ruff check --fix .
	$(TOOLS)/bin/ruff format .

clean: ## remove .venv, caches and out/
	rm -rf .venv out build $(LIBRARY) src/*.egg-info .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +

$(LIBRARY): packaging/library.py $(wildcard csrc/*.[ch] csrc/export/*.[ch] csrc/fem/*.[ch])
	.ci/install .ci/packages
	/usr/bin/python3 packaging/library.py

$(READY): .ci/setup .ci/install .ci/packages pyproject.toml setup.py | $(LIBRARY)
	.ci/setup
	@touch $@

$(TOOLS)/ready: .ci/tools | $(READY)
	/usr/bin/python3 -m venv $(TOOLS)
	$(TOOLS)/bin/python -m pip install --quiet --disable-pip-version-check -r .ci/tools
	@touch $@
