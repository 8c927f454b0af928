# Every target sets up what it needs on the machine: scripts/setup.sh tells what, and says nothing when
# nothing is missing. All targets build in the release profile, so that dependencies compile once.

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help setup build render bench-scenes test test-all test-ignored second-opinion lint clean

COUSU := $(or $(CARGO_TARGET_DIR),target)/release/cousu
OPINION := $(or $(CARGO_TARGET_DIR),target)/second-opinion

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 16

setup: ## install what building, rendering and testing need (each target does so for itself)
	@scripts/setup.sh build run test lint

build: ## build target/release/cousu
	@scripts/setup.sh build
	cargo build --release

render: ## build, and render assets/cornell.obj to out/cornell.png
	@scripts/setup.sh build run
	cargo build --release
	@mkdir -p out
	$(COUSU) render assets/cornell.obj --size 1024x640 --spp 256 -o out/cornell.png

bench-scenes: ## fetch the real meshes that `cousu bench` also measures, into meshes/, which git ignores
	@scripts/bench-scenes.sh meshes

test: ## run the tests; without a Vulkan device they fail
	@scripts/setup.sh build run test
	cargo test --workspace --release

test-all: test test-ignored ## run the tests, then the long ones that they leave out

test-ignored: ## run only the long tests
	@scripts/setup.sh build run test
	cargo test --workspace --release -- --ignored

second-opinion: ## compare pictures with those of Mitsuba 3, an independent renderer, which pip installs into target/
	@scripts/setup.sh build run python
	cargo build --release
	@test -e $(OPINION)/installed || { python3 -m venv $(OPINION) && \
		$(OPINION)/bin/pip install --quiet mitsuba==3.8.0 numpy && touch $(OPINION)/installed; }
	@set -e; for scene in cornell maison; do \
		$(COUSU) render assets/$$scene.obj --size 256x160 --spp 4096 -o $(OPINION)/$$scene.exr; \
		$(OPINION)/bin/python scripts/compare-mitsuba.py assets/$$scene.obj $(OPINION)/$$scene.exr; \
	done

lint: ## check the formatting, and run clippy with warnings as errors
	@scripts/setup.sh build lint
	cargo fmt --all --check
	cargo clippy --workspace --all-targets --release -- -D warnings

clean: ## remove what was built and rendered
	cargo clean
	rm -rf out
