# SPDX-License-Identifier: GPL-2.0-or-later
# Who may open the device nodes of steppers and sources: the rules and the group that make install brings.

load cli

setup() {
	work_folder
	dest=$PWD/dest
	env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL -u DESTDIR make -s -C "$root" \
		O="$INCISE_BUILD" install DESTDIR="$dest" prefix=/usr
	rules=$dest/usr/lib/udev/rules.d/70-incise-stepper.rules
	sources=$dest/usr/lib/udev/rules.d/70-incise-sources.rules
}

@test "the group and the rules are where systemd looks for them" {
	cmp "$root/udev/70-incise-stepper.rules" "$rules"
	cmp "$root/udev/70-incise-sources.rules" "$sources"
	cmp "$root/udev/incise.sysusers" "$dest/usr/lib/sysusers.d/incise.conf"
}

@test "the device node is for the group, and never for everyone" {
	grep -hv '^#' "$rules" "$sources" >plain
	# each rule that gives away a node gives it to the group, with both of its words
	[ "$(grep -c GROUP plain)" = "$(grep -c 'GROUP="incise", MODE="0660", TAG+="uaccess"' plain)" ]
	grep -q 'GROUP="incise", MODE="0660", TAG+="uaccess"' plain
	# no mode has a bit for others
	grep -o 'MODE[:+]*="[^"]*"' plain >modes
	run ! grep -v '0"$' modes
	# 73-seat-late.rules reads the tag
	[[ "${rules##*/}" < 73-seat-late.rules ]]
	[[ "${sources##*/}" < 73-seat-late.rules ]]
}

@test "systemd makes the group" {
	command -v systemd-sysusers >/dev/null || skip "systemd-sysusers is not installed"
	mkdir -p "$dest/etc"
	touch "$dest/etc/passwd" "$dest/etc/group"
	systemd-sysusers --root="$dest" "$dest/usr/lib/sysusers.d/incise.conf"
	grep -q '^incise:' "$dest/etc/group"
	[ ! -s "$dest/etc/passwd" ]
}

# udevadm verify came with systemd 254.
@test "udev understands the rules" {
	command -v udevadm >/dev/null || skip "udevadm is not installed"
	udevadm verify --help >/dev/null 2>&1 || skip "this udevadm has no verify"
	run -0 udevadm verify --resolve-names=never "$rules" "$sources"
}
