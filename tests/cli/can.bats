# SPDX-License-Identifier: GPL-2.0-or-later
# The CAN backends with the real programs, against an independent CiA 402 drive over slcan on
# a pty; see tests/can/README.md. tests/vm/guest/can_drive.sh has it on a CAN interface.

load cli
load document
# shellcheck source=tests/can/peer.sh
. "${BATS_TEST_DIRNAME}/../can/peer.sh"

setup() {
	[ -x "$INCISE_BUILD/tests/can/drive" ] ||
		skip "python-canopen is not there; see build/tests/can/venv.log"
	# a device answers in time however busy this machine is
	drive_ahead="chrt --fifo 1"
	$drive_ahead true 2>/dev/null || drive_ahead=
	watch_machine
	work_folder
}

# A drive is lost after 1000 ms, an answer after 200 ms, and four programs take part in one.
teardown() {
	machine_watched 50
	[ -z "${pid:-}" ] || kill -9 "$pid" 2>/dev/null || :
	drive_end
}

@test "the drive of these tests is what python-canopen's own master takes for one" {
	run -0 "$INCISE_BUILD/tests/can/selftest"
	[[ "$output" != *"not ok"* ]]
	[ "${#lines[@]}" -ge 8 ]
}

# Turns of 4 mm and 51200 counts: 12800 counts per mm. The limit switches are at -1.56 mm and
# 46.9 mm of the shaft, which stands at 0 at first.
rig() {
	drive_start "$@" || return
	write_rig
}

# write_rig [MORE [CAN]]: keys that come after the usual ones win nothing: give others.
write_rig() {
	cat >rig.conf <<-END
		tracker = "sim:";
		stepper = "$drive";
		actuator = {
			spring_N_mm = 2.0; travel_mm = 30.0; lead_mm = 4.0;
			velocity_mm_s = 30.0; acceleration_mm_s2 = 2000.0; home_mm_s = 20.0;
			deadman_ms = ${deadman_ms:-1000}; ${1:-}
			can = { bitrate = 1000000; homing_method = 17; ${2:-} };
		};
		sim = { depth_mm = [15]; times = [1000]; };
	END
}

# In the background until the drive has power; its number is $pid. A machine that does not run
# the drive for as long as an answer may take is no fault of either: it is tried again.
late='no answer from node|no answer when|no heartbeat from it|no status .TPDO1.|8130h'
begin() {
	local try i
	for try in 1 2 3; do
		incise "$@" >out 2>err 3>&- 7>&- &
		pid=$!
		for ((i = 0; i < 3000; i++)); do
			drive_is "operation enabled" >/dev/null && return
			kill -0 "$pid" 2>/dev/null || break
			sleep 0.02
		done
		kill -9 "$pid" 2>/dev/null || :
		wait "$pid" || :
		pid=
		grep -qE "$late" err || break
		echo "# the drive was too late, try $try: $(cat err)"
		# It may be the drive that saw the other one too late, and keeps that as a fault.
		incise stepper clear --rig rig.conf >/dev/null 2>&1 3>&- 7>&- || :
	done
	complain "the drive was not enabled: $(cat out err)"
}

# ended TEXT…: what was begun ends within a minute with 1 and one line that holds these (a newline
# in a text separates alternatives); the drive
# is stopped then.
ended() {
	local code=0
	for ((i = 0; i < 3000; i++)); do
		kill -0 "$pid" 2>/dev/null || break
		sleep 0.02
	done
	if kill -0 "$pid" 2>/dev/null; then
		kill -9 "$pid"
		complain "it does not end: $(cat out err)"
		return
	fi
	wait "$pid" || code=$?
	pid=
	echo "# $(cat err)"
	[ "$code" -eq 1 ] || complain "exit $code: $(cat out err)" || return
	[ "$(wc -l <err)" -eq 1 ] || complain "not one line: $(cat err)" || return
	for text; do
		grep -qF -- "$text" err || complain "no '$text' in: $(cat err)" || return
	done
	drive_stopped
}

@test "info lists who is on the bus, with state and fault" {
	drive_start
	run -0 --separate-stderr incise info "${drive%:*}"
	[[ "$output" == *"$drive"* ]]
	[[ "$output" == *"incise-test-drive: switch-on disabled"* ]]
	drive_tell fault 0x3210
	run -0 --separate-stderr incise info "${drive%:*}"
	[[ "$output" == *"fault, "*"3210h"* ]]
	drive_stopped
}

@test "an adapter's bit rate stands behind its tty" {
	rig
	local tty=${drive%:*} rate='500000'
	drive=$tty@$rate:${drive##*:}
	run -0 --separate-stderr incise info "$tty@$rate"
	# What it prints can be copied.
	[[ "$output" == *"$drive"* ]] || complain "$output"
	drive_tell report
	[ "$(drive_value bitrate)" = "$rate" ] || complain "$drive_line"
	write_rig
	run -1 --separate-stderr incise stepper status --rig rig.conf
	[[ "$stderr" == *"has 500000 bit/s after its @, but bitrate is 1000000"* ]] ||
		complain "$stderr"
	sed -i 's/bitrate = 1000000;//' rig.conf
	run -0 --separate-stderr incise stepper status --rig rig.conf
	[[ "${lines[0]}" == "drive 0x10 at ${tty#slcan:}"* ]] || complain "$output"
	drive_tell report
	[ "$(drive_value bitrate)" = "$rate" ] || complain "$drive_line"
}

@test "status looks and changes nothing" {
	rig
	run -0 --separate-stderr incise stepper status --rig rig.conf
	[[ "${lines[0]}" == *": disabled at 0.0000 mm (step 0), not homed"* ]] || complain "$output"
	drive_is "switch-on disabled"
	drive_tell report
	[ "$(drive_value rpdos)" = 0 ]
}

@test "move, jog, home, enable: what is said is what the shaft does" {
	rig
	run -0 --separate-stderr incise stepper move 5 --unhomed --rig rig.conf
	[[ "$output" == *"now at 5.0000 mm"* ]]
	drive_is "switch-on disabled"
	[ "$(drive_value shaft)" -eq 64000 ]
	run -0 --separate-stderr incise stepper jog 10 --duration 200ms --rig rig.conf
	drive_is "switch-on disabled"
	holds "$(drive_value shaft) > 64000 + 12800 && $(drive_value shaft) < 64000 + 4 * 12800"
	run -0 --separate-stderr incise stepper home --rig rig.conf
	drive_is "switch-on disabled"
	[ "$(drive_value homed)" = true ]
	[ "$(drive_value shaft)" -eq -19999 ] # where the limit switch lets go
	run -0 --separate-stderr incise stepper move 2 --rig rig.conf
	drive_is "switch-on disabled"
	[ "$(drive_value position)" -eq 25600 ]
	run -0 --separate-stderr incise stepper enable --duration 300ms --rig rig.conf
	drive_is "switch-on disabled"
}

# The first steps of a new rig, as they are typed: on a drive that was never homed.
@test "every motor command of the tutorial, doc/can.md and the manual page works on a drive" {
	local document command failed= n=0 try code
	local -a words
	for document in doc/tutorial.md doc/can.md doc/quick-reference.md man/incise-stepper.1; do
		rig
		while read -r command; do
			# What ends at Ctrl-C is given an end, and ten times take long.
			command=${command/--repeat 10/--repeat 2}
			case $command in
			*" enable" | *" --follow") command+=" --duration 300ms" ;;
			esac
			read -ra words <<<"$command"
			# As in begin(): a drive that the machine held up is another matter.
			for try in 1 2 3; do
				code=0
				"${words[@]}" >out 2>err </dev/null 3>&- 7>&- || code=$?
				grep -qE "$late" err || break
			done
			[ "$code" -eq 0 ] || failed+="$document: $command: $code $(cat err);"
			n=$((n + 1))
		done < <(typed_in "$root/$document" | grep '^incise stepper ')
		drive_end
	done
	[ "$n" -ge 12 ] || complain "only $n are found"
	[ -z "$failed" ] || complain "$failed"
}

# fault VERB… -- COMMAND…: what the drive is told while that runs; then ended TEXT.
under() {
	local -a verb=()
	while [ "$1" != -- ]; do
		verb+=("$1")
		shift
	done
	shift
	echo "# $*"
	begin "${verb[@]}" --rig rig.conf || return
	for told; do
		drive_tell "$told" || return
	done
}

@test "a fault of the drive, the bus or the adapter ends in a stopped drive and its cause" {
	local failed= fault
	local -a faults=(
		"fault 0x3210|3210h"
		"emcy 0x4310|4310h"
		"emcy 0x4310 0x09|4310h" # and EMCY 0000h, its reset, right behind
		"heartbeat off|heartbeat"
		"tpdo off|TPDO1"
		"silent|no "
		"reboot|it restarted"
		"disable|switch-on disabled"
		"hang 5000|no "
		"inputs 0x8|e-stop"
		"nmt 4|stopped"
		"nmt 127|pre-operational"
		"send 0x80|another"
		"send 0x210 0f0000000000|another"
	)
	for fault in "${faults[@]}"; do
		rig --homed
		{ under stepper enable --duration 1h -- "${fault%|*}" && ended "${fault#*|}"; } ||
			failed+=" ${fault%|*};"
		drive_end
	done
	[ -z "$failed" ] || complain "these did not:$failed"
}

@test "the same in motion" {
	local failed= fault
	local -a faults=(
		"fault 0x7305|7305h"
		"heartbeat off|heartbeat"
		"tpdo off|TPDO1"
		"reboot|it restarted"
		# The drive's own window is no larger than ours: whichever notices first.
		$'block|8611h\noff its target'
		"disable|switch-on disabled"
		"inputs 0x2|limit switch"
		"hang 5000|no "
	)
	for fault in "${faults[@]}"; do
		rig --homed
		{ under stepper jog 5 -- "${fault%|*}" && ended "${fault#*|}"; } ||
			failed+=" ${fault%|*};"
		drive_end
	done
	[ -z "$failed" ] || complain "these did not:$failed"
}

@test "an adapter that is pulled out: one line; the drive stops by itself" {
	rig --homed
	under stepper jog 5 -- unplug
	drive_until "switch-on disabled"
	ended "clear"
	drive_tell report
	[[ "$drive_line" == *"heartbeat lost after"* ]]
}

@test "what is no frame, is cut off or belongs to others is counted, and nothing else" {
	rig --homed
	begin stepper enable --duration 1s --rig rig.conf
	for line in 74 7431 743138 7431383038313233340d 743139303646460d ffffff0d 0d 07 7a0d \
		5439393939393939393830313032303330343035303630373038300d; do
		drive_tell raw $line
	done
	# TPDO1 of others, too short, empty; an SDO answer that nobody asked for; node 0x11's EMCY
	for frame in "0x181 2716" "0x190 27" "0x190" "0x590 4300100092014200" "0x91 1032010000000000" \
		"0x711 7f" "0x7e5 00"; do
		drive_tell send $frame
	done
	wait "$pid" || complain "$(cat out err)"
	pid=
	drive_is "switch-on disabled"
}

@test "an adapter that answers no command is one too" {
	rig --homed --quiet
	run -0 --separate-stderr incise stepper move 1 --unhomed --rig rig.conf
	drive_is "switch-on disabled"
	[ "$(drive_value shaft)" -eq 12800 ]
}

@test "a limit switch stops it, and away from it it may go" {
	rig --homed --span=-20000:64000
	fails incise stepper move 8 --rig rig.conf -- "limit switch"
	drive_stopped
	holds "$(drive_value shaft) >= 64000 && $(drive_value shaft) < 64000 + 25600"
	run -0 --separate-stderr incise stepper clear --rig rig.conf
	run -0 --separate-stderr incise stepper move 3 --rig rig.conf
	drive_is "switch-on disabled"
	[ "$(drive_value shaft)" -eq 38400 ]
}

@test "a fault is cleared by a person, and only when its cause is gone" {
	rig --homed
	drive_tell fault 0x4210 stays
	fails incise stepper enable --duration 100ms --rig rig.conf -- "4210h"
	fails incise stepper clear --rig rig.conf -- "4210h"
	drive_is fault
	drive_tell calm
	fails incise stepper enable --duration 100ms --rig rig.conf -- "clear"
	drive_is fault
	run -0 --separate-stderr incise stepper clear --rig rig.conf
	drive_is "switch-on disabled"
	run -0 --separate-stderr incise stepper enable --duration 100ms --rig rig.conf
}

@test "a drive that another master left in NMT stopped is fetched from there" {
	rig --homed
	drive_tell nmt 4
	run -0 --separate-stderr incise stepper enable --duration 100ms --rig rig.conf
}

@test "what is printed to a stream that was closed goes nowhere, and least of all onto the bus" {
	rig --homed
	run -1 --separate-stderr bash -c "incise stepper enable --duration 100ms --rig rig.conf >&-"
	[[ "$stderr" == "incise stepper: standard output: "* ]]
	drive_is "switch-on disabled"
	drive_tell report
	[ "$(drive_value odd_lines)" -eq 0 ] || complain "lines that are no frames: $(drive_value odd_lines)"
}

@test "one program drives it; who looks meanwhile is told or shown" {
	rig --homed
	begin stepper enable --duration 1h --rig rig.conf
	fails incise stepper move 1 --rig rig.conf -- "another program"
	run --separate-stderr incise info "$drive"
	[ "$status" -le 1 ]
	drive_is "operation enabled"
	kill -INT "$pid"
	wait "$pid"
	pid=
	drive_is "switch-on disabled"
}

@test "the other modes: csv and cst go where they are told to" {
	rig --homed --set 0x60A9:0=0x00B44700 # rpm
	write_rig "" 'mode = "csv"; velocity_per_turn_s = 60.0; acceleration_per_turn_s2 = 51200.0;'
	run -0 --separate-stderr incise stepper move 5 --rig rig.conf
	drive_is "switch-on disabled"
	# It holds a place to the speed's unit: 1 rpm and a loop of 20/s make 0.003 mm.
	holds "($(drive_value shaft) - 64000) ^ 2 < (0.2 * 12800) ^ 2"
}

@test "cst: a spring and a damper made here hold it where it should be" {
	rig --homed
	# 1000 permille make 390 mm/s^2 of this drive: 20 rad/s, a damping of 0.7
	cat >rig.conf <<-END
		stepper = "$drive";
		actuator = {
			spring_N_mm = 2.0; travel_mm = 30.0; lead_mm = 4.0;
			velocity_mm_s = 10.0; acceleration_mm_s2 = 50.0; deadman_ms = 200;
			can = { mode = "cst"; stiffness_permille_mm = 1000.0;
				damping_permille_s_mm = 72.0; torque_max_permille = 800.0; };
		};
	END
	run -0 --separate-stderr incise stepper move 2 --unhomed --rig rig.conf
	drive_tell report
	holds "$(drive_value enabled_rpdos) > 100"
	holds "($(drive_value shaft) - 25600) ^ 2 < (0.2 * 12800) ^ 2"
	[ "$(drive_value state)" = "switch-on disabled" ]
}

# moves COUNTS OPTIONS…: with such a drive, 4 mm, which is a turn, are so many counts.
moves() {
	local counts=$1
	shift
	drive_end
	rig --homed --range=$((-counts / 4)):$((31 * counts / 4)) "$@" || return
	incise stepper move 4 --rig rig.conf >out 2>err 3>&- 7>&- || complain "$* : $(cat err)" || return
	drive_is "switch-on disabled" || return
	[ "$(drive_value position)" -eq "$counts" ] || complain "$*: $drive_line"
}

@test "drives of other units go as far" {
	moves 10000 --set 0x6092:1=10000 --set 0x608F:1=10000
	moves 2500 --set 0x6092:1=10000 --set 0x6092:2=4 --set 0x608F:1=2500
	moves 8192 --without 0x6092 --set 0x608F:1=4096 --set 0x6091:1=2
	moves 3000 --without 0x6092 --without 0x6091 --set 0x608F:1=6000 --set 0x608F:2=2
	moves 51200 --set 0x60A9:0=0xFDB44700 --set 0x60AA:0=0x00B45700 # mrpm, turns/s^2
}

@test "what a drive may lack it lacks, and what it must have is named" {
	local failed= lacks
	for lacks in 0x60FD 0x1400:5 0x1029 0x1008 0x6066 0x1009; do
		moves 51200 --without $lacks || failed+=" $lacks;"
	done
	for lacks in 0x1016 0x1017 0x6007 0x605A 0x6060 0x6061 0x607A 0x1600:2 0x1A00:2; do
		drive_end
		rig --homed --without $lacks
		code=0
		incise stepper move 4 --rig rig.conf >out 2>err 3>&- 7>&- || code=$?
		echo "# without $lacks: $code $(cat err)"
		[ $code -eq 1 ] && [ "$(wc -l <err)" -eq 1 ] && drive_stopped || failed+=" $lacks;"
		drive_tell report
		[ "$(drive_value enabled_rpdos)" = 0 ] || failed+=" $lacks (power);"
	done
	[ -z "$failed" ] || complain "$failed"
}

# The drive's own deadman is 1000 ms; silence_ms is what it counted from the last heartbeat to
# its quick stop: that is the least. A host that is busy adds to it.
stopped_itself() {
	drive_until "switch-on disabled" || return
	drive_tell report
	echo "# silence $(drive_value silence_ms) ms"
	holds "$(drive_value silence_ms) >= 1000"
	[ "$(drive_value velocity)" = 0 ]
}

drive_moves() {
	drive_tell state && [ "$(drive_value velocity)" != 0 ]
}

@test "kill -9: the drive stops by itself" {
	rig --homed
	for mode in 'mode = "csp";' 'mode = "csv";'; do
		write_rig "" "$mode"
		begin stepper jog 5 --rig rig.conf
		await drive_moves
		kill -9 "$pid"
		wait "$pid" || :
		pid=
		stopped_itself
		# Who comes next finds it so, and a person may go on.
		run -0 --separate-stderr incise stepper status --rig rig.conf
		drive_is "switch-on disabled"
		drive_tell restart
	done
}

@test "kill -STOP: the drive stops by itself, and stays so when the program goes on" {
	rig --homed
	begin stepper jog 5 --rig rig.conf
	await drive_moves
	kill -STOP "$pid"
	stopped_itself
	kill -CONT "$pid"
	ended "drive 0x10"
}

# The drive has had 100 set-points with power.
drive_runs() {
	drive_tell report && [ "$(drive_value enabled_rpdos)" -ge 100 ]
}

# What was sent has arrived: the same count twice.
drive_is_still() {
	local syncs
	drive_tell report
	syncs=$(drive_value syncs)
	drive_tell report
	[ "$(drive_value syncs)" = "$syncs" ]
}

# frozen VERB…: a run that is stopped for longer than the deadman, and than its --duration, and goes
# on; then ended.
frozen() {
	begin "$@" || return
	await drive_runs
	kill -STOP "$pid"
	until [[ "$(ps -o stat= -p "$pid")" == T* ]]; do sleep 0.02; done
	await drive_is_still
	before=$(drive_value shaft)
	sleep 3.5
	kill -CONT "$pid"
}

@test "kill -STOP: a drive that ignores a lost master is not moved on either" {
	local verb
	for verb in "move 25" "jog 2" "enable --duration 3s" "enable"; do
		rig --homed
		# It shall not be there before it is stopped.
		sed -i 's/velocity_mm_s = 30.0/velocity_mm_s = 3.0/; s/home_mm_s = 20.0/home_mm_s = 2.0/' rig.conf
		drive_tell watch off
		# shellcheck disable=SC2086 # words
		frozen stepper $verb --rig rig.conf
		ended "this program was stopped for" "longer than deadman_ms"
		drive_is "switch-on disabled"
		# A quick stop, and nothing else.
		holds "$(drive_value shaft) - $before < 12800 && $before - $(drive_value shaft) < 12800"
		drive_end
	done
}

@test "kill -STOP of haptic beyond its --duration: exit 1 with the reason" {
	local watch
	for watch in on off; do
		rig --homed
		drive_tell watch $watch
		frozen haptic "$root/scenes/liver.scene" -c none --no-rt --overruns 0 --rig rig.conf --duration 3s
		ended "this program was stopped for"
		drive_end
	done
}

@test "incise haptic renders through it; a fault ends that, kill -9 too" {
	rig
	run --separate-stderr incise haptic "$root/scenes/liver.scene" -c none --no-rt --overruns 0 --rig rig.conf --duration 1s
	failed_with "not homed"
	run -0 --separate-stderr incise haptic "$root/scenes/liver.scene" --no-rt --overruns 0 --rig rig.conf --home --duration 3s
	drive_is "switch-on disabled"
	drive_tell restart
	begin haptic "$root/scenes/liver.scene" -c none --overruns 0 --rig rig.conf --duration 1h
	await drive_runs
	drive_tell fault 0x3210
	ended 3210h
	run -0 --separate-stderr incise stepper clear --rig rig.conf
	drive_tell restart
	begin haptic "$root/scenes/liver.scene" -c none --overruns 0 --rig rig.conf --duration 1h
	await drive_runs
	kill -9 "$pid"
	wait "$pid" || :
	pid=
	stopped_itself
}

# Objects of PDOs, of what the drive must watch over and of power: without them nothing moves.
@test "start-up: an object that is refused, not kept or not answered is named, and nothing moves" {
	local failed= place how
	local silent="0x1000:0 0x1016:1 0x1400:1 0x1A00:2 0x6007:0 0x6040:0 0x6041:0 0x6060:0"
	rig --homed
	run -0 --separate-stderr incise stepper enable --duration 100ms --rig rig.conf
	drive_tell objects
	printf '%s\n' "$drive_line" | grep -o '"written": \[[^]]*\]' | grep -o '0x[0-9A-F]*:[0-9]*' >written
	printf '%s\n' "$drive_line" | grep -o '"read": \[[^]]*\]' | grep -o '0x[0-9A-F]*:[0-9]*' >read
	[ "$(wc -l <written)" -ge 20 ]
	for place in $(sort -u written read); do
		for how in abort mute; do
			# Silence takes 200 ms each: some objects are enough for that.
			[[ "$how $place" == abort* || " $silent " == *" $place "* ]] || continue
			drive_tell "$how" "${place%:*}" "${place#*:}"
			# A drive that was held up by a busy machine for 200 ms is another matter.
			for try in 1 2 3; do
				drive_tell restart
				code=0
				timeout 60 incise stepper enable --duration 50ms --rig rig.conf >out 2>err 3>&- 7>&- || code=$?
				[ "$how" = abort ] && grep -q "no answer when" err || break
			done
			drive_stopped || failed+=" $how $place (power);"
			case $code in
			0) echo "# $how $place: goes on" ;;
			1)
				echo "# $how $place: $(cat err)"
				[ "$(wc -l <err)" -eq 1 ] || failed+=" $how $place (lines);"
				drive_tell report
				[ "$(drive_value enabled_rpdos)" = 0 ] || failed+=" $how $place (enabled);"
				grep -qiE "${place:2:4}|no answer from" err || failed+=" $how $place (not named);"
				;;
			*) failed+=" $how $place (exit $code);" ;;
			esac
			drive_tell "$how" off
		done
	done
	[ -z "$failed" ] || complain "$failed"
}

@test "start-up: what must be kept is read back" {
	local failed= place
	rig --homed
	for place in 0x6007:0 0x605A:0 0x1016:1 0x1017:0 0x6060:0 0x60C2:1 0x60C2:2 0x1400:1 0x1400:2 \
		0x1600:0 0x1600:1 0x1600:2 0x1800:2 0x1A00:1 0x1A00:2; do
		drive_end
		# Values at power-on that are not those that will be written.
		drive_start --homed --set 0x605A:0=1 --set 0x60C2:1=5 --set 0x60C2:2=-6 \
			--set 0x1600:1=0x60FF0020 --set 0x1A00:1=0x606C0020
		write_rig
		drive_tell ignore "${place%:*}" "${place#*:}"
		code=0
		timeout 60 incise stepper enable --duration 50ms --rig rig.conf >out 2>err 3>&- 7>&- || code=$?
		echo "# $place: $code $(cat err)"
		[ $code -eq 1 ] || failed+=" $place;"
		drive_tell report
		[ "$(drive_value enabled_rpdos)" = 0 ] || failed+=" $place (enabled);"
	done
	[ -z "$failed" ] || complain "these went on:$failed"
}

@test "start-up to operation enabled, by the drive's own clock" {
	rig --homed
	for ((i = 0; i < 3; i++)); do
		drive_tell restart
		run -0 --separate-stderr incise stepper enable --duration 100ms --rig rig.conf
		drive_tell report
		echo "# $(drive_value start_ms) ms" >&3
		[ "$(drive_value start_ms)" != null ]
	done
}

# A minute of real time. The deadman is long, as nothing is said here about the time of a host that
# has other things to do.
# bats test_tags=slow
@test "60 s at 1 kHz: no set-point is lost or doubled" {
	deadman_ms=10000
	rig --homed
	run -0 --separate-stderr incise haptic "$root/scenes/liver.scene" --no-rt --overruns 0 --rig rig.conf --duration 60s --json
	printf '%s\n' "$output" >r.json
	drive_tell report
	drive_end
	echo "# $drive_line" | cut -c1-800
	echo "# $(drive_value rpdos) set-points of $(key r.json actuator.setpoints_sent) came;" \
		"between SYNCs $(drive_value median_ms) ms, 99 % within $(drive_value p99_ms) ms" >&3
	[ "$(drive_value rpdos)" -eq "$(key r.json actuator.setpoints_sent)" ]
	[ "$(drive_value missing)" = 0 ]
	[ "$(drive_value doubled)" = 0 ]
	# What the host was too late for is left out, and counted.
	holds "$(drive_value rpdos) + $(key r.json actuator.sync_late) >= 60000"
	holds "$(drive_value rpdos) > 30000"
	[ "$(drive_value state)" = "switch-on disabled" ]
}
