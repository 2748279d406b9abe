# Everything runs in .venv, which the first target makes. `make demo` and `make test` need nothing else.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed
JOBS   ?= auto
PEERS  := .venv-peers
# Without byte code, every process that a test starts would compile the package again.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: help demo test test-accuracy test-browser test-kernel-usb check format bench bench-peers bench-hidden bench-rigs bench-rules docs pages recordings firmware test-firmware test-qemu fuzz clean

help:
	@echo "make demo        fly the mock rig, identify, compare, diagnose, report"
	@echo "make test        the tests"
	@echo "make test-accuracy  estimates and diagnoses of more simulated flights against the truth (10 minutes)"
	@echo "make test-browser  the HTML report in headless Chromium (fetches 50 MB; apt-get install chromium)"
	@echo "make test-kernel-usb  the USB and serial ports through a real Linux USB stack (Debian; fetches 100 MB)"
	@echo "make check       lint, formatting, types and wording"
	@echo "make bench       re-measure every figure in docs/results/benchmarks.md (TOPIC=cli: that one)"
	@echo "make bench-peers other people's tools on the same flights (long; Octave where installed)"
	@echo "make bench-hidden flights that hide a cause, and who finds it (long; resumes where it stopped)"
	@echo "make bench-rigs  the same on rigs that the diagnosis was not made on (long; resumes)"
	@echo "make bench-rules  what each rule of the diagnosis is worth on these flights (long; resumes)"
	@echo "make docs        the documentation as a site, build/site/index.html; its pictures; its tutorials, run"
	@echo "make pages       compute the tables in docs/ again"
	@echo "make recordings  re-make the reference recordings that ship"
	@echo "make firmware    the device side in C, as a program on a PTY: build/firmware/heli3dof-rig"
	@echo "make test-firmware  its own tests, and against the Python side"
	@echo "make test-qemu   its image for a microcontroller board, in qemu-system-arm"
	@echo "make fuzz        its core under a sanitizer (FUZZ_SECONDS=60)"

$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "heli3dof needs Python 3.11 or newer; $(PYTHON) is older. Try: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	@touch $@

demo: $(STAMP)
	$(BIN)/heli3dof demo

test: $(STAMP)
	$(BIN)/python -m tests.compile_first
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal

test-accuracy: $(STAMP)
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal -m accuracy

test-browser: $(STAMP)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[browser]'
	HELI3DOF_BROWSER=1 $(BIN)/python -m pytest -n 0 tests/report/pages/test_browser.py

# Debian's qemu and kernel, unpacked into build/, never installed; CASES: words of the cases to run.
test-kernel-usb: $(STAMP)
	@if command -v cc >/dev/null; then $(FIRMWARE); else echo "no C compiler: without the firmware"; fi
	$(BIN)/python -m tests.kernel_usb.run $(CASES)

check: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m tests.docs.wording

format: $(STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(STAMP)
	$(BIN)/python -m tests.bench $(TOPIC)

# Peers pin libraries of their own, so they get an environment of their own.
$(PEERS)/.installed: constraints-peers.txt
	$(PYTHON) -m venv $(PEERS)
	$(PEERS)/bin/python -m pip install --quiet --requirement constraints-peers.txt
	@touch $@

bench-peers: $(STAMP) $(PEERS)/.installed
	$(BIN)/python -m tests.bench peers

# HIDDEN_FIRST: the first seed (0: the final tables), HIDDEN_SHARE: of the cases. They and bench-rigs run on the Dask
# cluster that DASK_SCHEDULER_ADDRESS names, if it is set; its workers need a checkout of this commit.
bench-hidden: $(STAMP) $(PEERS)/.installed
	$(BIN)/python -m tests.bench hidden

bench-rigs: $(STAMP)
	$(BIN)/python -m tests.bench rigs

bench-rules: $(STAMP)
	$(BIN)/python -m tests.bench rules

# The computed blocks of the pages; tests compare the committed text with them.
docs: $(STAMP)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev,docs]'
	$(BIN)/python -m tests.docs.pictures
	$(BIN)/python -m tests.docs.gallery
	$(BIN)/python -m tests.docs.site
	$(BIN)/python -m pytest -q -m tutorial tests/docs

pages: $(STAMP)
	$(BIN)/python -m tests.pages

recordings: $(STAMP)
	$(BIN)/python -m heli3dof_recordings.make

FIRMWARE := $(MAKE) --no-print-directory -C drivers/firmware BUILD=$(CURDIR)/build/firmware

firmware:
	$(FIRMWARE)

test-firmware: $(STAMP)
	$(BIN)/python -m pytest tests/drivers/firmware

test-qemu: $(STAMP)
	HELI3DOF_QEMU=1 $(BIN)/python -m pytest tests/drivers/firmware/test_qemu.py

fuzz:
	$(FIRMWARE) fuzz

clean:
	rm -rf $(VENV) $(PEERS) build dist *.egg-info
