# Every target sets up what it needs, once; `make help` lists them.
.DEFAULT_GOAL := help
.PHONY: help setup demo article bench budget decks validate peers docs dist test check check-cores test-trixie test-sid test-newest memcheck fuzz wheels lint fmt clean

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
export HWLOC_HIDE_ERRORS ?= 2
# What Python has compiled serves the next process too.
unexport PYTHONDONTWRITEBYTECODE
# Tests are many small problems: one thread each, unless the caller says otherwise.
test check: export OMP_NUM_THREADS ?= 1
# OpenBLAS rounds differently on each kind of processor; it takes the kernels of another kind if told.
ifdef CORE
export OPENBLAS_CORETYPE := $(CORE)
endif

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / { printf "make %-14s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: $(READY) ## Debian packages, .venv, antiosc in editable form (all other targets do this themselves)

demo: $(READY) ## a steel sphere strikes the bracket: table, force plot, model and fields in out/
	$(PYTHON) demos/impact_on_bracket.py

article: $(READY) ## every claim of the article rerun: demos/ARTICLE.md and its figures
	$(PYTHON) demos/article.py

bench: $(READY) ## speed against accuracy: tables, pictures and JSON in demos/speed (about 20 minutes)
	$(PYTHON) demos/speed_accuracy.py

# Parts of the sample: those that out/error_budget.jsonl holds are not tried again.
COUNT ?= 300

budget: $(READY) ## error budgets: COUNT random parts, strike beside fixed choices, demos/speed/error_budget.md (about 55 minutes)
	mkdir -p out
	$(PYTHON) demos/error_budget.py --parts $(COUNT) --seed 2026 --out out/error_budget.jsonl
	$(PYTHON) demos/strike_or_uniform.py --out out/strike_or_uniform.json
	$(PYTHON) demos/error_budget_tables.py --parts out/error_budget.jsonl --runs out/strike_or_uniform.json --page demos/speed/error_budget.md
	$(PYTHON) demos/strike_beams.py --cases 60 --seed 2026 --page demos/speed/strike_beams.md
	$(PYTHON) demos/beam_model.py --page demos/speed/beam_model.md
	$(PYTHON) demos/shell_error_bars.py --shells 64 --seed 2026 --out out/shell_error_bars.jsonl --page demos/speed/shell_error_bars.md

validate: $(READY) ## published tests in one table with pictures: docs/validation.md (about 2 minutes)
	$(PYTHON) demos/validation/book.py

peers: $(READY) ## plate and bracket in CalculiX with meshed contact beside antiosc (an hour)
	.ci/install .ci/packages-peers
	$(PYTHON) demos/peers/calculix.py --part plate
	$(PYTHON) demos/peers/calculix.py --part bracket --near 0.5 --stiffnesses 1e6,1e7 --explicit 2e-8 --duration 1e-4

docs: $(READY) ## the pages, in out/docs/index.html; a warning is an error
	.ci/install .ci/packages-docs
	$(PYTHON) -m sphinx -W --keep-going -q -b html docs out/docs

decks: $(READY) ## the decks of Debian's calculix-ccx-test in one table: read, struck, refused; DECKS=folder
	$(PYTHON) tests/decks/table.py $(DECKS)

# Two processes share the tests; `make test WORKERS=0` runs them in one.
WORKERS ?= 2

test: $(READY) ## all tests, those on several MPI ranks included
	$(PYTHON) -m pytest -n $(WORKERS)

check: $(READY) ## the quick tests on one rank (under 2 minutes); CORE=HASWELL: rounded as there
	$(PYTHON) -m pytest -n $(WORKERS) -m "not slow and not mpi"

check-cores: $(READY) ## the same under HASWELL, SKYLAKEX, ZEN and SANDYBRIDGE, those that run here
	.ci/cores

test-trixie: ## all tests in a tree of Debian 13 (needs root or sudo; ANTIOSC_CHROOTS says where)
	.ci/debian trixie

test-sid: ## all tests in a tree of Debian sid, likewise
	.ci/debian sid

test-newest: ## what needs NumPy and SciPy alone, on the newest Python, NumPy and SciPy to be had
	.ci/newest

memcheck: $(READY) ## every call to CHOLMOD under valgrind (apt install valgrind; some minutes)
	.ci/memcheck $(PYTHON)

fuzz: ## the march's C header under sanitizers, valgrind and ten minutes of libFuzzer
	.ci/fuzz $(SECONDS)

wheels: ## wheels for Linux, macOS and Windows in out/wheels, compiled here by PyPI's ziglang
	.ci/wheels

dist: $(READY) ## wheel and source archive in out/dist, checked by twine
	.ci/dist out/dist $(PYTHON)
	.ci/install .ci/packages-dist
	twine check --strict out/dist/*

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

$(LIBRARY): packaging/library.py $(wildcard csrc/*.[ch] csrc/export/*.[ch])
	.ci/install .ci/packages
	/usr/bin/python3 packaging/library.py

$(READY): .ci/setup .ci/install .ci/packages pyproject.toml setup.py | $(LIBRARY)
	.ci/setup
	@touch $@

$(TOOLS)/ready: .ci/tools | $(READY)
	/usr/bin/python3 -m venv $(TOOLS)
	$(TOOLS)/bin/python -m pip install --quiet --disable-pip-version-check -r .ci/tools
	@touch $@
