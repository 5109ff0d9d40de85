# SPDX-License-Identifier: GPL-2.0-or-later
# A haptic device over its page: the owner's life, and the force that it gives, by its log. The device is
# tests/haptic/spring.c, where the handle is at 1 mm per N; the program that uses it is tests/haptic/user.c.

load cli

setup() {
	work_folder
	export INCISE_MODULE_PATH=$INCISE_BUILD/tests/haptic
	user=$INCISE_BUILD/tests/haptic/user
	# a page of the test's own
	id=t$BATS_TEST_NUMBER-$$
	rig=spring:$id
}

teardown() {
	local page
	for page in /dev/shm/incise-*"$id"*; do
		[ ! -e "$page" ] || kill "$(owner_of "$page")" 2>/dev/null || :
	done
	[ -z "${device:-}" ] || kill "$device" 2>/dev/null || :
}

page_of() {
	echo /dev/shm/incise-*"$id"*
}

owner_of() {
	od -An -tu4 -j20 -N4 "$1" | tr -d ' '
}

has_page() {
	[ -e "$(page_of)" ]
}

no_page() {
	! has_page
}

# A number of the page; doc/haptic-page.md has its type and byte.
number_of_page() { # TYPE BYTE
	LC_ALL=C od -An "-t$1" "-j$2" "-N${1:1}" "$(page_of)" | tr -d ' '
}

# The owner's ticks: the spring gives a sample at each.
ticks() {
	number_of_page u8 1168
}

# The user's force of 2 N or more holds the spring, whose last place along x the page has, at 2 mm or more.
has_force() {
	local n
	n=$(ticks)
	[ "$n" -gt 0 ] && holds "$(number_of_page f8 $((1600 + 128 * ((n - 1) % 32) + 32))) > 1.9"
}

wants_force() {
	[ "$(number_of_page u4 1476)" = 1 ]
}

ticked_past() {
	[ "$(ticks)" -gt "$1" ]
}

# The owner took the force away more often than so many times.
was_cut() {
	[ "$(number_of_page u4 1448)" -gt "$1" ]
}

# Stop a process until the owner has taken its force away and gone on for 100 ticks.
stop_user() {
	local cuts
	cuts=$(number_of_page u4 1448)
	kill -STOP "$1"
	await was_cut "$cuts"
	await ticked_past $(($(ticks) + 100))
	kill -CONT "$1"
}

# An owner that writes owner.csv, and a user of it in the background; $owner and $using.
serve_logged() {
	incise device "$rig" --no-rt --log owner.csv "$@" >owner.out 2>owner.err 3>&- &
	owner=$!
	await has_page
	"$user" "$rig" 1000000 2 >user.out 2>&1 3>&- &
	using=$!
	await grep -q "test spring" user.out
	await has_force
}

# Of owner.csv: the rows, those with the whole force of 2 N, with a heartbeat older than two periods, those of
# them with a force, and with a force that rose faster than by 2 N in 100 ms.
judge_log() {
	awk -F, 'NR > 1 { rows++; whole += $5 == 2; late = $3 && $2 > 2 * $3; stale += late; bad += late && $5 != 0
		step += NR > 2 && $5 - last > 2.000001 * ($1 - t) / 1e8; last = $5; t = $1 }
		END { print rows + 0, whole + 0, stale + 0, bad + 0, step + 0 }' owner.csv
}

# bats test_tags=check
@test "a rig starts the owner of its device, which serves one program after the other" {
	run -0 "$user" "$rig" 300 1.5
	[[ "${lines[0]}" == "test spring, 3 N, 1000 Hz, 0.1 kg, "* ]]
	[[ "${lines[1]}" == *" samples, "*" lost, up to "* ]]
	first=$(owner_of "$(page_of)")
	[ "$(stat -c %a "$(page_of)")" = 600 ]
	# while the owner lingers, for the default 5 s
	run -0 "$user" "$rig" 300 1.5
	await no_page
	await test ! -e "/proc/$first"
	# a limit of the device, and a rig's own settings of it
	printf 'haptic = "%s";\nhaptic_setup = { peak_N = 1.0; lost_s = 0.2; };\n' "$rig" >rig.conf
	run -0 "$user" rig.conf 300 5
	[[ "${lines[0]}" == "test spring, 1 N, "* ]]
	[[ "${lines[1]}" == *" up to 1.000 mm" || "${lines[1]}" == *" up to 0."*" mm" ]]
	sed -i 's/lost_s = 0.2/lost_s = 60.0/' rig.conf
	run -0 "$user" rig.conf 10
	first=$(owner_of "$(page_of)")
	run -0 "$user" rig.conf 10
	[ "$(owner_of "$(page_of)")" = "$first" ]
	# other settings: another owner
	sed -i 's/peak_N = 1.0/peak_N = 2.0/' rig.conf
	run -0 "$user" rig.conf 10
	[[ "${lines[0]}" == "test spring, 2 N, "* ]]
	[ "$(owner_of "$(page_of)")" != "$first" ]
}

@test "a user that is killed: no force from then on, by each row of the log, and the owner ends" {
	printf 'haptic = "%s";\nhaptic_setup = { lost_s = 0.3; };\n' "$rig" >rig.conf
	rig=rig.conf serve_logged
	run -1 "$user" rig.conf 10
	[[ "$output" == "EBUSY: rig.conf:1: haptic: /dev/shm/incise-"*": another program uses the device; end it" ]]
	kill -9 $using
	wait $owner
	read -r rows whole stale bad step <<<"$(judge_log)"
	[ "$whole" -gt 0 ]
	[ "$stale" -gt 0 ]
	[ "$bad" -eq 0 ]
	[ "$step" -eq 0 ]
	[ "$(tail -n 1 owner.csv | cut -d, -f4-5)" = late,0 ]
	no_page
}

@test "a user that is stopped: no force, and a ramp when it continues" {
	serve_logged
	stop_user $using
	await has_force
	kill $using
	kill $owner
	wait $owner
	read -r rows whole stale bad step <<<"$(judge_log)"
	[ "$stale" -gt 50 ]
	[ "$bad" -eq 0 ]
	[ "$step" -eq 0 ]
	# a force before the longest row of zeros, and behind it
	awk -F, 'NR > 1 { if ($5 == 0) { n++ } else { if (n > most) { most = n; from = NR } n = 0 } row[NR] = $5 }
		END { for (i = 2; i < from; i++) before += row[i] > 0
			for (i = from; i <= NR; i++) behind += row[i] > 0; exit !(before && behind) }' owner.csv
}

# bats test_tags=check
@test "a loop that is stopped counts what its owner took away" {
	# the wall slopes: a handle that leans on it is pushed along x, too
	cat >wall.scene <<-'END'
		tissue = { reaction_N_mm = 0.2; };
		limits = { force_N = 3.0; };
		surface = { kind = "plane"; point_mm = [0.0, 0.0, -1.0]; normal = [0.707106781, 0.0, 0.707106781]; };
	END
	rig=spring:leans=$id
	incise device "$rig" --no-rt >owner.out 2>&1 3>&- &
	device=$!
	await has_page
	incise haptic wall.scene --rig "$rig" --no-rt --state none --json >r.json 2>notes 3>&- &
	using=$!
	await wants_force
	touch "$id"
	await has_force
	stop_user $using
	kill -INT $using
	wait $using
	holds "$(key r.json haptic.cuts) > 0"
	[[ "$(key r.json haptic.last_cut)" =~ ^(late|torn)$ ]]
}

# bats test_tags=check
@test "an owner that ends or is killed: the user gets the reason" {
	serve_logged
	kill $owner
	wait $owner
	wait $using && false
	[[ "$(tail -n 1 user.out)" == "ESHUTDOWN: $rig: Terminated" ]]
	serve_logged --overwrite
	kill -9 $owner
	wait $using && false
	[[ "$(tail -n 1 user.out)" == "ESHUTDOWN: test spring: its owner has no heartbeat any more: "*"; start it again" ]]
	# the page that it left is replaced
	run -0 "$user" "$rig" 10
}

# bats test_tags=check
@test "a device that cannot be opened, fails or is not ready: its cause in one line" {
	rig=spring:no
	run -1 "$user" "$rig" 10
	[ "$output" = "ENODEV: spring:no: no spring is attached; attach one" ]
	run -1 --separate-stderr incise device "$rig" --no-rt
	[ "$stderr" = "incise device: spring:no: no spring is attached; attach one" ]
	run -1 "$user" "spring:dies=500,$id" 100000
	[ "${lines[-1]}" = "ENODEV: the spring broke; wind another" ]
	run -0 "$user" "spring:flag=100,$id" 300
	[ "${lines[-1]}" = "flag: the spring is cold; warm it" ]
	run -1 "$user" "local:$id" 10
	[ "$output" = "ENOENT: local:$id: /dev/shm/incise-$id: no process serves this device; start it" ]
	run -1 --separate-stderr incise device "local:$id" --no-rt
	[[ "$stderr" == "incise device: local:$id: a local: device is served by its own process; start that one" ]]
	run -1 --separate-stderr incise device --rig sim: --no-rt
	[[ "$stderr" == "incise device: sim:: this rig has no haptic device; "* ]]
	run -2 --separate-stderr incise device sim:haptic --rig sim:haptic
	[[ "$stderr" == "incise device: --rig and DEVICE name two devices; give one of them"* ]]
	# a second owner, once the user's own one has left
	await no_page
	incise device "spring:$id" --no-rt >/dev/null 2>&1 3>&- &
	device=$!
	await has_page
	run -1 --separate-stderr incise device "spring:$id" --no-rt
	[[ "$stderr" == *": the device has an owner already; end that process, or use the device through it" ]]
}

# bats test_tags=check
@test "a page whose owner is not ready is named at once, and waited for" {
	python3 -c "
import fcntl, os, signal
page = open('/dev/shm/incise-$id', 'w+b')
page.truncate(5696)
fcntl.lockf(page, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, 0)
print('locked', flush=True)
signal.pause()" >device.out 3>&- &
	device=$!
	await grep -q locked device.out
	run -1 "$user" "local:$id" 10
	[[ "$output" == "EAGAIN: local:$id: /dev/shm/incise-$id: its owner has not written the magic yet: "* ]]
	incise haptic wall --rig "local:$id" --duration 1s >out 2>notes 3>&- &
	using=$!
	await grep -q "warning: local:$id: /dev/shm/incise-$id: its owner has not .*; waiting for it, at most 30 s" notes
	kill $device
	wait $device || :
	wait $using && false
	grep -q "/dev/shm/incise-$id: nobody holds its lock of byte 0: its owner has died, .*; start it again" notes
	rm "/dev/shm/incise-$id"
}

# A device of somebody else's: the force puts 0.1 kg on a spring of 0.2 N/mm to 10 mm, once it is at rest.
# Before all else that runs here where that is allowed: an owner that does not run for 0.1 s counts as gone.
serve_foreign() {
	! chrt -f 10 true 2>/dev/null || set -- chrt -f 10 "$@"
	"$@" "$id" >device.out 2>&1 3>&- &
	device=$!
	await test -e "/dev/shm/incise-$id"
	run "$user" "local:$id" 500 2
	while [[ "$status" = 1 && "$output" == *"its owner has no heartbeat any more: it was killed or stopped"* ]]; do
		kill -0 $device # it was stopped by the machine
		run "$user" "local:$id" 500 2
	done
	[ "$status" = 0 ]
	[[ "${lines[0]}" == "spring in "*", 5 N, 1000 Hz, 0.1 kg, " ]]
	[[ "${lines[1]}" =~ \ up\ to\ ([0-9.]+)\ mm$ ]]
	holds "${BASH_REMATCH[1]} > 1 && ${BASH_REMATCH[1]} < 25"
	"$user" "local:$id" 1000000 2 >user.out 2>&1 3>&- &
	using=$!
	await grep -q "spring in" user.out
	run -1 "$user" "local:$id" 10
	[[ "$output" == "EBUSY: "* ]]
	kill $device
	wait $device
	wait $using && false
	[ "$(tail -n 1 user.out)" = "ESHUTDOWN: stopped; start it again" ]
	[ ! -e "/dev/shm/incise-$id" ]
	# killed, and started again
	"$@" "$id" >device.out 2>&1 3>&- &
	device=$!
	await test -s "/dev/shm/incise-$id"
	kill -9 $device
	wait $device || :
	"$@" "$id" >device.out 2>&1 3>&- &
	device=$!
	await "$user" "local:$id" 10
}

# bats test_tags=check
@test "a device in C, without incise's libraries" {
	"${CC:-cc}" -std=gnu11 -D_GNU_SOURCE -Wall -Wextra -Werror -O2 -I"$root/lib/include" \
		"$root/examples/haptic_page/device.c" -o device -lm
	run ! grep -q incise <(ldd device)
	serve_foreign ./device
}

# bats test_tags=check
@test "a device in Python, by mmap and struct" {
	[ "$(uname -m)" = x86_64 ] || skip "Python orders its stores on x86 alone"
	serve_foreign python3 "$root/examples/haptic_page/device.py"
}
