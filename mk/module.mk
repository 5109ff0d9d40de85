# SPDX-License-Identifier: GPL-2.0-or-later
# The kernel module. Kbuild builds where its sources are, so it gets a tree of links to
# them, one per kernel: $(O)/module/RELEASE.
#
#   KDIR=DIR         headers of another kernel than the running one
#   INCISE_SIM=m     incise_sim.ko too, the simulated chip that tests use
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
	@cp -rsf $(abspath lib/fixed) $(abspath lib/include) $(module_dir)/lib/
	@find $(module_dir) -xtype l -delete
	$(module_make) modules

.PHONY: module module_headers
