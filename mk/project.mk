# SPDX-License-Identifier: GPL-2.0-or-later
# Where the project lives, stated here alone: its home page, its tracker of faults, and whom to write to. What is
# empty is left out; mk/project fills the rest into `incise --help`, manual pages, debian/control, CITATION.cff,
# metadata of the wheel and the site.
PROJECT_HOME ?=
PROJECT_TRACKER ?=
PROJECT_CONTACT ?=
export PROJECT_HOME PROJECT_TRACKER PROJECT_CONTACT

# What has them is made again when they change.
$(O)/obj/project: every-time
	@mkdir -p $(@D); echo '$(PROJECT_HOME) $(PROJECT_TRACKER) $(PROJECT_CONTACT)' | cmp -s - $@ || \
		echo '$(PROJECT_HOME) $(PROJECT_TRACKER) $(PROJECT_CONTACT)' >$@
$(O)/obj/tools/incise.o $(man_pages:%=$(O)/%): $(O)/obj/project
ifneq ($(PROJECT_HOME)$(PROJECT_TRACKER)$(PROJECT_CONTACT),)
$(O)/obj/tools/incise.o: cppflags += -DPROJECT='$(shell mk/project help)'
endif
