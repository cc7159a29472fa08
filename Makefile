# The commands of the README and the developers' ones. make study makes an environment in .venv from requirements.lock;
# what needs tests, linters, compilers or Sphinx adds requirements-dev.lock. Where two processes work side by side, each
# has one thread for its small dense matrices: more only get in each other's way.

PYTHON ?= $(shell for p in python3.12 python3.13 python3.11 python3; do \
  $$p -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null && echo $$p && break; done)
OUT ?= out

.PHONY: study check test study-tests benchmarks scaling verification compose compose-data robustness spreads films-in-time hidden hidden-page verdict-cases fuzz mutants mutants-again mutants-page hostile drawings signals optimum outlines map lumped-build paper coupons coupon-rubbers external house verdict-pictures page-pictures doc-pictures docs locks clean drafts release-check

# Compiled modules are kept, whatever the environment says: some hundred processes of the tests would each compile all
# that they import again.
PYTEST = OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= .venv/bin/python -m pytest

study: .venv/ready
	.venv/bin/tympan study -o "$(OUT)"

# Style, types, imports, readability and every command once: what one runs before a commit.
check: .venv/dev
	.venv/bin/ruff check .
	.venv/bin/mypy
	.venv/bin/lint-imports
	$(PYTEST) -n 2 -q -m "not study" tests/commands/test_smoke.py tests/test_readability.py

test: .venv/dev
	$(PYTEST) -n 2 --dist loadfile --no-loadscope-reorder

# The dear tests, of which `make test` runs a tenth: whole verdicts, statistics, every value of a parameter.
study-tests: .venv/dev
	$(PYTEST) -n 2 --dist loadfile --no-loadscope-reorder -m study

benchmarks: .venv/dev
	.venv/bin/python -m benchmarks.reference_problem
	.venv/bin/python -m benchmarks.gradient
	.venv/bin/python -m benchmarks.diagnosis
	.venv/bin/python -m benchmarks.sweep
	.venv/bin/python -m benchmarks.sweep --asked
	.venv/bin/python -m benchmarks.start_up
	.venv/bin/python -m benchmarks.doors
	.venv/bin/python -m benchmarks.transient

scaling: .venv/dev
	.venv/bin/python -m benchmarks.scaling --peers

verification: .venv/dev
	.venv/bin/python -m benchmarks.verification

# Every question of every film and rig, or of PAIRS drawn ones by a SEED; goes on from OUT/compose.
compose: .venv/dev
	OPENBLAS_NUM_THREADS=1 .venv/bin/python -m benchmarks.compose "$(OUT)/compose" $(if $(PAIRS),--pairs $(PAIRS)) $(if $(SEED),--seed $(SEED))

# What a diagnosis says of readings of every film and rig, with nothing hidden and with an effect; half an hour.
compose-data: .venv/dev
	OPENBLAS_NUM_THREADS=1 .venv/bin/python -m benchmarks.compose.data "$(OUT)/compose-data" -o docs/data-matrix.md

robustness: .venv/dev
	OPENBLAS_NUM_THREADS=1 .venv/bin/python -m benchmarks.trials.robustness --workers 2 -o docs/robustness.md
	OPENBLAS_NUM_THREADS=1 .venv/bin/python -m benchmarks.trials.extreme_films --workers 2 --keep extreme-films.jsonl -o docs/robustness.md

# Whether the printed errors of a film's limits hold, on films that are swapped, mirrored and meshed more finely.
spreads: .venv/dev
	OPENBLAS_NUM_THREADS=1 .venv/bin/python -m benchmarks.trials.mesh_spreads --workers 2 --keep mesh-spreads.jsonl -o docs/robustness.md

films-in-time: .venv/dev
	OPENBLAS_NUM_THREADS=1 .venv/bin/python -m benchmarks.trials.random_films_in_time --workers 2 -o docs/films-in-time.md

hidden: .venv/dev
	OPENBLAS_NUM_THREADS=1 .venv/bin/python -m benchmarks.trials.hidden_effects --workers 2 --keep hidden-trials.jsonl -o docs/hidden-effects.md

# The pages of which all trials are published, without running one.
hidden-page: .venv/dev
	.venv/bin/python -m benchmarks.trials.hidden_effects --minutes 0 --whole --keep benchmarks/trials/hidden-trials.jsonl -o docs/hidden-effects.md

verdict-cases: .venv/dev
	.venv/bin/python -m benchmarks.trials.verdict_cases

# Inputs changed at random for MINUTES, from a SEED where one is given; seeds and counts of each kind are printed.
fuzz: .venv/dev
	.venv/bin/python -m benchmarks.trials.fuzz --minutes "$(or $(MINUTES),60)" $(if $(SEED),--seed $(SEED))

# Small faults made on purpose, and the tests that notice them; hours. Interrupted, it goes on.
# Sixty of the whole program, ten rules of the judgement, and ten of the verdict alone, which the judgement ends with.
MUTANTS = OPENBLAS_NUM_THREADS=1 .venv/bin/python -m benchmarks.trials.mutants
MUTANTS_OF = "" -judgement -verdict
MUTANTS_TITLES = "The whole program" "Rules of the judgement" "Rules of the verdict"
mutants: .venv/dev
	mkdir -p "$(OUT)/mutants"
	$(MUTANTS) draw "$(OUT)/mutants/drawn.jsonl" --seed "$(or $(SEED),2026)"
	$(MUTANTS) draw "$(OUT)/mutants/drawn-judgement.jsonl" --seed "$(or $(SEED),2026)" --rules --count 10 --scope studies/diagnosis/inference studies/diagnosis/gain.py
	$(MUTANTS) draw "$(OUT)/mutants/drawn-verdict.jsonl" --seed "$(or $(SEED),2026)" --rules --count 10 --scope studies/diagnosis/inference/verdict.py
	test -f "$(OUT)/mutants/map/tests.json" || $(MUTANTS) map "$(OUT)/mutants/map" -- -q -n 2 --dist loadfile tests
	for of in $(MUTANTS_OF); do $(MUTANTS) judge "$(OUT)/mutants/drawn$$of.jsonl" --map "$(OUT)/mutants/map" --keep "$(OUT)/mutants/records$$of.jsonl" --tests tests --workers 2 || exit 1; done
	$(MUTANTS) table $(foreach of,$(MUTANTS_OF),"$(OUT)/mutants/drawn"$(of).jsonl) --keep $(foreach of,$(MUTANTS_OF),"$(OUT)/mutants/records"$(of).jsonl) --titles $(MUTANTS_TITLES) -o docs/mutants.md

# The recorded mutants again, each by the test that caught it, and their page: half an hour.
MUTANTS_KEPT = benchmarks/trials/mutants
mutants-again: .venv/dev
	for of in $(MUTANTS_OF); do $(MUTANTS) judge $(MUTANTS_KEPT)/drawn$$of-2026.jsonl --keep $(MUTANTS_KEPT)/records$$of-2026.jsonl --again || exit 1; done
	$(MAKE) mutants-page

# Their page alone, by the records.
mutants-page: .venv/dev
	$(MUTANTS) table $(foreach of,$(MUTANTS_OF),$(MUTANTS_KEPT)/drawn$(of)-2026.jsonl) --keep $(foreach of,$(MUTANTS_OF),$(MUTANTS_KEPT)/records$(of)-2026.jsonl) --titles $(MUTANTS_TITLES) -o docs/mutants.md

# Commands with bad input: status, seconds, message; counts for each group.
hostile: .venv/dev
	.venv/bin/python -m benchmarks.trials.hostile

# Tables as laboratories have them: what drafts make of each, beside what its writer means.
drafts: .venv/dev
	.venv/bin/python -m benchmarks.trials.lab_drafts

# Drawings as programs write them, of known shapes: read right, or refused with advice that works.
drawings: .venv/dev
	.venv/bin/python -m benchmarks.trials.drawings

# Commands ended by signals at random moments, and killed: statuses, and what was lost or wrong.
signals: .venv/dev
	.venv/bin/python -m benchmarks.trials.signals
	.venv/bin/python -m benchmarks.trials.signals --kill

outlines: .venv/ready
	.venv/bin/tympan outlines -o "$(OUT)"

map: .venv/ready
	.venv/bin/tympan map -o "$(OUT)"

paper: .venv/dev
	.venv/bin/tympan lumped paper -o "$(OUT)/paper"
	.venv/bin/python -m benchmarks.paper "$(OUT)/paper"
	.venv/bin/python -m benchmarks.paper_in_time -o docs

optimum: .venv/dev
	.venv/bin/python -m benchmarks.optimum

lumped-build: .venv/dev
	.venv/bin/python -m benchmarks.lumped_build

coupons: .venv/dev
	.venv/bin/python -m benchmarks.vhb

# Rubbers whose law is known: fits of their coupons, and films by these; some 20 minutes.
coupon-rubbers: .venv/dev
	.venv/bin/python -m benchmarks.trials.coupons.rubbers

external: .venv/dev
	.venv/bin/python -m benchmarks.external -o docs

house: .venv/dev
	.venv/bin/python -m benchmarks.house

# The pictures of docs/explanation/verdict.md.
verdict-pictures: .venv/dev
	OPENBLAS_NUM_THREADS=1 .venv/bin/python -m benchmarks.verdict_pictures -o docs

# Those that explain pages: where zero is, curves with their limits.
page-pictures: .venv/dev
	OPENBLAS_NUM_THREADS=1 .venv/bin/python -m benchmarks.page_pictures -o docs

# The hero and the thumbnails in space, docs/hero.webp and docs/thumbnails/; some two minutes of processor time.
doc-pictures: .venv/dev
	OPENBLAS_NUM_THREADS=1 .venv/bin/python -m benchmarks.doc_pictures -o docs

# Without network once its packages are there; warnings are errors.
docs: .venv/dev
	.venv/bin/python -m sphinx -W --keep-going -q -b html -d build/doctrees docs build/docs
	@echo build/docs/index.html

# The locks are whole, so that pip looks for nothing else; Python compiles what is imported, a third of what is there.
INSTALL = .venv/bin/python -m pip install --quiet --disable-pip-version-check --no-compile --no-deps

.venv/dev: .venv/ready requirements-dev.lock
	$(INSTALL) --requirement requirements-dev.lock
	@touch $@

.venv/ready: requirements.lock pyproject.toml
	@test -n "$(PYTHON)" || { echo "tympan needs Python 3.11, 3.12 or 3.13: install the Debian package python3"; exit 1; }
	@$(PYTHON) -c "import ensurepip, venv" 2>/dev/null || \
	  { echo "$(PYTHON) cannot make environments: install the Debian package python3-venv"; exit 1; }
	@$(PYTHON) -m tympan.base.system
	$(PYTHON) -m venv --clear .venv
	$(INSTALL) --requirement requirements.lock
	$(INSTALL) --editable .
	@touch $@

LOCK = uv pip compile pyproject.toml --quiet --universal --no-header --python-version 3.11

# Both locks again, after a change of pyproject.toml; what is in both has one version.
locks:
	$(LOCK) --extra dev --extra docs --extra cad -o requirements-dev.lock >/dev/null
	$(LOCK) --extra cad --extra explore --extra sheets --extra completion --constraint requirements-dev.lock --no-annotate -o requirements.lock >/dev/null

# Wheel and source archive, installed into empty environments in another folder and tried, with each extra, then left in
# dist/; some eight minutes and 4 GB for a Python. Those of 3.11 to 3.13 that start, or PYTHONS.
release-check:
	$(PYTHON) -m benchmarks.release $(PYTHONS)

clean:
	rm -rf .venv out build dist tympan.egg-info
