# SPDX-License-Identifier: GPL-2.0-or-later
# Bad usage of all commands: operands that are missing or too many, options that do not go together, and
# values that a command looks at behind its parser. option_tables.py has each option by itself,
# mistakes.bats whole messages.

load cli

setup() {
	work_folder
	cp "$root"/scenes/liver.fis m.fis
	rig=sim:clock=simulated
	bench=sim:clock=simulated,bench=1
}

# Arguments of incise | a part of the message. Words are parted by blanks.
table() {
	cat <<-END
		assess|missing NAME.session
		assess a.session --json -o csv:-|standard output
		bench|missing, for example 'precision'
		bench nothing|unknown benchmark 'nothing'
		bench presision|unknown benchmark 'presision'; did you mean 'precision'?
		bench precision a b|'precision' takes at most 1 operand, got 2
		bench loop a b|'loop' takes at most 1 operand, got 2
		bench stability a b|'stability' takes at most 1 operand, got 2
		bench loop -o a|--output
		bench stability -o a/|--output
		bench loop --load much|--load: expected idle, cpu, memory, disk or view, found 'much'
		bench training --load cpu|--load does not go with 'training'
		bench --json view|'view' must come directly after
		bench all|expected -o DIR, or --from DIR
		bench all -o a --from b|expected -o DIR, or --from DIR
		bench all -o a --only precision,nosuch|found 'nosuch'
		bench all --from b --quick|--from measures nothing
		bench all --from r --against old.json|--from measures nothing
		bench all -o a precision|takes options only
		calibrate check a.rec|unexpected argument 'a.rec'; did you mean --recording a.rec?
		calibrate delay --rig $rig|--duration or --from
		calibrate depth|missing method: two-point, line or board
		calibrate depth three-point|three-point
		haptic neck --procedure --rig $rig|section 4 of the page that 'incise help lesson' names
		calibrate depth two-point|(needed without a terminal)
		calibrate depth board --images 5|(needed without a terminal)
		calibrate depth line|missing --from pairs.csv
		calibrate depth two-point a.png|unexpected argument 'a.png'; images are given with --from
		calibrate depth line --pixels 400|--pixels goes with two-point
		calibrate force --from w.csv --weights 0,1,2|--from does not go with --rig, --weights or -o FILE.csv
		calibrate force --rig sim:|missing --weights or --from
		calibrate force --rig sim: --weights 100g|the empty pan and 2 weights or more
		calibrate force --rig sim: --weights 100g,100g,50g|100 g is listed twice
		calibrate force extra|unexpected argument 'extra'; did you mean --from extra?
		calibrate stepper --from p.csv --range 0mm..1mm|--from does not go with --rig, -o FILE.csv, --range
		calibrate stepper --step-mm 1|--step-mm goes with --from
		calibrate stepper now|unexpected argument 'now'
		calibrate frame --point 0,0,0|1 point of the scene: expected 3 to 6
		calibrate frame --from p.csv --point 0,0,0|--from does not go with --point
		calibrate tip --rig $rig|--duration or --from
		calibrate torque --direction 1,0|expected X,Y,Z
		calibrate torque now|unexpected argument 'now'
		capture -o a.csv|expected a name that ends in .rec
		capture -o .rec|.rec
		capture -o a.rec more|more
		capture -o a.rec --rig $rig --only force --trigger button|--trigger button: needs the tracker, which --only force leaves out
		capture -o a.rec --rig $rig --only tracker --trigger 1N|--trigger: a force needs the force channel
		capture -o a.rec --rig $rig --only force --cuts|--cuts: needs the tracker
		capture -o a.rec --rig $rig --start-at 2027-01-15T08:00:10Z --trigger button|exclude each other
		capture -o a.rec --rig sim: --clock-source none --start-at 2037-01-15T08:00:10Z|--start-at: needs the wall time, which --clock-source none leaves out
		compile m.fis m.fis -o a.fx|m.fis
		compile m.fis -o - --json|standard output
		compile m.fis -o a.fx -o 7.c|7
		compile m.fis --rig sim: -o a.fx|go with a scene
		compile neck --budget 1mN -o a.plan|--budget, --method and -o FILE.c go with a model
		demo somewhere|'somewhere'
		eval m.fis a b|; give a model, and one file of inputs
		eval m.fis points --grid 3x3|grid
		eval m.fis --no-clamp --arith fixed|--no-clamp
		export a.rec --rate 10 --average 3x3|--rate
		export a.rec --average 3x3,cuts|unknown key of --average
		export a.rec --average 3x3,count|count needs a value, count=N
		export a.rec --json|--json
		export a.rec --json -o -|--json
		export a.rec --resample --average 3x3|--average
		export a.rec --resample --rate 0.5|--rate
		export a.rec --average 3x3 --tai|--tai
		export a.rec --uncertainty parts --profile ros2 -o a.mcap|--uncertainty
		export a.rec --profile ros2 -o a.csv|--profile needs -o FILE with .mcap
		export a.rec --profile ros2 -o a.h5|--profile needs -o FILE with .mcap
		export a.rec --profile ros2 -o -|--profile needs -o FILE with .mcap
		haptic|missing SCENE (
		haptic neck more.scene|; give one SCENE at a time
		haptic neck --rig $rig -o l.csv|--duration
		haptic neck --rig $rig --duration 1s --json -o -|standard output
		haptic neck --rig sim: --cpu 0 --no-rt --duration 0.1s|--cpu does not go with --no-rt
		haptic neck --rig $rig --duration 1s --code P07|--code needs -o FILE.session
		haptic neck --in-kernel --procedure|--procedure runs on the simulated rig
		haptic neck --in-kernel --arith double|the kernel computes in fixed point
		info|missing FILE (
		info m.fis a.rec|; give one FILE at a time
		info a.csv --group cut|--dataset
		plan a b|b
		replay a.rec|missing SCENE (
		replay a.rec liver more|; give one SCENE at a time
		replay a.rec liver -o - --json|standard output
		serve --rig sim: --speed 2|--speed: only for a recording
		serve --rig sim: a.rec|--rig: 'a.rec' is a source, too
		sign a.rec|--key
		status a b|; give one NAME or FILE at a time
		status --prometheus --follow|--prometheus cannot be combined with --follow or --json
		stepper spin --rig $rig|unknown subcommand 'spin'; expected status, enable
		stepper move 1 2 --rig $rig|unexpected argument '2'; move takes one MM
		stepper status 3 --rig $rig|unexpected argument '3'; status takes none
		stepper jog 1mm --rig $rig|MM_S: expected a number, alone or with a unit
		stepper jog -x --rig $rig|-x
		stepper move 1x --rig $rig|1x
		stepper move mm --rig $rig|mm
		stepper move nan --rig $rig|nan
		stepper move 1e9 --rig $rig|1e9
		stepper move 1mm/s --rig $rig|1mm/s
		stepper status --by --rig $rig| does not go with status
		stepper enable --hold --rig $rig| does not go with enable
		stepper move 1 --repeat 2 --rig $rig| does not go with move
		stepper home --unhomed --rig $rig| does not go with home
		stepper clear --follow --rig $rig| does not go with clear
		stepper disable --duration 1s --rig $rig| does not go with disable
		stepper move 1 --duration 1s --rig $rig|--duration needs --hold
		stepper status --duration 1s --rig $rig|--duration needs --follow
		stepper move 1 --by --unhomed --rig $rig|--unhomed is not needed with --by
		tool neck spoon|unknown tool 'spoon'; expected auto, blade, handle or tube
		tool neck tube more|more
		train a.csv -o a.fis --mf 3|--mf
		train a.csv -o a.fis --mf 3,3,3|--mf
		train a.csv -o - --json|standard output
		train a.csv -o a.fis --premises m.fis --search sample=10|--search sample
		verify a.rec b.rec|b.rec
		verify a.rec --ca ca.pem|--signers
	END
	[ ! -x "$INCISE_BUILD/bin/incise-view" ] || cat <<-END
		bench view a b|at most one scene
		view|missing SCENE (
		view neck --procedure --rig sim:|--procedure
		view neck --procedure --from x.rec|--procedure
		view neck -o f|
		view neck -o x.png|
		view neck --at 1s|--at
		view neck --procedure --at 2s,1s -o x.png|--at
		view neck --procedure -o x.mkv --size 641x480|
	END
}

# bats test_tags=check
@test "each bad usage is exit 2, its line, and where help is; nothing is done" {
	before=$(ls -A)
	while IFS='|' read -r arguments message; do
		# shellcheck disable=SC2086 # arguments are words
		run --separate-stderr timeout 60 incise $arguments </dev/null
		bad_usage "$message" || complain "incise $arguments" || return
		[ -z "$output" ] || complain "incise $arguments: printed: $output" || return
	done < <(table)
	[ "$(ls -A)" = "$before" ]
	# Arguments that are no words.
	misused incise train a.csv -o "" -- "-o"
	run --separate-stderr incise stepper move --rig $rig -- ""
	bad_usage ""
	run --separate-stderr incise stepper move --rig $rig -- --
	bad_usage ""
}
