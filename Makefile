# The project's habits. `make demo` runs the main job, `make test` passes everything; both set up what they need.
.DEFAULT_GOAL := help
SHELL := /bin/bash
BIN := .venv/bin
DEMO_RESULTS ?= demo-results

FUZZ_SEED ?= 2
FUZZ_COUNT ?= 600
BENCHES ?= raster startup throughput vlv_planning wire_cost pirlnav_latency

.PHONY: help demo test test-ros1 test-ros2 check check-fast test-quick fmt fuzz bench docs docs-site weights setup setup-test clean

help: ## Show this help.
	@grep -hE '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 12

setup:
	@scripts/setup.sh run

setup-test:
	@scripts/setup.sh test

demo: setup ## Set up and run the main job in the embedded apartment, then report it.
	$(BIN)/vsnbench run --model pirlnav --goal chair --results $(DEMO_RESULTS)
	$(BIN)/vsnbench report --results $(DEMO_RESULTS)
	@echo
	@echo "Open an episode:  $(BIN)/vsnbench view 1 --results $(DEMO_RESULTS)        (no display? add --web)"

test: setup-test check ## Set up and pass every check and test: under 20 minutes on two cores.
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "not ros and not ros2"
	@echo "ROS 1 and ROS 2 side by side, for they mostly wait: each shows its tests when it is done"
	$(MAKE) --no-print-directory --jobs 2 --output-sync=target --keep-going test-ros1 test-ros2

test-ros1: setup-test ## The tests that need ROS 1 alone.
	$(BIN)/python -m pytest -m ros

test-ros2: setup-test ## The tests that need ROS 2 alone.
	.venv-ros2/bin/python -m pytest -m ros2 tests/ros2

check: setup-test ## Lint, format check and types.
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

check-fast: setup-test ## Lint, types, and the tests that take no robot, browser, server or patience: under 3 minutes on two cores.
	@$(MAKE) --no-print-directory --jobs 2 --keep-going check test-quick

test-quick: setup-test
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "not slow and not ros and not ros2 and not browser and not postgresql"

fuzz: setup-test ## Feed every loader FUZZ_COUNT bad inputs drawn from FUZZ_SEED; prints what passed a boundary.
	$(BIN)/python -m tests.fuzz --seed $(FUZZ_SEED) --count $(FUZZ_COUNT)

fmt: setup-test ## Format and mend what can be mended by itself.
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: setup-test ## Run the measured comparisons that take minutes; docs/performance.md lists all.
	for name in $(BENCHES); do echo "== benchmarks/$$name.py"; $(BIN)/python benchmarks/$$name.py || exit 1; done

docs: setup-test ## Remake the figures and the generated pages.
	$(BIN)/python scripts/make_docs.py

docs-site: setup-test ## Build docs/ as a site, with search, into build/site.
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "build/site/index.html"

weights: setup-test ## Train the small PIRLNav from nothing, for an hour and a half; the same command goes on with a stopped run.
	nice -n 10 $(BIN)/python -m training --recipe full --output training-runs/full --workers 2 --threads 2

clean: ## Remove the environment and everything that was made.
	rm -rf .venv .venv-ros2 $(DEMO_RESULTS) .mypy_cache .ruff_cache .pytest_cache .hypothesis build dist
