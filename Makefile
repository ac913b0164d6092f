# Kiln: two commands do everything.  `make demo` bakes a room and says where the package is; `make test` checks the whole project.
.DEFAULT_GOAL := help
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c

KILN := target/debug/kiln
DEMO := demo-out/thesis-room
ROOM := tests/scenes/thesis-room

.PHONY: help demo test page-test lint build soak bench install clean-demo tools test-tools

help: ## List the commands
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "make %-10s %s\n", $$1, $$2}'

# What is missing is installed where that can be done without asking, and named in one sentence where it cannot.
APT := if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then apt-get update -q && apt-get install -y -q

tools:
	@command -v cargo >/dev/null || { echo "Kiln needs Rust 1.95 or newer: install it from https://rustup.rs, then run this again." >&2; exit 1; }
	@if ! command -v cc >/dev/null || ! command -v curl >/dev/null; then $(APT) build-essential curl; \
	  else echo "Kiln needs a C compiler (for SQLite and zstd) and curl (for its tests): on Debian, 'sudo apt-get install build-essential curl', then run this again." >&2; exit 1; fi; fi
	@[ -n "$${KILN_WEB_DIST:-}" ] || { node -e 'const [a, b] = process.versions.node.split(".").map(Number); process.exit(a > 20 || (a === 20 && b >= 19) ? 0 : 1)' 2>/dev/null && command -v npm >/dev/null; } \
	  || { echo "Kiln's page is built with Node.js 20.19 or newer and npm: install them from https://nodejs.org, then run this again, or set KILN_WEB_DIST to the folder of a page that was built elsewhere." >&2; exit 1; }

# What only the tests need: a browser, a software GPU beside the browser's own, the reference compiler of shaders, and Python for servers.
test-tools: tools
	@if ! { [ -n "$${CHROMIUM:-}" ] || command -v chromium >/dev/null || command -v google-chrome >/dev/null; } || ! command -v glslangValidator >/dev/null \
	  || ! PATH=$$PATH:/sbin:/usr/sbin ldconfig -p | grep -q libEGL.so.1 || ! ls /usr/lib/*/dri/swrast_dri.so >/dev/null 2>&1; then $(APT) chromium glslang-tools libgl1-mesa-dri libegl1; \
	  else echo "Kiln's browser tests need Chromium, glslangValidator and Mesa's software GPU: on Debian, 'sudo apt-get install chromium glslang-tools libgl1-mesa-dri libegl1', then run this again." >&2; exit 1; fi; fi
	@if ! ls /usr/lib/postgresql/*/bin/initdb >/dev/null 2>&1 || ! command -v systemd-analyze >/dev/null || ! python3 -c 'import venv, ensurepip' 2>/dev/null; then $(APT) postgresql systemd python3-venv; \
	  else echo "Kiln's tests of the farm need PostgreSQL, systemd-analyze and Python 3.10 or newer with venv (for S3's stand-in and the checks of deploy/): on Debian, 'sudo apt-get install postgresql systemd python3-venv', then run this again." >&2; exit 1; fi; fi

# npm writes this file last: it is newer than the lock file when the packages are those of the lock file.
NPM := npm ci --no-audit --no-fund --ignore-scripts --loglevel=error
coordinator/web/node_modules/.package-lock.json: coordinator/web/package-lock.json
	cd coordinator/web && $(NPM)
tests/browser/node_modules/.package-lock.json: tests/browser/package-lock.json
	cd tests/browser && $(NPM)

build: tools ## Build the kiln command into target/debug
	cargo build --locked --bin kiln

demo: build ## Bake a small room through coordinator and worker and render a view of it; under two minutes on two cores after the build
	rm -rf $(DEMO)
	mkdir -p $(dir $(DEMO))
	$(KILN) bake $(ROOM)/thesis.obj --settings $(ROOM)/nominal.json --texel-scale 0.25 --samples 256 --raw u8 -o $(DEMO)
	$(KILN) inspect $(DEMO)
	$(KILN) render $(DEMO) --eye 10,5,13 --target 4,1.5,4 --fov 50 -o $(DEMO).png
	@echo "The package is in $(DEMO), a view of it in $(DEMO).png; '$(KILN) view $(DEMO)' shows it in a browser,"
	@echo "'$(KILN) inspect --verify $(DEMO)' checks every claim in it."

lint: tools
	cargo fmt --all --check
	cargo clippy --locked --workspace --all-targets -- -D warnings

page-test: tools coordinator/web/node_modules/.package-lock.json ## Types and unit tests of the page
	cd coordinator/web && npm run --silent check && npm run --silent test && npm run --silent build:lib

test: test-tools lint page-test tests/browser/node_modules/.package-lock.json ## Format, lints, unit tests, whole-system and browser tests, documentation tests
	if command -v cargo-nextest >/dev/null; then cargo nextest run --workspace --no-fail-fast --locked; else cargo test --locked --workspace --lib --bins --tests --no-fail-fast; fi
	cargo test --workspace --doc

bench: tools ## Kernels and whole bakes; one JSON line per figure
	cargo bench --workspace

soak: tools ## What takes longer than a test should: fuzzing, all reference queries, a full-size bake, its encodings, benches
	tests/soak.sh

install: tools ## Install an optimised kiln into ~/.cargo/bin
	cargo install --path . --locked

clean-demo:
	rm -rf demo-out
