# SPDX-License-Identifier: GPL-2.0-or-later
# make module, module_install, dkms_install and what dkms makes of it. Run by
# tests/module/check with INCISE_KDIR, the headers of a kernel.

bats_require_minimum_version 1.5.0

setup() {
	root=$BATS_TEST_DIRNAME/../..
	cd "$BATS_TEST_TMPDIR"
	dest=$PWD/dest
	release=$(sed -n 's/.*UTS_RELEASE "\(.*\)"/\1/p' \
		"$INCISE_KDIR/include/generated/utsrelease.h")
	version=$(sed -n 's/^#define INCISE_VERSION "\(.*\)"/\1/p' \
		"$root/lib/include/incise/version.h")
}

project() {
	env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL -u DESTDIR make --no-print-directory \
		-C "$root" O="$PWD/build" KDIR="$INCISE_KDIR" "$@"
}

# The source tree's files with their times: what a build must leave alone.
tree() {
	(cd "$root" && find driver lib mk udev -printf '%p %T@ %l\n' | sort)
}

@test "without headers one line says which package brings them" {
	run ! project -s module KDIR=/nowhere
	[ "${lines[0]}" = "make: no kernel headers in /nowhere: install linux-headers-$(uname -r), or give KDIR=DIR" ]
}

@test "the module is built beside the source, a second time nothing is; it is installed for its kernel and removed" {
	tree >before
	project -s module
	tree | diff before -
	ko=build/module/$release/driver/incise_stepper.ko
	[ "$(modinfo -F license $ko)" = GPL ]
	[[ "$(modinfo -F vermagic $ko)" == "$release "* ]]
	[ ! -e "${ko%/*}/incise_sim.ko" ]
	touch mark
	project -s module
	[ ! $ko -nt mark ]

	project -s module_install DESTDIR="$dest"
	[ "$(cd "$dest/lib/modules/$release/updates" && find . -type f | sed 's/ko\..z.*/ko/' | sort)" = \
		"./incise_stepper.ko" ]
	project -s module_uninstall DESTDIR="$dest"
	[ -z "$(find "$dest" -type f)" ]
	tree | diff before -
}

@test "dkms builds the module from what dkms_install installs, and both leave nothing" {
	command -v dkms >/dev/null || skip "dkms is not installed"
	[ "$(id -u)" = 0 ] || skip "dkms works as root only"
	project -s dkms_install DESTDIR="$dest" prefix=/usr
	source=$dest/usr/src
	[ ! -e "$source/incise-$version/driver/sim" ]
	mkdir -p tree "lib/modules/$release"
	# depmod looks for these files in a kernel's folder.
	touch "lib/modules/$release"/modules.{order,builtin}
	dkms() {
		command dkms "$@" -m incise -v "$version" --dkmstree "$PWD/tree" \
			--sourcetree "$source" --installtree "$PWD/lib/modules"
	}
	# dkms is a script of bash: it takes this one.
	depmod() {
		command depmod --basedir "$BATS_TEST_TMPDIR" "$@"
	}
	export -f depmod
	dkms add
	dkms build -k "$release" --kernelsourcedir "$INCISE_KDIR"
	built=$(find tree -name 'incise_stepper.ko*' | head -n 1)
	[ -n "$built" ]
	[[ "$(modinfo -F vermagic "$built")" == "$release "* ]]
	dkms install -k "$release"
	grep '^updates/dkms/incise_stepper\.ko' "lib/modules/$release/modules.dep"
	dkms remove --all
	[ -z "$(find tree lib -name '*incise*')" ]
	run ! grep incise "lib/modules/$release/modules.dep"
	project -s dkms_uninstall DESTDIR="$dest" prefix=/usr
	[ -z "$(find "$dest" -type f)" ]
	[ ! -e "$source/incise-$version" ]
}

@test "a kernel that nobody has seen stops the build with the name of what differs" {
	mkdir driver
	(cd "$root/driver" && cp -r Kbuild Makefile compat compat.h "$BATS_TEST_TMPDIR/driver")
	printf '#include "compat.h"\nMODULE_LICENSE("GPL");\nMODULE_DESCRIPTION("test");\n' \
		>driver/stub.c
	printf '// SPDX-License-Identifier: GPL-2.0-only\nint probe = strange();\n' \
		>driver/compat/strange.c
	run ! make -C driver KDIR="$INCISE_KDIR" modules
	[[ "$output" == *"this kernel has neither form of strange that driver/compat knows"* ]]
	# a function that modules may not call is not had, whatever the headers say
	printf '// exported: no_such_function\n' >driver/compat/strange.c
	make -C driver KDIR="$INCISE_KDIR" modules >/dev/null
	grep -qx '/\* no HAVE_STRANGE \*/' driver/compat/config.h
}
