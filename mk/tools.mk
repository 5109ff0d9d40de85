# SPDX-License-Identifier: GPL-2.0-or-later
# The programs. They use public headers only, and find their libraries beside them, in
# the build tree as after installation.

# Commands whose libraries are missing are left out, with their pages.
left_out_commands := $(foreach name,$(left_out),$(commands_$(name)))
commands := $(filter-out $(left_out_commands),$(patsubst tools/incise-%.c,%,$(wildcard tools/incise-*.c)))
programs := $(O)/bin/incise $(addprefix $(O)/bin/incise-,$(commands))

$(O)/obj/tools/%.o: pc_cflags = $(shell $(PKG_CONFIG) --cflags jansson)

# incise loads it before incise view, to name a package that is missing, and both to list features.
$(O)/obj/tools/incise.o $(O)/obj/tools/cli/features.o: cppflags += -DVIEW_LIBRARY='"libincise-view.so.$(soversion)"' \
	-DRECORD_LIBRARY='"libincise-record.so.$(soversion)"'

# The kernel module's own interface, for incise info, which looks past the library.
$(O)/obj/tools/stepper/%.o: cppflags += -Idriver

# Printed in the head of each bench's report; without the build's own folder.
$(O)/obj/tools/cli/machine.o: cppflags += -DBUILD_FLAGS='"$(subst ',,$(subst ",,$(filter-out \
	-ffile-prefix-map=% -fdebug-prefix-map=% -fmacro-prefix-map=%,$(CFLAGS))))"'

# Frames that incise serve decodes.
has_jpeg := $(shell $(CC) -E -x c -include stdio.h -include jpeglib.h /dev/null >/dev/null 2>&1 && echo yes)
$(O)/obj/tools/cli/pixels.o: cppflags += $(if $(has_jpeg),-DHAVE_JPEG)

# Pages of incise serve --http.
has_websockets := $(shell $(PKG_CONFIG) --exists libwebsockets && echo yes)
$(O)/obj/tools/incise-serve.o: cppflags += $(if $(has_websockets),-DHAVE_WEBSOCKETS)
$(O)/bin/incise-serve: tool_more_libs += $(if $(has_websockets),$(shell $(PKG_CONFIG) --libs libwebsockets))

# Image files: those that depth is calibrated from, and frames of a view.
has_png := $(shell $(CC) -E -x c -include png.h /dev/null >/dev/null 2>&1 && echo yes)
$(O)/obj/tools/cli/image.o: cppflags += $(if $(has_png),-DHAVE_PNG)

left_out_of_tools := $(if $(has_jpeg),,JPEG) $(if $(has_websockets),,pages) $(if $(has_png),,PNG)

# make's last line, incise --version and doctor print what this build leaves out: "PNG (libpng-dev), …".
left_out_all := $(sort $(left_out) $(left_out_of_tools) $(left_out_commands:%=incise-%))
features := $(if $(left_out_all),$(shell awk -F'"' '/^FEATURE/ { gsub(" ", "|", $$4); n = split($$2, name, " "); \
	while (n) print name[n--] "=" $$4 }' lib/base/features.def))
left_out_names := $(subst |, ,$(subst $() $(),$(comma) ,$(strip $(foreach name,$(left_out_all),\
	$(name)|($(patsubst $(name)=%,%,$(filter $(name)=%,$(features))))))))
ifneq ($(left_out_names),$(file <$(O)/obj/left-out))
$(O)/obj/left-out: every-time
endif
$(O)/obj/left-out:
	@mkdir -p $(@D); echo '$(left_out_names)' >$@
$(O)/obj/tools/cli/features.o: $(O)/obj/left-out
$(O)/obj/tools/cli/features.o: cppflags += -DLEFT_OUT='"$(left_out_names)"'
.PHONY: every-time

# The parts of all programs. The linker takes of them, and of the libraries, what a program
# uses: a new part, command or benchmark is found by its place.
tool_parts := $(O)/obj/tools/parts.a
tool_texts := $(wildcard tools/cli/*.gp tools/bench/plots/*.gp tools/web/viewer.*)
$(tool_parts): $(patsubst %.c,$(O)/obj/%.o,$(filter-out $(if $(filter serve,$(commands)),,tools/serve/igtl.c) $(if $(has_websockets),,tools/serve/http%.c),$(wildcard tools/*/*.c))) $(tool_texts:%=$(O)/obj/%.o)
	@rm -f $@
	$(call step,AR)
	$(Q)$(AR) rcs $@ $^

# A script of gnuplot, or of a browser: scenes.gp becomes the string text_scenes_gp.
$(tool_texts:%=$(O)/obj/%.o): $(O)/obj/%.o: %
	@mkdir -p $(@D)
	$(call step,CC)
	$(Q){ echo 'extern const char text_$(subst .,_,$(notdir $<))[];'; \
		echo 'const char text_$(subst .,_,$(notdir $<))[] ='; \
		sed 's/[\\"?]/\\&/g; s/.*/"&\\n"/' $<; echo ';'; } | \
		$(CC) $(cflags) $(CFLAGS) -x c -c -o $@ -

# Another project's evaluator beside ours in incise bench: a shared object of its own,
# built where its headers are. It is for measuring, and is not installed.
peer := $(if $(shell $(CXX) -E -x c++ -include fl/Headers.h /dev/null >/dev/null 2>&1 && \
	echo yes),\
	$(O)/lib/incise/peer_fuzzylite.so)

$(O)/lib/incise/peer_%.so: tools/bench/references/%.cc $(O)/lib/libincise.so
	@mkdir -p $(@D) $(O)/obj/tools/bench/references
	$(call step,LD)
	$(Q)$(CXX) -std=c++14 -fPIC -fvisibility=hidden -Wall -Wextra $(cppflags) $(CPPFLAGS) $(CXXFLAGS) \
		-MMD -MP -MF $(O)/obj/tools/bench/references/$*.d -shared $(LDFLAGS) -o $@ $< \
		-L$(O)/lib -lincise -l$*

# And one that is a script, which runs where Python has it.
peer += $(O)/lib/incise/peer_scikit_learn.py

$(O)/lib/incise/peer_%.py: tools/bench/references/%.py
	@mkdir -p $(@D)
	$(Q)cp $< $@

# OpenIGTLink's messages, as the tracker reads them.
$(O)/bin/incise-serve: $(O)/obj/lib/device/igtl/igtl_message.o
$(O)/bin/incise-serve: tool_more_libs += $(libs_tracker_igtl)

# The benchmarks simulate a device exactly, which the library itself has no use for.
$(O)/bin/incise-bench: $(O)/obj/lib/control/plant.o
tool_libs := $(patsubst %,-l%,$(libraries))
tool_more_libs := $(if $(has_png),-lpng) $(if $(has_jpeg),-ljpeg) $(libs_system)

$(programs): $(O)/bin/%: $(O)/obj/tools/%.o $(tool_parts) $(foreach lib,$(libraries),$(O)/lib/lib$(lib).so)
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(CFLAGS) $(LDFLAGS) -Wl,--as-needed $(call runpath,/../lib) \
		-Wl,-rpath-link,$(O)/lib -L$(O)/lib -o $@ $(filter %.o,$^) $(tool_parts) $(tool_libs) \
		$(tool_more_libs) $(shell $(PKG_CONFIG) --libs jansson)

# Scenes by name, and the script of reports, as after installation.
$(O)/share/incise/scenes: shared = scenes
$(O)/share/incise/report: shared = tools/report
$(O)/share/incise/scenes $(O)/share/incise/report:
	@mkdir -p $(@D)
	$(Q)ln -s $(abspath $(shared)) $@

tools: $(programs) $(peer) | $(O)/share/incise/scenes $(O)/share/incise/report

# Tables of settings in pages of section 5: the rows are read by the library alone.
$(O)/obj/mk/settings: mk/settings.c $(call objects,incise)
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) $(cflags) $(CFLAGS) $(LDFLAGS) -o $@ $^ $(pc_libs_incise) $(libs_system)

$(O)/obj/mk/settings.tables: $(O)/obj/mk/settings
	$(Q)$(RUN) $< >$@

$(O)/man/rig.conf.5: $(wildcard lib/*/*/rig.conf.5)
$(O)/man/%.5: man/%.5 mk/manual-tables mk/manual-output $(wildcard schema/*.rows) $(O)/obj/mk/settings.tables
	@mkdir -p $(@D)
	$(call step,MAN)
	$(Q)mk/manual-tables $(O)/obj/mk/settings.tables $< >$@.lists
	$(Q)mk/manual-output <$@.lists >$@
	@rm $@.lists
# Manual pages, and the list of all options: the tables that --help prints are stated in the programs
# alone. Pages of what is not built are left out.
man_pages := $(filter-out $(left_out_commands:%=man/incise-%.1) $(left_out_commands:%=man/incise-%.service.8),$(wildcard man/*.[1-8]))
tables := $(patsubst $(O)/bin/%,$(O)/obj/tools/%.table,$(programs))

$(O)/obj/tools/%.table: $(O)/bin/%
	$(Q)LD_LIBRARY_PATH=$(O)/lib $(RUN) $< --table >$@

$(O)/man/%.1: man/%.1 mk/manual mk/manual-tables mk/manual-output $(wildcard schema/*.rows) \
		$(O)/obj/tools/%.table $(O)/obj/mk/settings.tables
	@mkdir -p $(@D)
	$(call step,MAN)
	$(Q)mk/manual $(O)/obj/tools/$*.table $< >$@.lists
	$(Q)mk/manual-tables $(O)/obj/mk/settings.tables $@.lists >$@.tables
	$(Q)mk/manual-output <$@.tables >$@
	@rm $@.lists $@.tables

$(O)/man/%: man/% mk/manual-output $(wildcard schema/*.rows)
	@mkdir -p $(@D)
	$(Q)mk/manual-output <$< >$@

$(O)/doc/options.md: mk/options $(tables)
	@mkdir -p $(@D)
	$(Q)$< $(filter-out %/incise.table,$(tables)) >$@

# The keys of each report: its JSON Schema, and its list in the page.
schemas := $(patsubst %.rows,$(O)/%.json,$(wildcard schema/*.rows))
$(schemas): $(O)/%.json: %.rows mk/schema
	@mkdir -p $(@D)
	$(Q)mk/schema $< >$@

pages: $(man_pages:%=$(O)/%) $(O)/doc/options.md $(schemas)

DEMO ?= demo.out

deps: ## install the packages that building, testing and the demo need
	@mk/deps build check demo

# The second make sees the packages that the first step brought.
demo: ## walk paper 1 on the virtual rig; results in demo.out/index.html
	@mk/deps demo
	+@$(MAKE) --no-print-directory all
	$(O)/bin/incise demo -o $(DEMO) --overwrite

texture: ## learn the texture of the shipped liver again, from the virtual rig
	+@$(MAKE) --no-print-directory all
	$(O)/bin/incise capture -o $(O)/liver.rec --overwrite --rig sim:seed=1,clock=simulated -c none --camera off
	$(O)/bin/incise train $(O)/liver.rec -o scenes/liver.fis.tex --overwrite
	@sed -i '1i # SPDX-License-Identifier: GPL-2.0-or-later\n# As make texture writes it.' scenes/liver.fis.tex

bench: ## measure everything on this machine; one report in build/bench/
	@mk/deps build bench
	+@$(MAKE) --no-print-directory all
	$(O)/bin/incise bench all -o $(O)/bench --overwrite

readme-figures: ## put the summary of that report, and two of its figures, into doc/evidence.md
	mk/readme-figures $(O)/bench

.PHONY: tools pages deps demo texture bench readme-figures
