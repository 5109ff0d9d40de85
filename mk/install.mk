# SPDX-License-Identifier: GPL-2.0-or-later
# install, uninstall, packages and wheels.

headers := $(wildcard lib/include/incise/*.h)
scenes := $(wildcard scenes/*.scene scenes/*.fis scenes/*.tex)
report_files := $(addprefix tools/report/,report.py tables.py compare.py measure.py bench.j2 assess.j2 demo.j2 document.css)
examples := $(wildcard doc/*.example)
unit_scripts := udev/stepper-setup
# All but the main page of the headers' reference, which is in that.
documents := README.md CHANGELOG.md $(O)/doc/options.md \
	$(filter-out doc/reference.md,$(wildcard doc/*.md doc/*.svg doc/*.png))
# Sources of examples, not what was built of them.
example_files := $(addprefix examples/,README.md Makefile own_loop.c slow_host.c tracker_lines.c haptic_page/device.c \
	haptic_page/owner.h openhaptics/device.c forcedimension/device.c mujoco/incise_plugin.c mujoco/scara.xml sofa/neck.py)
example_scripts := $(addprefix examples/,capture_to_figure.sh learn.py haptic_page/device.py mujoco/robot_cuts_neck.py)
udev_rules := $(wildcard udev/*.rules)
sysusers := $(wildcard udev/*.sysusers)
tmpfiles := $(wildcard udev/*.tmpfiles)
units := $(filter-out $(left_out_commands:%=udev/incise-%.service.in),$(wildcard udev/*.service udev/*.service.in))

python_files := $(wildcard python/incise/*.py) python/incise/py.typed
# The libraries of this installation, unless they are where the system looks.
python_installed := $(if $(filter-out no,$(rpath)),_installed.py)

# Every file that `install` makes. It records their names, and uninstall removes just what is recorded.
installed = $(addprefix $(bindir)/,$(notdir $(programs))) \
	$(foreach lib,$(libraries),$(addprefix $(libdir)/lib$(lib).so,.$(version) .$(soversion)) \
		$(libdir)/lib$(lib).so) \
	$(addprefix $(libdir)/incise/,$(addsuffix .so,$(add_ons))) \
	$(addprefix $(includedir)/incise/,$(notdir $(headers))) \
	$(foreach lib,$(libraries),$(libdir)/pkgconfig/$(lib).pc) \
	$(foreach page,$(notdir $(man_pages)),$(mandir)/man$(subst .,,$(suffix $(page)))/$(page)) \
	$(addprefix $(datadir)/incise/scenes/,$(notdir $(scenes))) \
	$(addprefix $(datadir)/incise/schema/,$(notdir $(schemas))) \
	$(addprefix $(datadir)/incise/report/,$(notdir $(report_files))) \
	$(addprefix $(datadir)/incise/,$(notdir $(examples) $(unit_scripts))) \
	$(addprefix $(docdir)/,$(notdir $(documents)) $(example_files) $(example_scripts)) \
	$(addprefix $(pythondir)/incise/,$(notdir $(python_files)) $(python_installed)) \
	$(completiondir)/incise $(zshcompletiondir)/_incise \
	$(addprefix $(udevrulesdir)/,$(notdir $(udev_rules))) \
	$(addprefix $(sysusersdir)/,$(patsubst %.sysusers,%.conf,$(notdir $(sysusers)))) \
	$(addprefix $(tmpfilesdir)/,$(patsubst %.tmpfiles,%.conf,$(notdir $(tmpfiles)))) \
	$(addprefix $(unitdir)/,$(patsubst %.in,%,$(notdir $(units))) incise-feed@.service)

folders = $(patsubst %/,%,$(sort $(dir $(installed))))

record = $(datadir)/incise/.installed

# The folders that install had to make, so that uninstall removes just these, be
# they empty: /usr/local of a fresh Debian is full of empty ones.
made_folders = $(datadir)/incise/.folders

# $1: a list of files in $(DESTDIR), and itself.
remove_recorded = while IFS= read -r file; do rm -f -- "$(DESTDIR)$$file"; done <"$(DESTDIR)$1" && \
	rm -f -- "$(DESTDIR)$1"

install: all ## install below $(DESTDIR)$(prefix)
	@made=$$(for folder in $(folders); do \
		while [ ! -d "$(DESTDIR)$$folder" ] && [ "$$folder" != / ]; do \
			echo "$$folder"; folder=$$(dirname "$$folder"); \
		done; \
	done | sort -u) && \
	$(INSTALL) -d $(foreach folder,$(folders),"$(DESTDIR)$(folder)") && \
	printf '%s\n' $$made >>"$(DESTDIR)$(made_folders)" && \
	printf '%s\n' $(installed) >>"$(DESTDIR)$(record)"
	$(INSTALL) -m 755 $(programs) "$(DESTDIR)$(bindir)"
	for lib in $(libraries); do \
		$(INSTALL) -m 644 $(O)/lib/lib$$lib.so.$(version) "$(DESTDIR)$(libdir)" && \
		ln -sf lib$$lib.so.$(version) "$(DESTDIR)$(libdir)/lib$$lib.so.$(soversion)" && \
		ln -sf lib$$lib.so.$(soversion) "$(DESTDIR)$(libdir)/lib$$lib.so" || exit 1; \
	done
	for module in $(add_ons); do \
		$(INSTALL) -m 644 $(O)/lib/incise/$$module.so "$(DESTDIR)$(libdir)/incise" || exit 1; \
	done
	$(INSTALL) -m 644 $(headers) "$(DESTDIR)$(includedir)/incise"
	$(foreach lib,$(libraries),sed -e 's|@prefix@|$(prefix)|' -e 's|@libdir@|$(libdir)|' \
		-e 's|@includedir@|$(includedir)|' -e 's|@version@|$(version)|' \
		-e 's|@name@|$(lib)|' -e 's|@about@|$(about_$(lib))|' \
		-e 's|@requires@|$(needs_$(lib))|' \
		mk/library.pc.in >"$(DESTDIR)$(libdir)/pkgconfig/$(lib).pc" &&) :
	for page in $(man_pages); do \
		$(INSTALL) -m 644 $(O)/$$page "$(DESTDIR)$(mandir)/man$${page##*.}" || exit 1; \
	done
	$(INSTALL) -m 644 $(scenes) "$(DESTDIR)$(datadir)/incise/scenes"
	$(INSTALL) -m 644 $(schemas) "$(DESTDIR)$(datadir)/incise/schema"
	$(INSTALL) -m 644 $(report_files) "$(DESTDIR)$(datadir)/incise/report"
	$(INSTALL) -m 644 $(examples) "$(DESTDIR)$(datadir)/incise"
	$(INSTALL) -m 755 $(unit_scripts) "$(DESTDIR)$(datadir)/incise"
	$(INSTALL) -m 644 $(documents) "$(DESTDIR)$(docdir)"
	for file in $(example_files); do $(INSTALL) -m 644 $$file "$(DESTDIR)$(docdir)/$$file" || exit 1; done
	for file in $(example_scripts); do $(INSTALL) -m 755 $$file "$(DESTDIR)$(docdir)/$$file" || exit 1; done
	$(INSTALL) -m 644 tools/incise.bash "$(DESTDIR)$(completiondir)/incise"
	$(INSTALL) -m 644 $(python_files) "$(DESTDIR)$(pythondir)/incise"
	$(if $(python_installed),printf '# Written by make install.\nLIBDIR = "%s"\nDATADIR = "%s"\n' \
		'$(libdir)' '$(datadir)' >"$(DESTDIR)$(pythondir)/incise/_installed.py")
	$(INSTALL) -m 644 tools/_incise "$(DESTDIR)$(zshcompletiondir)"
	$(INSTALL) -m 644 $(udev_rules) "$(DESTDIR)$(udevrulesdir)"
	for file in $(sysusers); do \
		$(INSTALL) -m 644 $$file \
			"$(DESTDIR)$(sysusersdir)/$$(basename $$file .sysusers).conf" || exit 1; \
	done
	for file in $(tmpfiles); do \
		$(INSTALL) -m 644 $$file \
			"$(DESTDIR)$(tmpfilesdir)/$$(basename $$file .tmpfiles).conf" || exit 1; \
	done
	for file in $(units); do \
		sed 's|@bindir@|$(bindir)|; s|@datadir@|$(datadir)|' $$file \
			>"$(DESTDIR)$(unitdir)/$$(basename $$file .in)" || exit 1; \
	done
	sed -f udev/incise-feed@.service.sed "$(DESTDIR)$(unitdir)/incise-haptic@.service" \
		>"$(DESTDIR)$(unitdir)/incise-feed@.service"
	@$(if $(filter /usr /usr/local,$(prefix)),,printf '%s\n' \
		"systemd and udev do not look below $(prefix); for the services type:" \
		"  sudo systemctl link $(unitdir)/*.service" \
		"  sudo systemd-sysusers $(sysusersdir)/*.conf && sudo systemd-tmpfiles --create $(tmpfilesdir)/*.conf" \
		"  sudo ln -s $(udevrulesdir)/*.rules /etc/udev/rules.d/ && sudo udevadm control --reload")

uninstall: ## remove what install recorded as installed
	@if [ ! -e "$(DESTDIR)$(record)" ]; then \
		echo "nothing to remove: $(DESTDIR)$(record) is missing, which 'make install' writes" >&2; exit 0; \
	fi; \
	made=$$(sort -ru "$(DESTDIR)$(made_folders)") && $(call remove_recorded,$(record)) && \
	rm -f "$(DESTDIR)$(made_folders)" $(foreach file,$(python_files:.py=),\
		"$(DESTDIR)$(pythondir)/incise/__pycache__/$(notdir $(file))".*.pyc); \
	for folder in "$(pythondir)/incise/__pycache__" $$made; do \
		rmdir "$(DESTDIR)$$folder" 2>/dev/null || :; \
	done

# All that a wheel holds beside python/incise; programs and libraries find each other in it.
BUNDLE ?= $(O)/bundle
bundle: all ## programs, libraries, scenes and pages in one folder, BUNDLE, that may be moved
	$(INSTALL) -d $(addprefix $(BUNDLE)/,bin lib/incise man $(addprefix share/incise/,scenes schema report))
	$(INSTALL) -m 644 mk/wheel/installed.py $(BUNDLE)/__init__.py
	$(INSTALL) -m 755 $(programs) $(BUNDLE)/bin
	for lib in $(libraries); do \
		$(INSTALL) -m 755 $(O)/lib/lib$$lib.so.$(version) $(BUNDLE)/lib/lib$$lib.so.$(soversion) || exit 1; \
	done
	$(INSTALL) -m 755 $(add_ons:%=$(O)/lib/incise/%.so) $(BUNDLE)/lib/incise
	$(INSTALL) -m 644 $(man_pages:%=$(O)/%) $(BUNDLE)/man
	$(INSTALL) -m 644 $(scenes) $(BUNDLE)/share/incise/scenes
	$(INSTALL) -m 644 $(schemas) $(BUNDLE)/share/incise/schema
	$(INSTALL) -m 644 $(report_files) $(BUNDLE)/share/incise/report

ARCH ?= $(shell uname -m)
wheel: ## a wheel of incise for Python with all of it inside, in dist/; ARCH=aarch64: by a cross compiler, in dist/aarch64/
	@mk/deps wheel
	@mk/wheel/make $(O)/wheel dist$(if $(filter-out $(shell uname -m),$(ARCH)),/$(ARCH)) $(version) $(ARCH)

check-wheel: ## wheels and source distribution: Python 3.9, 3.11 and 3.13 in Debians without a compiler, aarch64 under qemu-user
	@mk/deps wheel
	@tests/wheel/check $(O)/wheel $(version)

deb: ## Debian packages of the tree as it is, in build/deb
	@mk/deps build deb
	+@mk/deb $(abspath $(O))/deb $(version)

check-deb: ## the packages: lintian, then installed, tried and purged in a clean Debian
	@if mk/deps build deb; then \
		mk/deb $(abspath $(O))/deb $(version) && tests/debian/packages $(abspath $(O))/deb; \
	else \
		echo "skipped: Debian packages, for what builds them is missing"; \
	fi

.PHONY: install uninstall bundle wheel check-wheel deb check-deb
