# `make demo` runs the main job, `make test` runs all checks and tests; both set up what they need.
.DEFAULT_GOAL := help
SHELL := /bin/bash
BIN := .venv/bin
DEMO_RESULTS ?= demo-results

# Each of the many processes that tests start would compile all modules again.
export PYTHONDONTWRITEBYTECODE :=
# A file stays in one process. tests/conftest.py puts the longest files first, which xdist keeps with the second option.
SPREAD := --dist loadfile --no-loadscope-reorder

# Most of these tests wait a third of their time for processes and browsers: twice as many as two cores keep the cores busy.
WAITING ?= 4

# Tests on live graphs and in browsers can fail on a busy machine: two reruns, which the summary lists. RERUN= repeats none.
RERUN ?= --reruns 2 -r R

FUZZ_SEED ?= 2
FUZZ_COUNT ?= 600
BENCHES ?= raster scan_raster startup throughput pirlnav_latency

.PHONY: help demo test test-others test-robots test-ros1 test-ros2 test-long check check-fast test-quick fmt fuzz bench bench-compare docs docs-site weights dist setup setup-test setup-dist setup-docs clean

help: ## List the targets.
	@grep -hE '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 12

setup:
	@scripts/setup.sh run

setup-test setup-dist setup-docs:
	@scripts/setup.sh $(@:setup-%=%)

demo: setup ## Set up, run trials in the embedded apartment, print the report.
	$(BIN)/vsnbench run --model pirlnav --goal chair --results $(DEMO_RESULTS)
	$(BIN)/vsnbench report --results $(DEMO_RESULTS)
	@echo
	@echo "Open an episode:  $(BIN)/vsnbench view 1 --results $(DEMO_RESULTS)        (no display? add --web)"

# Tests of robots mostly wait, but have processes that must not starve: one lane of them runs at a time, next to the
# others, which yield the processor to it.
test: setup-test ## Set up, run all checks and tests but the long ones.
	@echo "checks, ROS 2 and ROS 1 tests run one after the other, in parallel to the others, and print their results at the end"
	@$(MAKE) --no-print-directory --jobs 2 --output-sync=target --keep-going test-others test-robots

test-robots: setup-test
	@$(MAKE) --no-print-directory --jobs 1 --keep-going check test-ros2 test-ros1

# "+" keeps the progress on the screen; MAKEFLAGS would reach the commands that tests start.
test-others: setup-test
	+MAKEFLAGS= nice -n 10 $(BIN)/python -m pytest -n $(WAITING) $(SPREAD) $(RERUN) -m "not ros and not ros2 and not long"

test-ros1: setup-test ## Run the tests that need ROS 1.
	$(BIN)/python -m pytest -n 2 $(SPREAD) $(RERUN) -m "ros and not long"

test-ros2: setup-test ## Run the tests that need ROS 2.
	.venv-ros2/bin/python -m pytest -n 2 $(SPREAD) $(RERUN) -m "ros2 and not long" tests/ros/ros2

test-long: setup-test fuzz ## Run the long tests, which make test leaves out, and fuzz every loader.
	$(BIN)/python -m pytest -n $(WAITING) $(SPREAD) -m "long and not ros2"
	HYPOTHESIS_PROFILE=new $(BIN)/python -m pytest -n $(WAITING) $(SPREAD) -m "hypothesis and not ros2"
	scripts/install_ros2.sh long
	.venv-ros2/bin/python -m pytest -n 2 $(SPREAD) -m "long and ros2" tests/ros/ros2

check: setup-test ## Run linter, format check, type check and import contracts.
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy --explicit-package-bases examples/*.py
	$(BIN)/lint-imports --no-cache

check-fast: setup-test ## Run checks and quick tests (no ROS, browser or PostgreSQL).
	@$(MAKE) --no-print-directory --jobs 2 --keep-going check test-quick

test-quick: setup-test
	$(BIN)/python -m pytest -n 2 $(SPREAD) -m "not slow and not ros and not ros2 and not browser and not postgresql and not long"

fuzz: setup-test ## Feed FUZZ_COUNT invalid inputs, drawn from FUZZ_SEED, to every loader.
	$(BIN)/python -m tests.fuzz --seed $(FUZZ_SEED) --count $(FUZZ_COUNT)
	VSNBENCH_FUZZ_SEED=$(FUZZ_SEED) VSNBENCH_FUZZ_FRAMES=$(FUZZ_COUNT) $(BIN)/python -m pytest -n 2 tests/models/remote/test_fuzz.py

fmt: setup-test ## Format the code and apply automatic fixes.
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: setup-test ## Run the measured comparisons that take minutes; benchmarks/README.md lists all.
	for name in $(BENCHES); do echo "== benchmarks/$$name.py"; $(BIN)/python benchmarks/$$name.py || exit 1; done

bench-compare: setup-test ## Compare time, memory and output of commands with COMMIT, by default the last tag.
	$(BIN)/python benchmarks/compare_commits.py $(COMMIT)

docs: setup-test ## Regenerate figures and generated pages.
	$(BIN)/python scripts/make_docs.py

docs-site: setup-docs ## Build the documentation site in build/site.
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "build/site/index.html"

weights: setup-test ## Train the small PIRLNav weights (1.5 h); resumes a stopped training.
	nice -n 10 $(BIN)/python -m training --recipe full --output training-runs/full --workers 2 --threads 2

dist: setup-dist ## Build the wheel and the source archive in dist/ and check them.
	rm -rf dist
	$(BIN)/python -m build --quiet
	$(BIN)/twine check --strict dist/*
	$(BIN)/check-wheel-contents dist/*.whl

clean: ## Remove environments and generated files.
	rm -rf .venv .venv-ros2 $(DEMO_RESULTS) .mypy_cache .ruff_cache .pytest_cache .hypothesis build dist
