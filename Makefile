# Everything from an empty checkout: `make demo` and `make test` first make .venv and install into it.

# The first Python that the package supports.
PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null && echo $$p && break; done)
VENV ?= .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
DEMO ?= demo
ROBOT ?= panda

.PHONY: demo test check docs format lock clean

demo: $(INSTALLED)
	$(BIN)/s2a demo folder=$(DEMO) robot=$(ROBOT)
	$(BIN)/python tools/joint_table.py $(DEMO)/geometric.usd $(DEMO)/scan/truth/truth.usda

# A thread for each worker: as many as cores would stand in each other's way. Python keeps what it compiles, even where the
# environment forbids it: each of the tests' processes would compile the package anew.
test: $(INSTALLED)
	OMP_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= $(BIN)/pytest -q -n auto --maxprocesses 4 --dist loadfile -m "not slow and not gpu"

check: $(INSTALLED)
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/lint-imports --no-logo
	$(BIN)/mypy

# The documentation as a site, build/site; a broken link fails.
docs: $(INSTALLED)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build
	@echo "See it with: $(BIN)/python -m http.server --directory build/site"

format: $(INSTALLED)
	$(BIN)/ruff format
	$(BIN)/ruff check --fix

$(INSTALLED): requirements.lock pyproject.toml
	@test -n "$(PYTHON)" || { echo "s2a needs Python 3.11, 3.12 or 3.13; name one: make PYTHON=..." >&2; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --requirement requirements.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

# The newest versions that pyproject.toml allows, as a new lock.
lock:
	rm -rf build/lock
	$(PYTHON) -m venv build/lock
	build/lock/bin/pip install --quiet --editable '.[all,dev]'
	sed -n '/^#/p' requirements.lock > build/new.lock
	build/lock/bin/pip freeze --all --exclude-editable | sed '/^pip==/d; s/+cpu$$//' >> build/new.lock
	mv build/new.lock requirements.lock

clean:
	rm -rf $(VENV) $(DEMO) build dist
