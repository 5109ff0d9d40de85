# SPDX-License-Identifier: GPL-2.0-or-later
# The kernel module. Kbuild builds where its sources are, so it gets a tree of links to
# them, one per kernel: $(O)/module/RELEASE.
#
#   KDIR=DIR         headers of another kernel than the running one
#   INCISE_SIM=m     incise_sim.ko too, the simulated chip that tests use
#   INCISE_PLAN=n    without plans: no LOAD_PLAN, no mode POSE
#   W=1 C=2          as in the kernel

KDIR ?= /lib/modules/$(shell uname -r)/build

module_uts = $(KDIR)/include/generated/utsrelease.h
module_release = $(shell sed -n 's/.*UTS_RELEASE "\(.*\)"/\1/p' $(module_uts))
module_dir = $(O)/module/$(module_release)
module_make = +$(MAKE) --no-print-directory -C $(module_dir)/driver KDIR=$(abspath $(KDIR))

module_headers:
	@test -e $(module_uts) || { \
		echo "make: no kernel headers in $(KDIR): install linux-headers-$$(uname -r)," \
			"or give KDIR=DIR" >&2; exit 1; }

# Links that have lost their file go, or a source that was removed would still be built.
module: module_headers ## incise_stepper.ko for the running kernel, or for KDIR=DIR
	@mkdir -p $(module_dir)/lib
	@cp -rsf $(abspath driver) $(module_dir)/
	@cp -rsf $(abspath $(addprefix lib/,fixed include number tissue)) $(module_dir)/lib/
	@find $(module_dir) -xtype l -delete
	$(module_make) modules

# Where depmod looks first. The kernel's own depmod step wants System.map, which Debian's
# headers do not have, and says that it was skipped: hence ours.
module_folder := updates
module_installed = $(DESTDIR)$(INSTALL_MOD_PATH)/lib/modules/$(module_release)/$(module_folder)
depmod = $(if $(DESTDIR)$(INSTALL_MOD_PATH),:,depmod $(module_release))

module_install: module ## install the module for that kernel, below $(DESTDIR)$(INSTALL_MOD_PATH)
	$(module_make) INCISE_SIM= modules >/dev/null
	$(module_make) INCISE_SIM= modules_install INSTALL_MOD_DIR=$(module_folder) \
		INSTALL_MOD_PATH=$(abspath $(DESTDIR)$(INSTALL_MOD_PATH))
	$(depmod)

module_uninstall: module_headers ## remove what module_install installed
	rm -f "$(module_installed)"/incise_stepper.ko*
	$(depmod)

# The name of a Raspberry Pi's chip, and of the node of its GPIO lines where that is not gpio.
soc_rpi3 := bcm2837
soc_rpi4 := bcm2711
soc_rpi5 := bcm2712
pins_rpi5 := rp1_gpio

overlays: $(patsubst soc_%,$(O)/overlays/incise-stepper-%.dtbo,$(filter soc_%,$(.VARIABLES))) ## device-tree overlays for Raspberry Pi 3, 4 and 5

# The phandles are those of the tree that it is laid over.
$(O)/overlays/incise-stepper-%.dtbo: driver/overlays/incise-stepper.dts
	@mkdir -p $(@D)
	$(Q)$(CPP) -P -undef -x assembler-with-cpp -DBOARD='"brcm,$(soc_$*)"' -DPINS=$(or $(pins_$*),gpio) $< | \
		dtc -@ -W no-gpios_property -I dts -O dtb -o $@ -

# A source tree for dkms, which then builds the module for each kernel that is installed.
# Without the simulator, which is for tests.
srcdir ?= $(prefix)/src
dkms_dir = $(srcdir)/incise-$(version)
dkms_sources = $(addprefix driver/,Kbuild Makefile compat/probe overlays/incise-stepper.dts) \
	$(filter-out %.mod.c,$(wildcard $(addprefix driver/,*.[ch] uapi/*.h compat/*.c))) \
	$(wildcard lib/fixed/*.[ch] lib/tissue/*.proto.[ch] lib/tissue/*.def) \
	$(addprefix lib/number/,both.h fixed.h fixed_kind.h no_kind.h) \
	$(shell grep -l __KERNEL__ lib/include/incise/*.h) \
	$(addprefix lib/include/incise/,export.h stepper_state.h tick_flags.h tool.h)
dkms_folders = $(patsubst %/,%,$(sort $(dir $(dkms_sources))))
dkms_record = $(dkms_dir)/installed-files

dkms_install: ## install the module's sources for dkms in $(DESTDIR)$(srcdir)
	$(INSTALL) -d $(foreach folder,$(dkms_folders),"$(DESTDIR)$(dkms_dir)/$(folder)")
	for file in $(dkms_sources); do \
		$(INSTALL) -m 644 $$file "$(DESTDIR)$(dkms_dir)/$$file" || exit 1; \
	done
	sed 's|@version@|$(version)|' driver/dkms.conf.in >"$(DESTDIR)$(dkms_dir)/dkms.conf"
	printf '%s\n' $(addprefix $(dkms_dir)/,$(dkms_sources) dkms.conf) >"$(DESTDIR)$(dkms_record)"

dkms_uninstall: ## remove what was recorded as installed there
	@if [ ! -e "$(DESTDIR)$(dkms_record)" ]; then \
		echo "nothing to remove: $(DESTDIR)$(dkms_record) is missing, which 'make dkms_install' writes" >&2; exit 0; \
	fi; \
	$(call remove_recorded,$(dkms_record)); \
	find "$(DESTDIR)$(dkms_dir)" -depth -type d -empty -delete

.PHONY: module module_headers module_install module_uninstall overlays dkms_install dkms_uninstall

module_kernels := main second
check-module: ## the modules for each kernel: W=1, sparse, checkpatch, dkms
	@INCISE_BUILD=$(abspath $(O)) tests/module/check $(module_kernels)

check-module-newest: ## the modules for the newest kernel in Debian, in a chroot
	@mk/deps debian
	@INCISE_BUILD=$(abspath $(O)) tests/module/newest

# .ci/run in a Debian of that release, from a clean clone of HEAD.
check-debian12: ## CI's run on Debian 12, in a chroot
	@mk/deps debian
	@tests/debian/check bookworm

check-debian13: ## CI's run on Debian 13, in a chroot
	@mk/deps debian
	@tests/debian/check trixie

check-container: ## Containerfile on empty Debians 12 and 13, with the demo in it, by podman or chroot
	@mk/deps debian container
	@tests/debian/container bookworm
	@tests/debian/container trixie

.PHONY: check-module check-module-newest check-debian12 check-debian13 check-container
