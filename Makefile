# The two commands of the README are `make demo` and `make test`; each sets up what it needs.
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

# Debian's own Python, because the packages are for it; elsewhere the one on the path.
PYTHON3 ?= $(firstword $(wildcard /usr/bin/python3) python3)
JOBS ?= $(shell nproc 2>/dev/null || echo 2)
PYTHON := .venv/bin/python
export CMAKE_BUILD_PARALLEL_LEVEL := $(JOBS)

# Lists the C and C++ sources; not by git, so that it also works outside of a clone.
C_SOURCES = find libcore capi tests examples -name '*.c' -o -name '*.cpp' -o -name '*.h' -o -name '*.hpp'

# What the installed package is made from.
SOURCES := CMakeLists.txt pyproject.toml $(wildcard README.md LICENSE) \
  $(shell find cmake libcore capi/include capi/src capi/tools bindings/python -type f \
    -not -name '*.pyc' 2>/dev/null)

.PHONY: help demo test study bench docs format lint clean packages configure
help:  ## this list
	@sed -n 's/^\([a-z]*\):.*## /make \1\t/p' Makefile

demo: .venv/installed  ## set up, build, and assess the bundled recording
	@.venv/bin/ulna assess examples/data/relaxed-arm.csv --shoulder 0,0 --out out/demo

test: configure  ## set up, build, and run every test
	@cmake --build build
	@$(PYTHON) tests/run.py build

study: .venv/installed  ## run the longer studies, which `make test` leaves out
	@$(PYTHON) -m pytest -q -m slow -n $(JOBS)

bench: .venv/installed  ## measure speed, beside plain NumPy and SciPy
	@cmake -S . -B build-bench -G Ninja -DULNA_BUILD_BENCH=ON -DULNA_BUILD_TESTS=OFF \
	  -DULNA_BUILD_EXAMPLES=OFF -DPython3_EXECUTABLE=$(CURDIR)/$(PYTHON) >/dev/null
	@cmake --build build-bench
	@for program in build-bench/tests/bench/bench_*; do [ ! -x "$$program" ] || "$$program"; done
	@$(PYTHON) -m pytest -q tests/bench --benchmark-sort=name --benchmark-columns=min,median,rounds

docs: .venv/tools  ## write the reference of the C interface to docs/reference
	@$(PYTHON) capi/tools/apigen.py --headers capi/include/ulna --docs docs/reference
	@echo "docs/reference/README.md"

format: .venv/lint-tools  ## format the C and C++ sources
	@$(C_SOURCES) | xargs .venv/bin/clang-format -i

lint: .venv/lint-tools  ## check the format of the sources and the record of the interface
	@$(C_SOURCES) | xargs .venv/bin/clang-format --dry-run -Werror
	@$(PYTHON) -m ruff check bindings capi/tools tests examples
	@$(PYTHON) capi/tools/abicheck.py

clean:  ## remove what was built; .venv stays
	@rm -rf build build-* out .venv/installed

# Set-up ------------------------------------------------------------------------------------------

packages:
	@cmake/packages.sh

# Build requirements are installed once, so that the build needs no isolated copy of them each time.
.venv/tools: pyproject.toml | packages
	@[ -x $(PYTHON) ] || $(PYTHON3) -m venv .venv
	@echo "Installing Python's build tools into .venv"
	@$(PYTHON) -m pip install --quiet --disable-pip-version-check \
	  "scikit-build-core>=0.10" "cffi>=1.15" "setuptools>=65"
	@touch $@

.venv/lint-tools: .venv/tools
	@$(PYTHON) -m pip install --quiet --disable-pip-version-check "clang-format==14.*" "ruff==0.8.*"
	@touch $@

# The build folder is kept, so that a changed source rebuilds only what depends on it.
.venv/installed: $(SOURCES) .venv/tools | packages
	@echo "Building and installing ulna into .venv"
	@$(PYTHON) -m pip install --quiet --disable-pip-version-check --no-build-isolation \
	  --config-settings=build-dir=build ".[all,test]"
	@touch $@

# The tests are added to what the package was built in: the core is compiled once.
configure: .venv/installed
	@cmake -S . -B build -DULNA_BUILD_TESTS=ON -DULNA_BUILD_EXAMPLES=ON >/dev/null
