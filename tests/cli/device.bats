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

# An owner that writes owner.csv, and a user of it in the background; $owner and $using.
serve_logged() {
	incise device "$rig" --no-rt --log owner.csv "$@" >owner.out 2>owner.err 3>&- &
	owner=$!
	await has_page
	"$user" "$rig" 1000000 2 >user.out 2>&1 3>&- &
	using=$!
	await grep -q "test spring" user.out
	sleep 1
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
	[ "$rows" -gt 100 ]
	[ "$stale" -gt 20 ]
	[ "$bad" -eq 0 ]
	[ "$step" -eq 0 ]
	[ "$(tail -n 1 owner.csv | cut -d, -f4-5)" = late,0 ]
	# a force had been given
	awk -F, 'NR > 1 && $5 > 0 { n++ } END { exit !n }' owner.csv
	no_page
}

@test "a user that is stopped: no force, and a ramp when it continues" {
	serve_logged
	kill -STOP $using
	sleep 0.5
	kill -CONT $using
	sleep 0.5
	kill $using
	kill $owner
	wait $owner
	read -r rows whole stale bad step <<<"$(judge_log)"
	[ "$stale" -gt 20 ]
	[ "$bad" -eq 0 ]
	[ "$step" -eq 0 ]
	# a force before the longest row of zeros, and behind it
	awk -F, 'NR > 1 { if ($5 == 0) { n++ } else { if (n > most) { most = n; from = NR } n = 0 } row[NR] = $5 }
		END { for (i = 2; i < from; i++) before += row[i] > 0
			for (i = from; i <= NR; i++) behind += row[i] > 0; exit !(before && behind) }' owner.csv
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
	[ "$output" = "EIO: spring:no: no spring is attached; attach one" ]
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
	# a second owner
	incise device "spring:$id" --no-rt >/dev/null 2>&1 3>&- &
	device=$!
	await has_page
	run -1 --separate-stderr incise device "spring:$id" --no-rt
	[[ "$stderr" == *": the device has an owner already; end that process, or use the device through it" ]]
}

# A device of somebody else's: the force puts 0.1 kg on a spring of 0.2 N/mm to 10 mm, once it is at rest.
serve_foreign() {
	"$@" "$id" >device.out 2>&1 3>&- &
	device=$!
	await test -e "/dev/shm/incise-$id"
	run -0 "$user" "local:$id" 500 2
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
