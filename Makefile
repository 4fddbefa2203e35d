# Every target builds what it needs from nothing, and at once the second time. ARGS goes to the program that is run.

VENV := .venv
BIN := $(VENV)/bin
MADE := $(shell test -x $(BIN)/python && cat $(VENV)/made 2>/dev/null)
PYTHON ?= $(or $(firstword $(MADE)),python3)
PIP := PIP_CONSTRAINT=constraints.txt PIP_BUILD_CONSTRAINT=constraints.txt PIP_DISABLE_PIP_VERSION_CHECK=1 \
       $(BIN)/python -m pip install --quiet

# ROS 1 as Debian packages it. What is appended to an environment's path never hides what the environment has itself.
DEBIAN := /usr/lib/python3/dist-packages
ROS1 := $(if $(wildcard $(DEBIAN)/rospy/__init__.py),$(VENV)/ros1)

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help demo test lint bench growth page accuracy pictures clean

help:  ## what there is to make
	@sed -n 's/^\([a-z]*\):.*##/make \1#/p' Makefile | while IFS='#' read -r target what; do printf '%-14s%s\n' "$$target" "$$what"; done

demo: $(VENV)/demo  ## learn from real handwriting, and follow a recording that was left out
	$(BIN)/inphase demo $(ARGS)

test: lint $(ROS1)  ## everything that must hold: lint, then the tests (make test ARGS="-k session")
	@# As many files at a time as there are processors, the slowest first (tests/conftest.py); of one file, tests share
	@# what they have set up. Threads of BLAS beside them would only be in their way.
	OMP_NUM_THREADS=1 $(BIN)/pytest -n logical --dist loadfile --no-loadscope-reorder $(ARGS)

lint: $(VENV)/dev  ## style, types and arrows
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	@# The last numpy for Python 3.10 has no types for arrays of any shape: there, types are left to newer Pythons.
	$(if $(shell $(BIN)/python -c 'import sys; print("y" * (sys.version_info >= (3, 11)))' 2>/dev/null),$(BIN)/mypy,@echo "mypy: needs Python 3.11 or newer")
	$(BIN)/lint-imports

bench: $(VENV)/demo $(ROS1)  ## how long a step takes, beside plain loops and the floor; then live, for half an hour
	$(BIN)/python benchmarks/speed.py $(ARGS)
	$(if $(ARGS),,$(BIN)/python benchmarks/live.py)
	$(if $(ARGS),,$(BIN)/python benchmarks/loop.py)
	$(if $(ARGS),,$(BIN)/python benchmarks/attach.py)
	$(if $(ARGS),,$(if $(ROS1),$(BIN)/python benchmarks/ros1.py,@echo "benchmarks/ros1.py: needs ROS 1 (docs/ros.md)"))

growth: $(VENV)/demo  ## how the cost of a step grows: the picture in docs/performance.md
	$(BIN)/python benchmarks/growth.py --output docs/pictures/growth.png $(ARGS)

page: $(VENV)/dev  ## the report of ten minutes: how large, how soon open, how smooth, in a browser
	$(BIN)/python benchmarks/report.py $(ARGS)

accuracy: $(VENV)/demo  ## how accurate the filters are on the recordings beside this folder: a quarter of an hour or more
	$(BIN)/python benchmarks/accuracy.py $(ARGS)

pictures: $(VENV)/dev  ## the pictures of report and studio in docs/, made by the test that holds them true
	INPHASE_SCREENSHOTS=$(CURDIR)/docs/pictures $(BIN)/pytest -q tests/test_report_pages.py

clean:  ## remove the environment and what the tools leave behind
	rm -rf $(VENV) build dist .pytest_cache .ruff_cache .mypy_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# An environment runs the code of the folder it was made in, with the Python it was made by: it is made anew where either
# is another now.
ifneq ($(strip $(MADE)),$(strip $(PYTHON) $(CURDIR)))
.PHONY: $(VENV)/made
endif

$(VENV)/made:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null || { \
	  echo "expected Python 3.10 or newer, got $$($(PYTHON) --version 2>&1 | tail -n 1); name another: make demo PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || { \
	  echo "expected a $(PYTHON) with the modules venv and ensurepip, got one without; on Debian and Ubuntu: apt-get install python3-venv" >&2; exit 1; }
	@if [ -e $@ ]; then rm -rf $(VENV); fi
	@$(PYTHON) -m venv $(VENV)
	@echo "$(PYTHON) $(CURDIR)" > $@

$(VENV)/demo: $(VENV)/made pyproject.toml constraints.txt
	@echo "installing inphase and its demo into $(VENV): once, a minute or two"
	@$(PIP) -e '.[demo]'
	@touch $@

$(VENV)/dev: $(VENV)/made pyproject.toml constraints.txt
	@echo "installing inphase and its tools into $(VENV): once, a minute or two"
	@$(PIP) -e '.[dev]'
	@touch $(VENV)/demo $@

$(VENV)/ros1: $(VENV)/made
	@echo $(DEBIAN) > "$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/debian.pth"
	@touch $@
