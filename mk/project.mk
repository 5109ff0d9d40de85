# SPDX-License-Identifier: GPL-2.0-or-later
# Where the project lives, stated here alone: its home page, its tracker of faults, and whom to write to. What is
# empty is left out; mk/project fills the rest into `incise --help`, manual pages, debian/control, CITATION.cff,
# metadata of the wheel and the site.
PROJECT_HOME ?=
PROJECT_TRACKER ?=
PROJECT_CONTACT ?=
export PROJECT_HOME PROJECT_TRACKER PROJECT_CONTACT

# What has them is made again when they change.
project := $(PROJECT_HOME) $(PROJECT_TRACKER) $(PROJECT_CONTACT)
ifneq ($(strip $(project)),$(strip $(file <$(O)/obj/project)))
$(O)/obj/project.h: every-time
endif
$(O)/obj/project.h: mk/project
	@mkdir -p $(@D); mk/project help >$@ && echo '$(project)' >$(O)/obj/project
$(O)/obj/tools/incise.o: cppflags += -include $(O)/obj/project.h
$(O)/obj/tools/incise.o $(man_pages:%=$(O)/%): $(O)/obj/project.h
