# Each target first brings what it needs: system packages (Debian, Ubuntu) and the environment .venv.

VENV := .venv
PYTHON := $(VENV)/bin/python
STAMP := $(VENV)/.installed
DEMO := resources/demo/demo.laz

# A window needs a display; where Linux has none, a virtual one is made for the command.
ifeq ($(shell uname -s)$(DISPLAY)$(WAYLAND_DISPLAY),Linux)
WINDOWED := xvfb-run -a -s "-screen 0 1600x1000x24"
endif

MAKEFLAGS += --no-print-directory
.DEFAULT_GOAL := help
.PHONY: docs help demo test lint test-core test-kernels test-gui coverage explore study bench pictures texts format lock wheels venv system-packages clean

help: ## Show this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## (.*)/  make \1\t\2/' | expand -t 20

demo: venv ## Find the deformations in the demo scan and look at them in the app
	@installer/demo.sh $(DEMO) out/demo

test: lint test-core test-kernels test-gui ## Run every check and every test

lint: venv ## Check style, types, docstrings and the rules of who may import whom
	$(VENV)/bin/ruff check
	$(VENV)/bin/ruff format --check
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports --no-logo --no-cache
	$(PYTHON) -m tools.docstrings

# Without the Qt plugin, so that the core is seen to do without Qt.
test-core: venv
	$(PYTHON) -m pytest -p no:pytest-qt tests/core

# The twins once more with the kernels as plain Python: what the compiler is not asked to do
# here must come out the same, and an index beyond an array's end raises.
test-kernels: venv
	NUMBA_DISABLE_JIT=1 $(PYTHON) -m pytest -p no:pytest-qt -m kernels tests/core

test-gui: venv
	$(WINDOWED) $(PYTHON) -m pytest tests/gui

# Compiled kernels are not seen: their lines count where the twins run them as plain Python.
coverage: venv ## Measure which lines the tests run (writes out/coverage)
	$(PYTHON) -m coverage erase
	$(PYTHON) -m coverage run -p -m pytest -p no:pytest-qt tests/core
	NUMBA_DISABLE_JIT=1 $(PYTHON) -m coverage run -p -m pytest -p no:pytest-qt -m kernels tests/core
	$(WINDOWED) $(PYTHON) -m coverage run -p -m pytest tests/gui
	$(PYTHON) -m coverage combine --quiet
	$(PYTHON) -m coverage html --quiet
	$(PYTHON) -m coverage report --skip-covered | tail -n 1

# Tests that draw at random have one fixed seed in `make test`.
HOURS ?= 1
explore: venv ## Repeat the tests that draw at random with new seeds for HOURS, and report failure rates
	$(PYTHON) -m tools.explore --hours $(HOURS)

study: venv ## Measure the accuracy on simulated scans (half an hour; writes docs/accuracy.md)
	@# A peer to compare with, of no use to anything else here.
	$(PYTHON) -m pip install --quiet cylinder-fitting==1.1.4
	$(PYTHON) -m tools.study

bench: venv ## Measure time and memory (writes docs/performance.md)
	$(PYTHON) -m tools.bench

pictures: venv ## Take the pictures of README and guide anew
	$(WINDOWED) $(PYTHON) -m tools.pictures

texts: venv ## Bring the translations up to the sources, and compile them
	$(PYTHON) -m tools.translations

format: venv ## Lay out the code and mend what can be mended
	$(VENV)/bin/ruff check --fix
	$(VENV)/bin/ruff format

lock: ## Bring requirements.lock up to what both pyproject.toml ask for (needs uv)
	uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-emit-index-url \
	    --no-emit-package pipegui-core --custom-compile-command "make lock" \
	    --extra all --extra dev pyproject.toml -o requirements.lock

docs: venv ## Build the API reference and the pages of docs into out/docs; a warning is an error
	$(PYTHON) -m sphinx --fail-on-warning --keep-going --quiet --fresh-env docs out/docs

wheels: venv ## Build the wheels of the library and of the app into dist
	$(PYTHON) -m pip wheel --quiet --no-deps --no-build-isolation --wheel-dir dist ./core .

venv: $(STAMP) ## Make or renew the environment .venv

$(STAMP): requirements.lock pyproject.toml core/pyproject.toml installer/environment.sh | system-packages
	@installer/environment.sh
	@touch $@

system-packages:
	@installer/system-packages.sh

clean: ## Remove everything that was made here, but for the environment
	rm -rf out build dist .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find core pipegui tests tools -name __pycache__ -prune -exec rm -rf {} +
