# Kiln: two commands do everything.  `make demo` bakes a room and says where the package is; `make test` checks the whole project.
.DEFAULT_GOAL := help
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c

KILN := target/debug/kiln
DEMO := demo-out/thesis-room
ROOM := tests/scenes/thesis-room

.PHONY: help demo test lint build soak bench install clean-demo tools

help: ## List the commands
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "make %-10s %s\n", $$1, $$2}'

# What is missing is installed where that can be done without asking, and named in one sentence where it cannot.
tools:
	@command -v cargo >/dev/null || { echo "Kiln needs Rust 1.95 or newer: install it from https://rustup.rs, then run this again." >&2; exit 1; }
	@if ! command -v cc >/dev/null || ! command -v curl >/dev/null; then \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then apt-get update -q && apt-get install -y -q build-essential curl; \
	  else echo "Kiln needs a C compiler (for SQLite and zstd) and curl (for its tests): on Debian, 'sudo apt-get install build-essential curl', then run this again." >&2; exit 1; fi; fi

build: tools ## Build the kiln command into target/debug
	cargo build --locked --bin kiln

demo: build ## Bake a small room through coordinator and worker; under two minutes on two cores after the build
	rm -rf $(DEMO)
	mkdir -p $(dir $(DEMO))
	$(KILN) bake $(ROOM)/thesis.obj --settings $(ROOM)/nominal.json --texel-scale 0.25 --samples 256 --raw u8 -o $(DEMO)
	$(KILN) inspect $(DEMO)
	@echo "The package is in $(DEMO); '$(KILN) inspect --verify $(DEMO)' checks every claim in it."

lint: tools
	cargo fmt --all --check
	cargo clippy --locked --workspace --all-targets -- -D warnings

test: lint ## Format, lints, unit tests, whole-system tests, documentation tests
	if command -v cargo-nextest >/dev/null; then cargo nextest run --workspace --no-fail-fast --locked; else cargo test --locked --workspace --lib --bins --tests --no-fail-fast; fi
	cargo test --workspace --doc

bench: tools ## Kernels and whole bakes; one JSON line per figure
	cargo bench --workspace

soak: tools ## What takes longer than a test should: all reference queries, a full-size bake, its encodings, benches
	tests/soak.sh

install: tools ## Install an optimised kiln into ~/.cargo/bin
	cargo install --path . --locked

clean-demo:
	rm -rf demo-out
