# SPDX-License-Identifier: GPL-2.0-or-later
# A release: its data to try, its tarball, its tag.

example := $(O)/example
$(O)/obj/mk/same_bytes.so: mk/same_bytes.c
	@mkdir -p $(@D)
	$(call step,CC)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) $(warnings) $(CFLAGS) $(LDFLAGS) -fPIC -shared -o $@ $<

example-data: all $(O)/obj/mk/same_bytes.so ## a recording, its model and a task log of the simulated rig, in build/example
	@mk/example-data $(O) $(example)

# What git has committed, the example data and the list of parts: the same bytes for the same commit and seeds.
dist: example-data ## build/dist: tarball of the committed tree with example data, list of parts with licences, SHA-256
	@mk/dist $(O)/dist $(version) $(example)

# CHECK=TARGET: another check than `check`, for a test. It pushes nothing.
CHECK ?= check
release: ## checks and tags vVERSION: clean tree, a branch, CHANGELOG, check, dist; DRY=yes: only says what it would do
	+@MAKE="$(MAKE)" DRY="$(DRY)" mk/release $(version) $(CHECK)

site: all doc ## README, documents, manual, references of C and Python and a search as files, build/site/index.html
	@mk/deps site
	@mk/site/make $(O) $(version)

.PHONY: example-data dist release site
