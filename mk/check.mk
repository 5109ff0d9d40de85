# SPDX-License-Identifier: GPL-2.0-or-later
# The two levels of the check, and what looks at the check itself.
#
#   make check                         before each commit, and on each submission: some ten minutes
#   make check-full                    everything: an hour and more
#   make check-full PARTS="vm attack"  parts of it
#
# A part is a target that tests/timed runs: it keeps its time and what it prints. A part that fails
# keeps none from running but those that use what it builds.
times := $(O)/times
jobs = $(if $(findstring --jobserver,$(MAKEFLAGS)),,-j$(shell expr $$(nproc) + 1))
timed = $(MAKE) $(jobs) -k --no-print-directory $(addprefix timed-,$1)
timed-%:
	+@tests/timed $(times) $* $(MAKE) -k --no-print-directory $(part_$*)

# A test that runs for longer is ended, with its name. It hangs: all cases, beside the other parts of
# check-full, take some minutes of a processor.
LIMIT_S ?= 600
all_cases := CASES=all$(if $(filter file,$(origin LIMIT_S)), LIMIT_S=3600)

# What is built for `check` is in a folder of its own: one build of library, programs and tests, which
# stops at any bad access or undefined operation.
sanitize_flags := -fsanitize=address,undefined -fno-sanitize-recover=all
sanitized := CFLAGS="-O1 -g1 $(sanitize_flags)" LDFLAGS="$(sanitize_flags)"
checked := O=$(O)/check $(sanitized)

# Parts of check, and their commands where they differ from the name.
part_style := check-style
part_build := $(checked) check-build
part_layers := $(checked) check-layers
part_unit := $(checked) INCISE_MESSAGES=$(abspath $(O))/check/messages/unit check-unit
part_kept := $(checked) check-kept
part_commands := $(checked) INCISE_MESSAGES=$(abspath $(O))/check/messages/cli check-commands
part_messages := $(checked) SOME=yes check-messages

check-build: libs tools unit-programs $(kept_programs) cli-needs
# A sanitizer calls dlopen() for a program, which forgets that program's own search path.
check-commands: cli-needs
	$(Q)LD_LIBRARY_PATH=$(abspath $(O))/lib $(bats) $(bats_jobs) --filter-tags check tests/cli

check-quick:
	+@rm -rf $(O)/check/messages; mkdir -p $(O)/check/messages; \
	status=0; $(call timed,style build) || status=$$?; \
	NEEDS=build $(call timed,layers unit kept commands) || status=$$?; \
	$(call timed,messages) || status=$$?; exit $$status

check: ## install what is missing, build and test: some ten minutes
	+@mk/deps build check demo
	$(call in_parts,check-quick)
	@echo "make check-full runs everything (an hour and more): all cases, all tests of the commands, attacks, kernels, packages"

# Parts of check-full beside those of check. Each installs what it needs.
part_plain := check-unit $(all_cases)
part_cli := check-cli $(all_cases)
part_attack := check-attack $(all_cases)
part_fuzz := check-fuzz
part_python := check-python
part_tsan := check-tsan
part_rtsan := check-rtsan
part_vm := check-vm
part_clocks := check-clocks
part_deb := check-deb
part_module := check-module
part_wheel := check-wheel
part_site := check-site
part_arm64 := check-arm64
part_bare := check-debian12 check-debian13 check-container
part_programs := all cli-needs peers unit-programs
full_parts := check plain cli attack fuzz python tsan rtsan vm clocks module deb wheel site arm64 bare
PARTS ?= $(full_parts)
deps_rtsan := rtsan
deps_vm := vm
deps_clocks := vm
deps_module := module vm
deps_deb := deb debian
deps_wheel := wheel
deps_site := site
deps_arm64 := debian
deps_bare := debian container

# Guests in real time, and the check on other Debians, run alone at the end.
check-parts:
	+@status=0; \
	$(if $(filter check,$(PARTS)),$(MAKE) --no-print-directory check-quick || status=$$?;) \
	$(call timed,programs) || status=$$?; \
	NEEDS=programs $(call timed,$(filter-out check clocks bare,$(PARTS))) || status=$$?; \
	$(foreach part,$(filter clocks bare,$(PARTS)),$(call timed,$(part)) || status=$$?;) \
	exit $$status

check-full: ## everything; PARTS="vm attack" for some of: check plain cli attack fuzz python tsan rtsan vm clocks module deb wheel site arm64 bare
	@$(if $(filter-out $(full_parts),$(PARTS)),echo "make check-full: no part $(filter-out $(full_parts),$(PARTS)); there are: $(full_parts)" >&2; exit 2)
	+@mk/deps build check full demo; $(foreach part,$(PARTS),$(if $(deps_$(part)),\
		mk/deps $(deps_$(part)) || echo "going on without what $(part) needs";))
	$(call in_parts,check-parts)

in_parts = +@mkdir -p $(O); rm -rf $(times) $(times).logs; status=0; \
	tests/timed $(times) whole $(MAKE) --no-print-directory $1 || status=$$?; \
	tests/timed $(times); exit $$status

# Tests whose outcome may be left to chance, again and again; see tests/repeat.
TIMES ?= 20
check-repeat: ## PART=check-unit TIMES=20 [BUSY=2] [CPUS=0]: a part so often, beside busy programs; appends to build/repeat.log
	+@BUSY="$(BUSY)" CPUS="$(CPUS)" MAKE="$(MAKE)" tests/repeat $(O)/repeat.log "$(PART)" $(TIMES)

# Lines and branches of lib/ that a level runs: make coverage [LEVEL=full]. With both levels measured
# it lists what check loses.
LEVEL ?= check
coverage: export GCOV_ERROR_FILE := /dev/null
coverage: ## lines and branches per layer that check runs; LEVEL=full: check-full; lists what check loses
	+@mk/deps build check $(if $(filter full,$(LEVEL)),full)
	+@$(MAKE) --no-print-directory O=$(O)/coverage CFLAGS="-O0 -g --coverage" LDFLAGS="--coverage" coverage-$(LEVEL)

coverage-begin:
	@find $(O) -name '*.gcda' -delete 2>/dev/null; :
coverage-check: coverage-begin
	+@$(MAKE) -k --no-print-directory check-build && for part in check-unit check-kept check-commands; do \
		$(MAKE) --no-print-directory $$part >$(O)/$$part.log || echo "$$part failed: see $(O)/$$part.log"; done
	@tests/coverage $(O) check
coverage-full: coverage-begin
	+@$(MAKE) -k --no-print-directory check-build peers && for part in "check-unit CASES=all" check-kept check-cli check-attack; do \
		$(MAKE) --no-print-directory $$part >$(O)/$${part%% *}.log || echo "$$part failed: see $(O)/$${part%% *}.log"; done
	@tests/coverage $(O) full

# For arm64, by a cross compiler: what records, learns and renders, whose integers are the same on all machines.
# Random scenes under a closed loop take an hour under qemu-user, and are no more of a machine than the others.
arm64_layers := number base fixed model surface tissue control sim scene loop learn calib signal record publish replay
arm64_units = $(filter-out %/extremes %/rest_3d,$(foreach layer,$(arm64_layers),$(filter $(O)/tests/unit/$(layer)/%,$(unit_programs))))
arm64-build: libs tools $(arm64_units)
arm64-units: arm64-build
	@$(run_units) $(arm64_units)
check-arm64: libs tools ## core, record and learn for arm64: unit tests under qemu-user, and integers that are the same
	@mk/deps debian
	@tests/arm64/check bookworm $(O)

.PHONY: check-arm64 arm64-build arm64-units
.PHONY: check check-quick check-build check-commands check-full check-parts check-repeat coverage coverage-begin coverage-check coverage-full
