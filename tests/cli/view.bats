# SPDX-License-Identifier: GPL-2.0-or-later
# incise view, as a user meets it: to files without a screen, and in a window of an X server of
# its own, moved by a mouse.

load cli

setup_file() {
	export XDG_RUNTIME_DIR="$BATS_FILE_TMPDIR/run"
	mkdir -p "$XDG_RUNTIME_DIR"
}

setup() {
	work_folder
	[ -x "$INCISE_BUILD/bin/incise-view" ] ||
		skip "incise view was not built: SDL2, epoxy, cairo or EGL were absent"
	cp "$root"/scenes/* .
	# Small, so that a drawing processor has little to do.
	small="--size 160x120 --no-panel"
	sed -i 's/picture = {/picture = {\n  texture_px = 512;/' neck.scene
	incise view wall --procedure -o probe.png --at 0s --duration 0.05s $small 2>why ||
		skip "no OpenGL here: $(cat why)"
}

teardown() {
	for one in $pid $server; do
		kill -9 "$one" 2>/dev/null || :
	done
}

@test "the same ticks make the same pictures, however many are drawn" {
	incise view neck --procedure -o a --rate 4 --duration 4s $small
	incise view neck --procedure -o b --rate 12 --duration 4s $small
	[ "$(find a -name 'frame-*.png' | wc -l)" -ge 16 ]
	for i in 0 4 8 12 15; do
		cmp "a/frame-$(printf %06d $i).png" "b/frame-$(printf %06d $((3 * i))).png"
	done
	# They do show something: the cut begins after 1 s.
	! cmp -s a/frame-000003.png a/frame-000012.png
}

@test "a scene shows what it says, and counts it" {
	incise view neck --procedure -o f --rate 2 --duration 8s --json $small >r.json
	# 30 mm, and across them 15 mm, half of which the blade goes twice
	holds "$(key r.json cut_mm) > 50 && $(key r.json cut_mm) < 58"
	holds "$(key r.json blood_ul) > 0"
	# what came is somewhere: sums of doubles of 1e6 steps
	seen="$(key r.json blood_in_drops_ul) + $(key r.json blood_in_trails_ul)"
	gone=$(key r.json blood_off_ul)
	holds "($(key r.json blood_ul) - ($seen) - $gone)^2 < 1e-12 * $(key r.json blood_ul)^2"
	sed -i 's/bleeding = true/bleeding = false/' neck.scene
	incise view neck --procedure -o f --overwrite --rate 2 --duration 4s --json $small >r.json
	holds "$(key r.json cut_mm) > 25"
	[ "$(key r.json blood_ul)" = 0.0 ]
	sed -i 's/wound = true/wound = false/' neck.scene
	incise view neck --procedure -o f --overwrite --rate 2 --duration 4s --json $small >r.json
	[ "$(key r.json stamps)" = 0 ]
	[ "$(key r.json texels_uploaded)" = 0 ]
}

# Names of the outer boxes of an MP4.
boxes_of() {
	python3 -c 'import struct, sys
data, at = open(sys.argv[1], "rb").read(), 0
while at < len(data):
    size, name = struct.unpack(">I4s", data[at:at + 8])
    assert size >= 8
    print(name.decode(), end=" ")
    at += size' "$1"
}

@test "a film and a strip are whole files, or none" {
	[ -e "$INCISE_BUILD/lib/incise/film_mkv.so" ] || skip "film_mkv.so is not built"
	incise view neck --procedure -o n.mkv -o n.png --at 1s,2s --rate 10 --duration 3s $small
	[ "$(head -c 4 n.mkv | od -An -tx1 | tr -d ' \n')" = 1a45dfa3 ]
	[ "$(stat -c %s n.mkv)" -gt 2000 ]
	[ ! -e n.mkv.part ]
	incise view neck --procedure -o n.mp4 --rate 10 --duration 3s $small
	# the boxes of an MP4, its index before the frames
	[[ "$(boxes_of n.mp4)" == ftyp*moov*mdat* ]] || complain "$(boxes_of n.mp4)"
	[ ! -e n.mp4.part ]
	[ "$(head -c 24 n.png | tail -c 8 | od -An -tu1 | tr -s ' \n' ' ')" = " 0 0 1 64 0 0 0 132 " ]
	run --separate-stderr incise view neck --procedure -o no/n.mkv --duration 1s $small
	failed_with no/n.mkv.part "No such file"
	fails incise view neck --procedure -o /dev/full/x --duration 1s $small -- /dev/full
	fails incise view neck --procedure -o wall.scene --duration 1s $small -- wall.scene
	run --separate-stderr incise view neck --procedure -o n.png --overwrite --at 1s,9s --rate 10 --duration 2s $small
	[ "$status" -eq 0 ]
	[[ "$stderr" == *"the run ends before frame 2, at 9 s"* ]]
}

@test "a strip alone draws no frame but its own, and they are those of a film" {
	incise view neck --procedure -o all.png -o f --at 0s,1.25s,3s --rate 4 --duration 4s --json $small >all.json
	[ "$(key all.json frames)" = 16 ]
	# with a session the run goes on to its end, else it ends with the last frame
	incise view neck --procedure -o alone.png --at 0s,1.25s,3s --rate 4 --duration 4s --json $small >alone.json
	[ "$(key alone.json frames)" = 3 ]
	cmp all.png alone.png
	incise view neck --procedure -o session.png -o s.session --at 0s,1.25s,3s --rate 4 --duration 4s --json $small >session.json
	[ "$(key session.json frames)" = 3 ]
	cmp all.png session.png
	holds "$(key session.json stamps) == $(key all.json stamps) && $(key alone.json stamps) < $(key all.json stamps)"
	[ "$(key session.json files)" = '["session.png","s.session"]' ]
}

# bats test_tags=check
@test "view prints the files that it wrote" {
	run -0 --separate-stderr incise view neck --procedure -o f -o n.png --at 0s,0.75s -o s.session \
		--rate 4 --duration 1s $small
	[ "$output" = "wrote n.png: 2 frames at 0, 0.75 s
wrote f/frame-000000.png to frame-000003.png
wrote s.session" ]
	[ -z "$stderr" ]
	[ -s f/frame-000003.png ]
	[ ! -e f/frame-000004.png ]
	incise view neck --procedure -o f --overwrite --rate 4 --duration 0.5s --json $small >r.json
	[ "$(key r.json files)" = '["f/frame-000000.png","f/frame-000001.png"]' ]
	[ -e "$INCISE_BUILD/lib/incise/film_mkv.so" ] || return 0
	run -0 --separate-stderr incise view wall --procedure -o w.mkv --rate 10 --duration 2s $small
	[ "$output" = "wrote w.mkv: 20 frames, 2.0 s" ]
}

@test "on a terminal view shows the frame of so many, the percentage and the time left" {
	export TERM=xterm
	run -0 --separate-stderr python3 "$root/tests/cli/terminal.py" 2 incise view wall --procedure -o f --rate 4 --duration 1s $small
	[[ "$output" =~ "frame 1 of 4 ["[\ \#]*"] 25 %, "[0-9]+" "(s|min)" left".*"frame 2 of 4 ["[\ \#]*"] 50 %, ".*"frame 4 of 4 ["\#*"] 100 %"[^,] ]]
	run -0 --separate-stderr python3 "$root/tests/cli/terminal.py" 2 incise view wall --procedure -o n.png --at 0.25s,0.5s --rate 4 $small
	[[ "$output" == *"frame 0 of 2 ["*"] 0 %"*"frame 1 of 2 ["*"] 50 %"*"frame 2 of 2 ["*"] 100 %"* ]]
	# of a recording: by its length
	incise capture -o a.rec --rig sim:clock=simulated --duration 1s >/dev/null
	run -0 --separate-stderr python3 "$root/tests/cli/terminal.py" 2 incise view wall --from a.rec -o g --rate 4 $small
	[[ "$output" == *"frame 4 of 4 ["*"] 100 %"* ]]
}

# bats test_tags=slow
@test "the demo leaves a film and a strip of a scene" {
	[ -e "$INCISE_BUILD/lib/incise/film_mkv.so" ] || skip "film_mkv.so is not built"
	# a wall neither bleeds nor is cut: that takes the least time
	incise demo --scene wall -o out >said
	grep -q '^\$ incise view wall --procedure -o out/wall.mkv' said
	[ "$(head -c 4 out/wall.mkv | od -An -tx1 | tr -d ' \n')" = 1a45dfa3 ]
	[ "$(head -c 24 out/wall.png | tail -c 8 | od -An -tu1 | tr -s ' \n' ' ')" = " 0 0 10 0 0 0 1 243 " ]
	fails incise demo --scene wall -o out -- out --overwrite
}

ticks_of() {
	incise status "$1" --prometheus 2>/dev/null | sed -n 's/^incise_loop_ticks_total{.*} //p'
}

@test "a loop that runs is seen, and not held up" {
	mkdir -p "$XDG_RUNTIME_DIR/incise"
	incise haptic neck.scene --rig sim: --no-rt --overruns 0 --state "$XDG_RUNTIME_DIR/incise/neck.state" --json \
		>h.json 2>err 3>&- &
	pid=$!
	has_ticked() { [ "$(ticks_of neck)" -gt "${1:-500}" ]; }
	await has_ticked
	incise view neck -o f --overwrite --rate 10 --duration 2s --json $small >r.json
	holds "$(key r.json frames) > 0"
	await has_ticked "$(ticks_of neck)"
	kill -TERM $pid
	wait $pid
	pid=
	fails incise view neck -o f --overwrite --duration 1s $small -- "neck:" "incise haptic neck"
	# a name that no other loop on this machine has, running or left
	cp liver.scene "idle-$$.scene"
	run --separate-stderr incise view "idle-$$" -o f --overwrite --duration 1s $small
	failed_with "idle-$$" "incise haptic"
}

# Start a loop of neck.scene, and wait until it has ticked for 3 s.
begin_loop() {
	mkdir -p "$XDG_RUNTIME_DIR/incise"
	# without a terminal, so that SIGHUP reads the scene again
	setsid incise haptic neck.scene --rig sim: --no-rt --overwrite --overruns 0 \
		--state "$XDG_RUNTIME_DIR/incise/neck.state" >h.txt 2>err 3>&- </dev/null &
	pid=$!
	has_ticked() { [ "$(ticks_of neck)" -gt 3000 ]; }
	await has_ticked
}

# Look at it with a session, until it has drawn: $seen.
begin_view() {
	rm -rf f
	incise view neck -o f --rate 10 -o v.session --overwrite --duration 1h $small \
		>v.txt 2>why 3>&- &
	seen=$!
	await test -e f/frame-000003.png
}

@test "a session of a loop that runs begins when it is looked at, and ends as the loop does" {
	begin_loop
	# less than the look itself took; the page holds the 3 s before
	for _ in {1..20}; do
		begin=$(uptime_ms)
		incise view neck -o f --rate 10 -o v.session --overwrite --duration 1s $small
		[ "$(key v.session ticks_lost)" != 0 ] || [ "$(key v.session duration_s)" = 0.0 ] || break
	done
	holds "$(key v.session duration_s) > 0 && $(key v.session duration_s) < ($(uptime_ms) - $begin + 20) / 1000"
	[ "$(key v.session ticks_lost)" = 0 ]
	[ "$(key v.session end.kind)" = asked ]
	# another scene is no part of it
	begin_view
	kill -HUP $pid
	status=0
	wait $seen || status=$?
	[ "$status" = 1 ]
	grep -q "another scene" why
	[ "$(key v.session end.kind)" = fault ]
	begin_view
	kill -9 $pid
	wait $seen
	[ "$(key v.session end.kind)" = fault ]
	[ "$(key v.session end.why)" = "the loop exited without cleanup" ]
	pid=
}

@test "a recording is seen through its loop" {
	incise capture -o r.rec --rig sim:seed=1,clock=simulated,depth_mm=5,times=1 2>/dev/null
	sed -i 's/skin = "liver"/& ; texture_px = 512/' liver.scene
	incise view liver.scene --from r.rec -o f --rate 2 --json $small >r.json
	# the skin of a plane is 120 mm wide, and the cut begins at its middle
	holds "$(key r.json cut_mm) > 20 && $(key r.json cut_mm) < 60"
	fails incise view liver.scene --from none.rec -o f --overwrite $small -- none.rec
}

# A screenshot is written behind all that was done before it, and the blade moves with each frame.
screenshot() {
	shots=$((shots + 1))
	xdotool key --window "$window" s
	await test -s neck-$shots.png
}

# The page of the view's own loop is open, and has no name any more: loop_holds 'depth_mm > 1'.
loop_holds() {
	incise status "$page" --json >now.json || :
	holds "$(key now.json "loops[0].${1%% *}") ${1#* }"
}

@test "a window: the mouse presses the blade in, and draws it through the skin" {
	command -v Xvfb >/dev/null && command -v xdotool >/dev/null || skip "Xvfb or xdotool are not installed"
	local shots=0 page= before
	Xvfb -displayfd 5 -noreset -screen 0 800x600x24 5>display >/dev/null 2>&1 3>&- &
	server=$!
	await test -s display
	DISPLAY=:$(cat display)
	export DISPLAY
	SDL_VIDEODRIVER=x11 incise view neck.scene --rig sim:mouse --size 640x480 --viewpoint 15,45,140 --json \
		>r.json 2>err 3>&- &
	pid=$!
	window=
	for ((i = 0; i < 9600; i++)); do
		window=$(xdotool search --name neck.scene 2>/dev/null | head -n 1)
		[ -n "$window" ] && break
		kill -0 $pid || complain "no window: $(cat err)"
		sleep 0.05
	done
	[ -n "$window" ] || complain "no window within 8 min: $(cat err)"
	# the mouse may be moved from where the window gets keys
	screenshot
	page=$(find /proc/$pid/fd -lname '*incise-view-*' | head -n 1)
	await loop_holds 'ticks > 0'
	xdotool mousemove --window "$window" 170 170
	screenshot
	xdotool mousedown 1
	await loop_holds 'depth_mm > 1'
	for ((x = 180; x <= 290; x += 10)); do
		xdotool mousemove --window "$window" $x 170
		screenshot
	done
	screenshot
	await loop_holds 'velocity_mm_s < 1'
	xdotool mouseup 1
	await loop_holds 'depth_mm == 0'
	# it bleeds for three seconds of the loop
	before=$(key now.json 'loops[0].ticks')
	await loop_holds "ticks >= $((before + 3000))"
	screenshot
	xdotool key --window "$window" q
	code=0
	wait $pid || code=$?
	pid=
	[ "$code" = 0 ] || complain "exit $code: $(cat err)"
	# What a person would look at.
	mkdir -p "$INCISE_BUILD/artefacts"
	cp neck-$shots.png "$INCISE_BUILD/artefacts/view-window.png"
	# 120 pixels are some 35 mm of skin there, seen aslant
	holds "$(key r.json cut_mm) > 20 && $(key r.json blood_ul) > 0"
}

# bats test_tags=check
@test "view: a screen that is not there" {
	fails incise view neck --rig sim:clock=simulated --duration 1s -o f -- "simulated time"
	run --separate-stderr env -u DISPLAY -u WAYLAND_DISPLAY SDL_VIDEODRIVER=x11 incise view neck --procedure
	failed_with "without a display give -o FILE.mp4"
}

# SDL has a driver that draws where nobody sees it, and takes it by itself.
@test "view: a window without a screen is refused, not drawn for ever" {
	local source
	! compgen -G "/dev/dri/card*" >/dev/null || skip "this machine may have a screen of its own"
	for source in "--rig sim:mouse" "--procedure"; do
		[ "$source" = --procedure ] && remedy="without a display give -o FILE.mp4" ||
			remedy="'incise view neck --procedure -o FILE.mp4' writes a film"
		# shellcheck disable=SC2086
		run --separate-stderr timeout 60 env -u DISPLAY -u WAYLAND_DISPLAY -u SDL_VIDEODRIVER \
			XDG_RUNTIME_DIR="$PWD" incise view neck.scene $source $small
		failed_with "no screen for a window" "$remedy" || complain "$source"
	done
	# Who names that driver has asked for it.
	run -0 --separate-stderr timeout 60 env -u DISPLAY -u WAYLAND_DISPLAY SDL_VIDEODRIVER=offscreen \
		incise view neck.scene --procedure --duration 100ms $small
}
