# SPDX-License-Identifier: GPL-2.0-or-later
# incise: see README.md. `make help` lists the targets.
#
#   O=DIR          build there instead of build/
#   prefix, DESTDIR, bindir, libdir, includedir, mandir …   as usual
#   CFLAGS, CXXFLAGS, LDFLAGS, CPPFLAGS   yours; the project's own flags are kept apart
#   V=1            show whole commands
#   CROSS_COMPILE=aarch64-linux-gnu-   builds for another machine, with its compilers, ar, nm and pkg-config
#   RUN=COMMAND    runs a program that a cross compiler made, as qemu-aarch64-static does
#   DEPS=no        let `make demo` and `make check` install no packages

O ?= build
prefix ?= /usr/local
bindir ?= $(prefix)/bin
libdir ?= $(prefix)/lib
includedir ?= $(prefix)/include
datadir ?= $(prefix)/share
mandir ?= $(datadir)/man
docdir ?= $(datadir)/doc/incise
# systemd reads these below /usr/local too
udevrulesdir ?= $(prefix)/lib/udev/rules.d
sysusersdir ?= $(prefix)/lib/sysusers.d
tmpfilesdir ?= $(prefix)/lib/tmpfiles.d
unitdir ?= $(prefix)/lib/systemd/system
# Where Debian's Python looks: below /usr one folder for all its versions.
python_version := $(shell /usr/bin/python3 -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)
pythondir ?= $(prefix)/lib/python$(if $(filter-out /usr,$(prefix)),$(python_version),3)/dist-packages
completiondir ?= $(datadir)/bash-completion/completions
zshcompletiondir ?= $(datadir)/zsh/site-functions

# These go to the shell, and to make's own lists: a name of two words would be two others.
paths := CURDIR O DESTDIR prefix bindir libdir includedir datadir mandir docdir udevrulesdir sysusersdir \
	tmpfilesdir unitdir pythondir completiondir zshcompletiondir srcdir KDIR INSTALL_MOD_PATH BUNDLE
open := (
close := )
hash := \#
awkward := ' " ` ; & | < > * ? $$ % $(hash) \ $(open) $(close) [ ]
$(foreach path,$(paths),$(if $(word 2,[$($(path))])$(strip $(foreach c,$(awkward),$(findstring $(c),$($(path))))),\
	$(error $(path) is "$($(path))": a blank, or one of $(awkward), is in this path; choose another)))

# Programs and libraries find each other by where they are, whatever the prefix. With rpath=no
# the system's own folders are all that is searched, as distributions want it.
rpath ?= yes
runpath = $(if $(filter-out no,$(rpath)),-Wl$(comma)-rpath$(comma)'$$ORIGIN$1')
comma := ,

CFLAGS ?= -O2 -g
# Of C alone, and no flags of C++.
CXXFLAGS ?= $(filter-out -std=% -Wmissing-prototypes -Wstrict-prototypes %implicit-function-declaration %implicit-int,$(CFLAGS))
# Objects come from ccache where it is installed; CCACHE= turns it off.
CCACHE ?= $(shell command -v ccache 2>/dev/null)
INSTALL ?= install

# Where it is missing, nothing is found by it, without a line for each question; a make that this one
# calls looks again.
there = $(shell command -v $(firstword $1) 2>/dev/null)
ifneq ($(CROSS_COMPILE),)
CC = $(CROSS_COMPILE)gcc
CXX = $(CROSS_COMPILE)g++
AR = $(CROSS_COMPILE)ar
NM = $(CROSS_COMPILE)nm
PKG_CONFIG ?= $(if $(call there,$(CROSS_COMPILE)pkg-config),$(CROSS_COMPILE)pkg-config,\
	env PKG_CONFIG_LIBDIR=/usr/lib/$(CROSS_COMPILE:%-=%)/pkgconfig:/usr/share/pkgconfig pkg-config)
endif
PKG_CONFIG ?= pkg-config
NM ?= nm
missing :=
ifeq ($(call there,$(PKG_CONFIG)),)
missing := $(firstword $(PKG_CONFIG))
override PKG_CONFIG := false
unexport PKG_CONFIG
endif

# Goals that need no compiler or install it first; a kernel's headers name its own one.
unbuilt_goals := help clean deps check check-full check-debian12 check-debian13 check-container check-module-newest demo texture bench \
	deb check-deb doc check-doc release wheel check-wheel uninstall readme-figures \
	module module_install module_uninstall dkms_install dkms_uninstall check-module
ifneq ($(filter-out $(unbuilt_goals),$(or $(MAKECMDGOALS),all)),)
missing := $(foreach tool,$(firstword $(CC)) $(firstword $(CXX)) $(firstword $(AR)),$(if $(call there,$(tool)),,$(tool))) $(missing)
ifeq ($(strip $(missing)),)
needed := libconfig $(if $(filter-out core,$(or $(MAKECMDGOALS),all)),sqlite3 zlib libcrypto jansson)
missing := $(if $(shell $(PKG_CONFIG) --exists $(needed) || echo some),$(foreach lib,$(needed),\
	$(shell $(PKG_CONFIG) --exists $(lib) || echo $(lib))))
endif
ifneq ($(strip $(missing)),)
$(error not installed: $(strip $(missing)): run 'make deps', which installs with apt what is needed)
endif
# Clang and gcc give one machine two names, which begin alike.
machine_of = $(firstword $(subst -, ,$(shell $1 -dumpmachine)))
ifneq ($(call machine_of,$(CC)),$(call machine_of,$(CXX)))
$(error CC ($(CC)) builds for $(call machine_of,$(CC)), CXX ($(CXX)) for $(call machine_of,$(CXX)): set both, or CROSS_COMPILE)
endif
ifneq ($(shell echo __SIZEOF_INT128__ | $(CC) $(CFLAGS) -E -P -),16)
$(error $(CC) has no integers of 128 bits, with which models are learned: incise needs a system of 64 bits)
endif
endif

version := $(shell sed -n 's/^\#define INCISE_VERSION "\(.*\)"/\1/p' lib/include/incise/version.h)
# Changes when the binary interface does.
soversion := 2

cppflags := -D_GNU_SOURCE -Ilib/include
CCACHE := $(CCACHE)
cxxflags := -std=c++14 -fPIC -fvisibility=hidden -ffp-contract=off -Wall -Wextra
warnings := -Wall -Wextra -Wmissing-prototypes -Wstrict-prototypes -Wvla \
	-Werror=implicit-function-declaration
# Rows that end early, texts in two parts and empty formats are meant; gcc does not warn of these.
warnings += $(if $(findstring clang,$(CC)),$(addprefix -Wno-,missing-field-initializers string-concatenation format-zero-length))
cflags := -std=gnu11 -fPIC -fvisibility=hidden -fno-math-errno -ffp-contract=off $(warnings)

# One shared object per group of layers; a process maps only the ones it uses.
# The image of a scene needs the libraries of a screen; without them that library and its
# command are not built.
has_view := $(shell $(PKG_CONFIG) --exists sdl2 epoxy cairo egl && echo yes)
libraries := incise incise-learn incise-record $(if $(has_view),incise-view)
layers_incise := base fixed model surface tissue control sim rig device scene loop
layers_incise-learn := learn calib
layers_incise-record := signal record record/write record/read record/old record/join record/verify record/prove publish replay
layers_incise-view := view
pc_incise := libconfig
pc_incise-learn := libcrypto
pc_incise-record := sqlite3 zlib libcrypto
pc_incise-view := sdl2 epoxy cairo egl
# The C library's, which are one since glibc 2.34; what uses none is linked with none.
libs_system := -lm -ldl -pthread
about_incise := haptic cutting: fuzzy force models, virtual rig, scenes and real-time loop
about_incise-learn := haptic cutting: learning models from data
about_incise-record := haptic cutting: recordings and what is exported of them
about_incise-view := haptic cutting: the picture of a scene, its wound and its blood
needs_incise :=
needs_incise-learn := incise
needs_incise-record := incise
needs_incise-view := incise

# A short line for each step of the build; V=1 shows the whole commands.
Q := $(if $(V),,@)
step = $(if $(V),,@printf '  %-4s %s\n' $1 '$(patsubst $(O)/%,%,$@)')

all: libs tools pages
	@$(if $(left_out_names),echo "left out: $(left_out_names); 'make deps' installs what is in brackets")

core: $(O)/lib/libincise.so ## what a loop needs: libincise.so, of libc and libconfig alone
.PHONY: core

.DEFAULT_GOAL := all
.DELETE_ON_ERROR:
.SUFFIXES:

include mk/lib.mk
include mk/tools.mk
include mk/project.mk
include mk/bench.mk
include mk/test.mk
include mk/check.mk
include mk/golden.mk
include mk/fuzz.mk
include mk/rtsan.mk
include mk/vm.mk
include mk/install.mk
include mk/release.mk
include mk/module.mk

help:
	@sed -n 's/^\([a-z][a-z0-9_-]*\):.*## /\1  /p' $(MAKEFILE_LIST) | sort | \
		awk '{ name = $$1; $$1 = ""; printf "%-21s%s\n", name, $$0 }'

clean: ## remove what was built
	@if [ -e "$(O)" ] && [ ! -d "$(O)/obj" ] && [ "$(O)" != build ]; then \
		echo "$(O) is no build folder: it has no obj/; remove it yourself" >&2; exit 1; \
	fi
	rm -rf "$(O)"

# Not of the packages' own build, nor folders of that name, which come and go beside this make.
-include $(shell find $(O) -path $(O)/deb -prune -o -name '*.d' -type f -print 2>/dev/null)

.PHONY: all help clean
