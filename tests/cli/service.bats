# SPDX-License-Identifier: GPL-2.0-or-later
# The units of the haptic service: what systemd says of them, and what they hold on to.

load cli

setup() {
	work_folder
	dest=$PWD/dest
	env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL -u DESTDIR make -s -C "$root" \
		O="$INCISE_BUILD" install DESTDIR="$dest" prefix=/usr
	units=$dest/usr/lib/systemd/system
	haptic=$units/incise-haptic@.service
	feed=$units/incise-feed@.service
	off=$units/incise-stepper-off@.service
}

systemd_analyze() {
	command -v systemd-analyze >/dev/null || skip "systemd-analyze is not installed"
	systemd-analyze --no-pager "$@"
}

@test "units are where systemd looks for them, with the folder of the programs" {
	[ "$(cd "$units" && ls)" = \
		"$(printf '%s\n' incise-devices.service incise-feed@.service incise-haptic@.service incise-serve.service incise-stepper-off@.service incise-stepper.service)" ]
	run ! grep -r '@[a-z]*@' "$units"
	grep -q '^ExecStart=/usr/bin/incise haptic ' "$haptic"
	grep -q '^ExecStart=/usr/bin/incise feed ' "$feed"
	grep -q '^ExecStart=/usr/bin/incise stepper disable ' "$off"
	[ -x "$dest$(sed -n 's/^ExecStart=\([^ ]*\).*/\1/p' "$units/incise-stepper.service")" ]
}

# verify wants the programs to be there: those of the build are. Instances stand for templates;
# a second scene has characters that are not letters.
@test "systemd understands the units without a line" {
	mkdir try
	for unit in "$units"/*.service; do
		sed "s|/usr/bin/incise |$INCISE_BUILD/bin/incise |; s|/usr/share/incise/stepper-setup |$root/udev/stepper-setup |" \
			"$unit" >"try/${unit##*/}"
	done
	for unit in incise-devices incise-feed@neck incise-haptic@neck incise-haptic@neck_2.a incise-serve incise-stepper incise-stepper-off@neck; do
		SYSTEMD_UNIT_PATH="$PWD/try:" run -0 systemd_analyze verify --man=no "$unit.service"
		[ -z "$output" ]
	done
	# the check can fail
	sed -i 's/^KillMode=.*/KillMode=gently/' try/incise-haptic@.service
	SYSTEMD_UNIT_PATH="$PWD/try:" run systemd_analyze verify --man=no incise-haptic@neck.service
	[ -n "$output" ]
}

@test "manual pages that the units name are installed" {
	sed -n 's/^Documentation=//p' "$units"/*.service | tr ' ' '\n' | sort -u >pages
	[ "$(wc -l <pages)" -ge 3 ]
	while IFS='()' read -r page section; do
		page=${page#man:}
		[ -f "$dest/usr/share/man/man$section/$page.$section" ] ||
			complain "$page($section) is not installed"
	done <pages
}

@test "the sandbox: systemd's exposure is 2.5 or less" {
	for unit in "$units"/*.service; do
		run -0 systemd_analyze security --offline=true --threshold=25 "$unit"
		[[ "$output" == *"Overall exposure level"* ]]
	done
	# the check can fail
	sed '/^SystemCall\|^Protect\|^Capab\|^Restrict/d' "$haptic" >"$PWD/open.service"
	run ! systemd_analyze security --offline=true --threshold=25 "$PWD/open.service"
}

# Options are words, and the last one wins.
@test "the services run what their programs understand" {
	for name in haptic feed; do
		read -ra words < <(sed -n 's/^ExecStart=//p' "$units/incise-$name@.service")
		"${words[0]/#\/usr\/bin/$INCISE_BUILD/bin}" $name --help >help
		for word in "${words[@]:2}"; do
			case $word in
			--) ;;
			--*) grep -qE "^ +(-[a-z], )?$word( |\$)" help || complain "no option $word" ;;
			esac
		done
		[ "${words[-1]}" = %i ]
		[ "${words[-2]}" = -- ]
		[ "${words[-3]}" = "\$${name^^}_OPTIONS" ]
	done
	[ "$(sed -n 's/^ExecStart=//p' "$units/incise-serve.service")" = '/usr/bin/incise serve --verbose $SERVE_OPTIONS' ]
	read -ra words < <(sed -n 's/^ExecStart=//p' "$off")
	"${words[0]/#\/usr\/bin/$INCISE_BUILD/bin}" stepper --help >help
	grep -qE '^ +disable ' help
	grep -qE '^ +-r, --rig ' help
}

@test "the example of haptic.env is read by a shell's rules, and changes nothing as it is" {
	run ! grep -vE '^(#.*)?$' "$dest/usr/share/incise/haptic.env.example"
	# with its line in effect, its options exist
	sed -n 's/^#HAPTIC_OPTIONS=/HAPTIC_OPTIONS=/p' "$dest/usr/share/incise/haptic.env.example" >env
	[ "$(wc -l <env)" = 1 ]
	. ./env
	[ -n "$HAPTIC_OPTIONS" ]
	incise haptic --help >help
	for word in $HAPTIC_OPTIONS; do
		case $word in
		-*) grep -qE "(^| )$word[ ,]" help || complain "no option $word" ;;
		esac
	done
}

# Names in /proc/devices, of the kernel's sources: a name that no driver has lets nobody in.
@test "device classes of the driver are those that it registers" {
	name=$(sed -n 's/.*alloc_chrdev_region(.*"\(.*\)").*/\1/p' "$root/driver/stepper_device.c")
	[ -n "$name" ]
	for unit in "$haptic" "$off"; do
		grep -qx "DeviceAllow=char-$name rw" "$unit"
		# all others are classes too, but for one node without a class of its own
		sed -n 's/^DeviceAllow=//p' "$unit" >devices
		run ! grep -vE '^char-[A-Za-z_-]+ rw$|^/dev/cpu_dma_latency rw$' devices
	done
}
