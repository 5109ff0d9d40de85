# SPDX-License-Identifier: GPL-2.0-or-later
# Access to the device nodes of steppers and sources: the rules and the group that make install brings.

load cli

setup() {
	work_folder
	dest=$PWD/dest
	env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL -u DESTDIR make -s -C "$root" \
		O="$INCISE_BUILD" install DESTDIR="$dest" prefix=/usr
	rules=$dest/usr/lib/udev/rules.d/70-incise-stepper.rules
	sources=$dest/usr/lib/udev/rules.d/70-incise-sources.rules
	loop=$dest/usr/lib/udev/rules.d/70-incise-loop.rules
}

@test "the group and the rules are where systemd looks for them" {
	cmp "$root/udev/70-incise-stepper.rules" "$rules"
	cmp "$root/udev/70-incise-sources.rules" "$sources"
	cmp "$root/udev/70-incise-loop.rules" "$loop"
	cmp "$root/udev/incise.tmpfiles" "$dest/usr/lib/tmpfiles.d/incise.conf"
	cmp "$root/udev/incise.sysusers" "$dest/usr/lib/sysusers.d/incise.conf"
}

@test "the device node is for the group, and never for everyone" {
	grep -hv '^#' "$rules" "$sources" "$loop" >plain
	# each rule that gives away a node gives it to the group, with both of its words
	[ "$(grep -c GROUP plain)" = "$(grep -c 'GROUP="incise", MODE="0660", TAG+="uaccess"' plain)" ]
	grep -q 'GROUP="incise", MODE="0660", TAG+="uaccess"' plain
	# no mode has a bit for others
	grep -o 'MODE[:+]*="[^"]*"' plain >modes
	run ! grep -v '0"$' modes
	# 73-seat-late.rules reads the tag
	[[ "${rules##*/}" < 73-seat-late.rules ]]
	[[ "${sources##*/}" < 73-seat-late.rules ]]
	[[ "${loop##*/}" < 73-seat-late.rules ]]
}

@test "systemd makes the group, and the user of the service in it" {
	command -v systemd-sysusers >/dev/null || skip "systemd-sysusers is not installed"
	mkdir -p "$dest/etc"
	touch "$dest/etc/passwd" "$dest/etc/group"
	systemd-sysusers --root="$dest" "$dest/usr/lib/sysusers.d/incise.conf"
	gid=$(sed -n 's/^incise:[^:]*:\([0-9]*\):.*/\1/p' "$dest/etc/group")
	[ -n "$gid" ]
	# no shell, no home
	grep -q "^incise:x:[0-9]*:$gid:Haptic loop:/:.*/nologin$" "$dest/etc/passwd"
	[ "$(wc -l <"$dest/etc/passwd")" = 1 ]
	grep -q '^dialout:.*:incise$' "$dest/etc/group"
	# where the group was made by hand, it is the one
	printf 'incise:x:777:\n' >"$dest/etc/group"
	rm "$dest/etc/passwd" "$dest"/etc/*shadow*
	touch "$dest/etc/passwd"
	systemd-sysusers --root="$dest" "$dest/usr/lib/sysusers.d/incise.conf"
	grep -q '^incise:x:[0-9]*:777:' "$dest/etc/passwd"
}

@test "systemd makes the folder of state pages" {
	command -v systemd-tmpfiles >/dev/null || skip "systemd-tmpfiles is not installed"
	[ "$(id -u)" = 0 ] || skip "needs root, who owns the folder"
	mkdir -p "$dest/etc"
	printf 'root:x:0:0::/:/bin/sh\n' >"$dest/etc/passwd"
	printf 'root:x:0:\nincise:x:777:\n' >"$dest/etc/group"
	systemd-tmpfiles --root="$dest" --create "$dest/usr/lib/tmpfiles.d/incise.conf"
	[ "$(stat -c '%a %u:%g' "$dest/run/incise")" = "2775 0:777" ]
}

@test "steppers and trackers pull in the service, and nothing that is pulled out does" {
	wants='ENV{SYSTEMD_WANTS}+="incise-devices.service"'
	[ -f "$dest/usr/lib/systemd/system/incise-devices.service" ]
	for file in "$rules" "$sources"; do
		grep "SYSTEMD_WANTS" "$file" >wants
		[ "$(wc -l <wants)" = 1 ]
		# systemd looks only at devices that have its tag
		grep -qF 'TAG+="systemd", '"$wants" wants
	done
	# every tracker without firmware is one that the driver refuses as well
	sed -n 's/.*{0x\(....\), false, POLHEMUS.*/\1/p' "$root/lib/device/polhemus/polhemus_model.c" |
		sort >refused
	[ -s refused ]
	sed -n 's/.*ATTR{idProduct}!="\([^"]*\)".*WANTS.*/\1/p' "$sources" | tr '|' '\n' | sort |
		diff refused -
}

# udevadm verify came with systemd 254.
@test "udev understands the rules" {
	command -v udevadm >/dev/null || skip "udevadm is not installed"
	udevadm verify --help >/dev/null 2>&1 || skip "this udevadm has no verify"
	run -0 udevadm verify --resolve-names=never "$rules" "$sources" "$loop"
}
