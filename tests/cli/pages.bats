# SPDX-License-Identifier: GPL-2.0-or-later
# Pages of incise serve --http and of incise plot, without a browser: who is let in, and what is sent.

load cli

teardown() {
	[ -z "$server" ] || kill -KILL "$server" 2>/dev/null || :
}

# Start incise serve --http on a free port, and wait until it listens: its address is in the file url.
start_pages() {
	local i
	[ -e "$INCISE_BUILD/bin/incise-serve" ] || skip "incise serve is not built"
	grep -aq lws_service "$INCISE_BUILD/bin/incise-serve" || skip "incise serve is built without libwebsockets"
	incise-serve "$@" --http 0 --url url --json >report.json 2>log 3>&- &
	server=$!
	for ((i = 0; i < 9600; i++)); do
		[ ! -s url ] || return 0
		kill -0 "$server" || complain "$(cat log)"
		sleep 0.05
	done
	complain "no address in 8 min: $(cat log)"
}

stop_pages() {
	local status=0
	kill -INT "$server"
	wait "$server" || status=$?
	server=
	[ "$status" = 0 ] || complain "exit $status: $(cat log)"
}

visitor() {
	timeout 500 python3 -B "$root/tests/web/visitor.py" url "$@"
}

report() { # KEY
	python3 -c 'import json, sys; print(json.load(open("report.json"))["http"][sys.argv[1]])' "$1"
}

# bats test_tags=check
@test "a page is for those who have its token, from its own origin" {
	incise capture --rig sim:clock=simulated --camera off --duration 12s -o liver.rec >/dev/null
	start_pages liver.rec
	[ "$(stat -c %a url)" = 600 ]
	visitor look 12 >head.json
	visitor refusals
	[ "$(visitor crowd)" -le 16 ]
	stop_pages
	! grep -q "$(sed 's/.*#//' url)" report.json log
	[ "$(report refused)" -ge 15 ]
	python3 -c 'import json; h = json.load(open("head.json")); assert h["cuts"] and "--range {from}s" in h["export"]'
}

# bats test_tags=check
@test "a damaged recording is shown as far as it can be read, and says so" {
	incise capture --rig sim:clock=simulated --camera off --duration 4s -o liver.rec >/dev/null
	python3 -c 'import sqlite3
db = sqlite3.connect("liver.rec/recording.db")
db.execute("UPDATE blocks SET data = zeroblob(length(data)) WHERE stream = ? AND block = 20", ("force",))
db.commit()'
	start_pages liver.rec
	visitor damaged
	stop_pages
	run -1 incise plot liver.rec -o liver.html
	[[ $output == *"damaged"* ]] && [ ! -e liver.html ]
}

# bats test_tags=check
@test "the second token starts, marks and ends a capture, and nothing else does" {
	start_pages --rig sim:clock=real --control
	visitor orders trial
	stop_pages
	incise verify trial.rec
	incise export trial.rec -o trial.mcap >/dev/null
	grep -aq '"text":"here"' trial.mcap
}

# bats test_tags=check
@test "changed requests leave a server that serves" {
	incise capture --rig sim:clock=simulated --camera off --duration 4s -o liver.rec >/dev/null
	# Under sanitizers it ends with what requests left in memory.
	ASAN_OPTIONS=detect_leaks=1 start_pages liver.rec --control
	visitor fuzz "${CASES:+100000}${CASES:-1000}" 1
	stop_pages
}

@test "a page of a rig has all tracks in order, and a slow one loses frames" {
	start_pages --rig sim:clock=real --camera frames
	visitor live 50 >live.json
	python3 -c 'import json; j = json.load(open("live.json")); assert j["head"]["frames"] and all(j["tracks"])'
	visitor slow 150
	stop_pages
	[ "$(report lost)" -gt 0 ]
}

@test "a page of a loop sets its tool" {
	incise haptic neck --rig sim:clock=real --duration 300s >/dev/null 2>&1 3>&- &
	loop=$!
	until incise tool neck >/dev/null 2>&1; do kill -0 "$loop"; sleep 0.05; done
	start_pages neck --control
	visitor tool tube
	stop_pages
	kill -INT "$loop"
	wait "$loop"
}

# bats test_tags=check
@test "the address is told to a terminal or a file, and stays when the server starts again" {
	run -1 incise serve --rig sim: --http 0
	[[ $output == *"no terminal; give --url FILE"* ]]
	run -2 incise serve --rig sim: --url url
	[[ $output == *"--url is of --http"* ]]
	run -2 incise serve --rig sim: --http name:1 --url other
	[[ $output == *"'name' is no address"* ]]
	incise capture --rig sim:clock=simulated --camera off --duration 3s -o liver.rec >/dev/null
	start_pages liver.rec
	mv url before
	stop_pages
	cp -p before url
	incise-serve liver.rec --http 0 --url url --overwrite >/dev/null 2>log 3>&- &
	server=$!
	until visitor look 3 >/dev/null 2>&1; do kill -0 "$server"; sleep 0.05; done
	cmp url before
	stop_pages
}

# bats test_tags=check
@test "plot makes one page of a recording, a session or a model" {
	incise capture --rig sim:clock=simulated --camera off --duration 4s -o 'a<!--<script>.rec' >/dev/null
	incise plot 'a<!--<script>.rec' -o rec.html
	incise plot "$root/scenes/liver.fis" -o fis.html
	incise haptic neck --procedure -o neck.session >/dev/null
	incise plot neck.session -o session.html
	for page in rec fis session; do
		[ "$(grep -c '</script>' $page.html)" = 2 ]
		[ "$(stat -c %s $page.html)" -lt 5000000 ]
		! grep -E '(src|href)="?(https?:)?//' $page.html
	done
	python3 - <<-'EOF'
		import json, re
		for name, kind in ("rec", "recording"), ("fis", "model"), ("session", "session"):
		    text = open(name + ".html").read()
		    j = json.loads(re.search(r'id="document">(.*?)</script>', text, re.S).group(1))
		    assert j["head"]["kind"] == kind and len(j["part"]["tracks"]) == len(j["head"]["tracks"])
	EOF
	echo 'depth_mm,force_N' >table.csv
	echo '1,1' >>table.csv
	run -2 incise plot table.csv -o table.html
	[[ $output == *"a page is for a recording, a session or a .fis"* ]]
	run -2 incise plot neck.session --range 1s.. -o n.html
	[[ $output == *"a page shows all"* ]]
}
