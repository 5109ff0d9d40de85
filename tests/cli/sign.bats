# SPDX-License-Identifier: GPL-2.0-or-later
# Signatures and time-stamps of recordings: ssh-keygen and openssl verify what incise signed, and incise
# what they did; forgeries are found and named.

load cli
load authority

key() { # NAME PERSON
	ssh-keygen -q -t ed25519 -N "" -C "$2" -f "$1"
}

setup_file() {
	cd "$BATS_FILE_TMPDIR"
	for n in a b; do
		"$INCISE_BUILD/bin/incise" capture -o $n.rec --rig sim:clock=simulated --duration 1s >/dev/null
	done
	key kim kim@lab
	key lee lee@lab
	authority ca
	cp -r a.rec signed.rec
	"$INCISE_BUILD/bin/incise" sign signed.rec --key kim >/dev/null
}

setup() {
	work_folder
	made=$BATS_FILE_TMPDIR
	cp -r "$made/a.rec" a.rec
	cp -r "$made/signed.rec" signed.rec
	kim=$made/kim lee=$made/lee
	echo "kim@lab $(cat "$kim.pub")" >signers
}

teardown() {
	[ -z "${server:-}" ] || kill "$server"
	[ -z "${SSH_AGENT_PID:-}" ] || kill "$SSH_AGENT_PID"
}

# not_vouched TEXT ARGUMENT…: verify signed.rec fails, with a line that holds this text.
not_vouched() {
	local text=$1
	shift
	run -1 --separate-stderr incise verify signed.rec --signers "$@"
	[[ "$output" == *"$text"* ]] || complain "no '$text' in: $output $stderr"
	[[ "$output" != *"signed by "* ]] || complain "signed: $output"
	[[ "$output" != *[$'\e\a\r']* ]]
}

# bats test_tags=check
@test "a signature is made, verified and verified by ssh-keygen; the data stay as they are" {
	before=$(sha256sum a.rec/recording.db)
	run -0 --separate-stderr incise sign a.rec --key "$kim"
	[[ "${lines[0]}" =~ ^"a.rec: signed with ED25519 SHA256:"[^\ ]+", all of it, statement of commit "[0-9]+$ ]]
	sig=$(echo a.rec/seal/1.*.sig)
	[ "${lines[1]}" = "wrote a.rec/seal/1.statement and $sig" ]
	[ "$(sha256sum a.rec/recording.db)" = "$before" ]
	ssh-keygen -Y verify -f signers -I kim@lab -n incise -s "$sig" <a.rec/seal/1.statement

	run -0 --separate-stderr incise verify a.rec --signers signers
	[[ "$output" =~ "a.rec: signed by kim@lab (ED25519 SHA256:"[^\ ]+"), all of it, statement of commit " ]]
	sed 's/^kim@lab/!lee@lab,*@lab/' signers >wide
	run -0 --separate-stderr incise verify a.rec --signers wide
	[[ "$output" == *"a.rec: signed by one of *@lab (ED25519 "* ]]
	run -0 --separate-stderr incise verify a.rec
	[[ "$output" == *"a.rec: 1 signature and 0 time-stamps, not checked: give --signers FILE"* ]]
	incise verify a.rec --signers signers --json | jq -e \
		'.seals[0] | .vouched and .statements[0].agrees and .signatures[0].signer == "kim@lab"'

	# another person signs the same statement, from a pipe of signers; the same one only once
	incise sign a.rec --key "$lee"
	run -0 --separate-stderr incise verify a.rec --signers <(cat signers; echo "lee@lab $(cat "$lee.pub")")
	[ "$(grep -c "signed by" <<<"$output")" = 2 ]
	fails incise sign a.rec --key "$kim" -- "$sig:"
	incise sign a.rec --key "$kim" --overwrite
	[ "$(find a.rec/seal -type f | wc -l)" = 3 ]
	# its name, which is that of its cuts in an export, was signed too; it is replaced with its seal
	mv a.rec renamed.rec
	run -1 --separate-stderr incise verify renamed.rec --signers signers
	[[ "$output" == *"it was signed under the name a;"*"but under another name"* ]]
	(cd renamed.rec && run -1 --separate-stderr incise verify . --signers ../signers)
	run -0 --separate-stderr incise sign renamed.rec --key "$kim"
	[ "${lines[1]}" = "wrote renamed.rec/seal/2.statement and renamed.rec/seal/2${sig#a.rec/seal/1}" ]
	echo "lee@lab $(cat "$lee.pub")" >>signers
	incise verify renamed.rec --signers signers
	(cd renamed.rec && incise verify . --signers ../signers)
	incise capture -o renamed.rec --rig sim:clock=simulated --duration 300ms --overwrite
	[ ! -e renamed.rec/seal ]
}

@test "a signature that ssh-keygen made by hand is accepted" {
	incise sign a.rec --timestamp q.tsq
	ssh-keygen -q -Y sign -f "$kim" -n incise a.rec/seal/1.statement
	mv a.rec/seal/1.statement.sig a.rec/seal/1.byhand.sig
	run -0 --separate-stderr incise verify a.rec --signers signers
	[[ "$output" == *"signed by kim@lab"* ]]
}

@test "the agent signs for a public key; a passphrase that nobody types, no key and a pipe are named" {
	eval "$(ssh-agent -a "$PWD/agent")"
	ssh-add -q "$kim"
	cp "$kim.pub" .
	incise sign a.rec --key kim.pub
	incise verify a.rec --signers signers
	SSH_AUTH_SOCK=/none run --separate-stderr incise sign a.rec --key kim.pub --overwrite
	failed_with "kim.pub:"
	ssh-keygen -q -t ed25519 -N secret -f locked
	SSH_AUTH_SOCK=/none SSH_ASKPASS=/bin/false SSH_ASKPASS_REQUIRE=force run --separate-stderr \
		incise sign a.rec --key locked
	failed_with "locked:"
	mkfifo pipe
	for key in pipe /dev/zero .; do
		fails timeout 60 incise sign a.rec --key $key -- "$key:"
	done
	fails incise sign a.rec --key -x -- "-x:"
}

# bats test_tags=check
@test "keys that may not sign are named: unknown, another purpose, expired, not yet, revoked" {
	echo "lee@lab $(cat "$lee.pub")" >others
	not_vouched "no signer has its key (ED25519 SHA256:" others
	: >none
	not_vouched "no signer has its key" none
	echo "kim@lab namespaces=\"git,file\" $(cat "$kim.pub")" >git
	not_vouched "key is not permitted for use in signature namespace" git
	echo "kim@lab valid-before=\"20200101Z\" $(cat "$kim.pub")" >old
	not_vouched "key has expired: " old
	echo "kim@lab valid-after=\"20990101Z\" $(cat "$kim.pub")" >new
	not_vouched "key is not yet valid: " new
	not_vouched "its key is revoked" signers --revoked "$kim.pub"
	printf 'kim\033[31m\a@lab %s\n' "$(cat "$kim.pub")" >escapes
	run --separate-stderr incise verify signed.rec --signers escapes
	[[ "$output$stderr" != *[$'\e\a']* ]]
	fails incise verify signed.rec --signers /dev/zero -- "/dev/zero: "
	fails incise verify a.rec --signers signers -- "a.rec:"
}

@test "seals of another recording, changed statements and signatures are named" {
	incise sign "$made/b.rec" --key "$kim" --overwrite >/dev/null
	rm -r signed.rec/seal
	cp -r "$made/b.rec/seal" signed.rec/
	run -1 --separate-stderr incise verify signed.rec --signers signers
	[[ "$output" == *"another recording"* ]] || complain "$output"
	[[ "$output" != *"all of it"* ]]

	rm -r signed.rec
	cp -r "$made/signed.rec" .
	sed -i 's/^host .*/host other/' signed.rec/seal/1.statement
	not_vouched "it is a signature over another statement" signers
	echo rubbish >signed.rec/seal/1.statement
	not_vouched "statement 1: seal/1.statement: " signers
	rm signed.rec/seal/1.statement
	not_vouched "its statement is missing" signers
	sig=$(echo signed.rec/seal/1.*.sig)

	# forged by one who may sign in his own name only
	cp "$made/signed.rec/seal/1.statement" signed.rec/seal/
	sed -i 's/^host .*/host other/' signed.rec/seal/1.statement
	ssh-keygen -q -Y sign -f "$lee" -n incise signed.rec/seal/1.statement
	mv -f signed.rec/seal/1.statement.sig "$sig"
	not_vouched "no signer has its key" signers
	ssh-keygen -q -Y sign -f "$kim" -n git signed.rec/seal/1.statement
	mv -f signed.rec/seal/1.statement.sig "$sig"
	not_vouched "it is a signature for another purpose" signers
}

@test "a row that was changed after it was signed, and a damaged recording, which is not signed" {
	sqlite3 signed.rec/recording.db "UPDATE force SET code = code + 1 WHERE seq = 100"
	run -1 --separate-stderr incise verify signed.rec --signers signers
	[[ "$output" == *"force: block 0 is altered"* ]]
	[[ "$output" != *"all of it"* ]]
	fails incise sign signed.rec --key "$lee" -- "signed.rec"
	[ "$(find signed.rec/seal -name '*.sig' | wc -l)" = 1 ]
}

# bats test_tags=check
@test "a calibration after the fact is no longer what was signed, until it is signed" {
	echo 'force_mV_N = 1111.0;' >c.conf
	incise recalibrate signed.rec -c c.conf
	run -1 --separate-stderr incise verify signed.rec --signers signers
	[[ "$output" == *"calibration/0001-"*".conf, by which it is read, is not in the statement"* ]]
	[[ "$output" == *"signed by kim@lab "*", what was recorded, but not its calibration, statement of commit "* ]]
	[[ "$stderr" == *"signed.rec: nobody in signers signed what it is now" ]]
	# by the calibration of its capture it is what was signed
	incise recalibrate signed.rec --original
	run -0 --separate-stderr incise verify signed.rec --signers signers
	[[ "$output" == *", all of it, "* ]]
	incise recalibrate signed.rec -c c.conf
	incise sign signed.rec --key "$kim"
	run -0 --separate-stderr incise verify signed.rec --signers signers
	[[ "$output" == *", what was recorded, but not its calibration, "*", all of it, "* ]]
	# anyone can make an empty file, but not that what was signed is read by another calibration
	cp -r signed.rec other.rec
	touch other.rec/calibration/0004-20990101T000000Z.original
	run -1 --separate-stderr incise verify other.rec --signers signers
	[[ "$output" == *"calibration/0004-"*".original, by which it is read, is not in the statement"* ]]
	[[ "$stderr" == *"other.rec: nobody in signers signed what it is now" ]]
	rm -r other.rec
	cp -r signed.rec other.rec
	rm other.rec/calibration/0003-*
	run -1 --separate-stderr incise verify other.rec --signers signers
	[[ "$output" == *"calibrations that are in the statement were removed or changed"* ]]
	sed -i 's/1111/1112/' signed.rec/calibration/*.conf
	run -1 --separate-stderr incise verify signed.rec --signers signers
	[[ "$output" == *"calibrations that are in the statement were removed or changed"* ]]
}

# bats test_tags=check
@test "the key of the rig signs at the end of a capture; without it the recording is whole and unsigned" {
	cat >rig.conf <<-END
		clock = "simulated";
		tracker = "sim:";
		force = "sim:";
		sign_key = "$kim";
	END
	run -0 --separate-stderr incise capture -o r.rec --rig rig.conf --duration 1s
	[[ "$output" == *"signed by ED25519 SHA256:"*"wrote r.rec" ]]
	incise verify r.rec --signers signers
	incise capture -o r.rec --rig rig.conf --duration 1s --overwrite --json | jq -e '.signed_by | startswith("ED25519 ")'
	[ "$(find r.rec/seal -type f | wc -l)" = 2 ]
	incise info rig.conf | grep "sign_key.*kim"
	sed -i "s|$kim|$PWD/none|" rig.conf
	run -1 --separate-stderr incise capture -o r2.rec --rig rig.conf --duration 1s -c none
	[ "${#stderr_lines[@]}" = 1 ]
	[[ "$stderr" == *"incise capture: r2.rec: recorded, but not signed: $PWD/none: No such file or directory; "*"'incise sign' signs it" ]]
	incise verify r2.rec
	[ ! -e r2.rec/seal ]
	sed -i 's|sign_key = .*|sign_key = "kim";|' rig.conf
	run -1 --separate-stderr incise capture -o r3.rec --rig rig.conf --duration 1s
	[[ "$stderr" == *"rig.conf:4: sign_key: expected the path of a private key of SSH"* ]]
}

@test "links, pipes, huge files and strange names in the folder do no harm" {
	sig=$(cd signed.rec/seal && echo 1.*.sig)
	echo secret >target
	ln -s "$PWD/target" signed.rec/seal/1.link.sig
	not_vouched_file() {
		run -1 --separate-stderr timeout 60 incise verify signed.rec --signers signers
		[[ "$output" == *"$1"* ]] || complain "no '$1': $output"
		rm -f "$2"
	}
	not_vouched_file "seal/1.link.sig: a link, which is not followed" signed.rec/seal/1.link.sig
	mkfifo signed.rec/seal/1.pipe.sig
	not_vouched_file "seal/1.pipe.sig: not a regular file" signed.rec/seal/1.pipe.sig
	truncate -s 10G signed.rec/seal/1.huge.tsr
	not_vouched_file "seal/1.huge.tsr: too large" signed.rec/seal/1.huge.tsr
	head -c 3000 /dev/urandom >signed.rec/seal/1.noise.sig
	not_vouched_file "seal/1.noise.sig: it is no signature of OpenSSH" signed.rec/seal/1.noise.sig
	: >signed.rec/seal/1.empty.tsr
	not_vouched_file "seal/1.empty.tsr: not valid: not a reply of RFC 3161" signed.rec/seal/1.empty.tsr
	for name in $'1.\e[31m.sig' "1.a b.sig" -oProxyCommand=x.sig 0.x.sig 12345.x.sig 1.x.sig~; do
		cp "signed.rec/seal/$sig" "signed.rec/seal/$name"
	done
	run -0 --separate-stderr incise verify signed.rec --signers signers
	[ "$(grep -c "seal/\|signed by" <<<"$output")" = 1 ]

	# nothing is written through a link
	mkdir elsewhere
	ln -s ../elsewhere a.rec/seal
	fails incise sign a.rec --key "$kim" -- "a.rec/seal:"
	rm a.rec/seal
	incise sign a.rec --key "$lee"
	ln -s "$PWD/elsewhere/new" "a.rec/seal/$sig"
	fails incise sign a.rec --key "$kim" -- "a.rec/seal/$sig: "
	[ -z "$(ls elsewhere)" ]
}

@test "time-stamps go to openssl and back, by files" {
	run -0 --separate-stderr incise sign a.rec --key "$kim" --timestamp q.tsq
	[[ "${lines[-1]}" == "wrote q.tsq, a.rec/seal/1.statement and a.rec/seal/1."*.sig ]]
	openssl ts -query -in q.tsq -text 2>/dev/null | grep "Certificate required: yes"
	stamp "$made/ca" q.tsq r.tsr
	run -0 --separate-stderr incise sign a.rec --timestamp r.tsr
	[[ "${lines[0]}" =~ ^"a.rec: time-stamped 20"[-0-9]+T[:0-9]+"Z by O=Lab, CN=Test TSA, all of it, statement of commit " ]]
	openssl ts -verify -in a.rec/seal/1.*Z.tsr -data a.rec/seal/1.statement -CAfile "$made/ca/ca.pem"
	run -0 --separate-stderr incise verify a.rec --signers signers --ca "$made/ca/ca.pem"
	[[ "$output" == *"a.rec: time-stamped 20"*"Z by O=Lab, CN=Test TSA, all of it"* ]]
	run -0 --separate-stderr incise verify a.rec --signers signers
	[[ "$output" == *"by O=Lab, CN=Test TSA, not checked: give --ca FILE"* ]]

	# one that openssl asked for itself
	openssl ts -query -data a.rec/seal/1.statement -sha256 -cert -no_nonce -out own.tsq 2>/dev/null
	stamp "$made/ca" own.tsq own.tsr
	cp own.tsr a.rec/seal/1.own.tsr
	incise verify a.rec --signers signers --ca "$made/ca/ca.pem"

	# by a stranger; changed; for something else; refused; no reply
	authority other
	fails incise verify a.rec --signers signers --ca other/ca.pem -- "a.rec:"
	[[ "$output" == *"not valid: not by an authority that is trusted: "* ]]
	n=$(grep -obUa Lab own.tsr | tail -1)
	printf 'Lob' | dd of=a.rec/seal/1.own.tsr bs=1 seek="${n%%:*}" conv=notrunc 2>/dev/null
	run -1 --separate-stderr incise verify a.rec --signers signers --ca "$made/ca/ca.pem"
	[[ "$output" == *"seal/1.own.tsr: not valid: "* ]]
	fails incise sign "signed.rec" --timestamp r.tsr --overwrite -- "r.tsr:"
	openssl ts -query -data signers -sha1 -out sha1.tsq 2>/dev/null
	stamp "$made/ca" sha1.tsq sha1.tsr || :
	fails incise sign a.rec --timestamp sha1.tsr -- "sha1.tsr:"
	cp q.tsq no.tsr
	fails incise sign a.rec --timestamp no.tsr -- "no.tsr:"
	fails incise verify a.rec --signers signers --ca signers -- "signers:"
}

@test "a time-stamp says when a key had to be valid" {
	incise sign a.rec --key "$kim" --timestamp q.tsq
	stamp "$made/ca" q.tsq r.tsr
	incise sign a.rec --timestamp r.tsr
	# valid until the second after the time-stamp, which then passes
	at=$(basename a.rec/seal/1.*Z.tsr .tsr)
	at=${at#1.}
	until=$(date -u -d "$(sed -E 's/(....)(..)(..)T(..)(..)(..)Z/\1-\2-\3 \4:\5:\6/' <<<"$at") UTC + 1 second" +%Y%m%d%H%M%SZ)
	echo "kim@lab valid-before=\"$until\" $(cat "$kim.pub")" >signers
	until [ "$(date -u +%Y%m%d%H%M%SZ)" \> "$until" ]; do sleep 0.1; done
	run -1 --separate-stderr incise verify a.rec --signers signers
	[[ "$output" == *"key has expired"* ]]
	run -0 --separate-stderr incise verify a.rec --signers signers --ca "$made/ca/ca.pem"
	[[ "$output" == *"signed by kim@lab"* ]]
}

@test "an authority answers over http; wrong answers and https are refused" {
	python3 "$root/tests/cli/authority.py" "$made/ca/tsa.cnf" port 3>&- &
	server=$!
	await test -s port
	at=http://127.0.0.1:$(cat port)
	unset http_proxy HTTP_PROXY
	incise sign a.rec --key "$kim" --timestamp "$at/tsr"
	run -0 --separate-stderr incise verify a.rec --signers signers --ca "$made/ca/ca.pem"
	[[ "$output" == *"time-stamped 20"* ]]
	fails incise sign a.rec --timestamp "$at/old" --overwrite -- "$at/old:"
	for path in large page; do
		fails incise sign a.rec --timestamp "$at/$path" -- "$at/$path:"
	done
	run --separate-stderr incise sign a.rec --timestamp https://127.0.0.1/tsr
	failed_with "https://127.0.0.1/tsr: https is not supported, and a time-stamp needs none"
	run --separate-stderr incise sign a.rec --timestamp http://127.0.0.1:1/tsr
	failed_with "http://127.0.0.1:1/tsr: no time-stamp: Connection refused"
	[[ "$(incise info a.rec)" == *"seal     commit "*", head "*"…, 1 signature, 1 time-stamp, not checked: "* ]]
}

@test "an interrupted recording is signed up to its last commit, and one under way is not" {
	incise capture -o p.rec --rig sim:clock=real 2>/dev/null >/dev/null 3>&- &
	capture=$!
	has_rows() { [ "$(stat -c %s p.rec.part/recording.db-wal)" -gt 200000 ]; }
	await has_rows
	fails incise sign p.rec.part --key "$kim" -- "p.rec.part:"
	kill -KILL $capture
	wait $capture || :
	run -0 --separate-stderr incise sign p.rec --key "$kim"
	[[ "${lines[0]}" == "p.rec.part: signed with ED25519 "*", up to where it was interrupted, statement of commit "* ]]
	run -1 --separate-stderr incise verify p.rec --signers signers
	[[ "$output" == *"p.rec.part: signed by kim@lab ("*"), all of it up to the interruption, statement of commit "* ]]
	[[ "$stderr" == *"interrupted: its end is missing"* ]]
}

# join_signed: a.rec, signed, and b.rec, which is not, as day.rec.
join_signed() {
	for n in a b; do
		incise capture -o $n.rec --rig sim:clock=simulated --duration 1s --overwrite \
			--clock-source sim:1000,0,20 >/dev/null
	done
	incise sign a.rec --key "$kim" >/dev/null
	incise join a.rec b.rec -o day.rec >/dev/null
}

@test "a join is signed with its members, which keep their seals" {
	join_signed
	cmp a.rec/seal/1.statement day.rec/a/seal/1.statement
	fails incise verify day.rec --signers signers -- "day.rec/b:"
	incise sign day.rec/b --key "$kim"
	fails incise verify day.rec --signers signers -- "day.rec:"
	[[ "$stderr" == *"the times of the join are not"* ]]
	run -0 --separate-stderr incise sign day.rec --key "$kim"
	[ "$(grep -c "signed with" <<<"$output")" = 3 ]
	[[ "$output" == *"wrote day.rec/seal/1.statement and day.rec/seal/1."* ]]
	run -0 --separate-stderr incise verify day.rec --signers signers
	[[ "$output" == *"day.rec/a: signed by kim@lab "*"day.rec/b: signed by kim@lab "* ]]
	[[ "$output" == *"day.rec: signed by kim@lab ("*"), the times of the join"* ]]
	[[ "$(incise info day.rec)" == *"seal     a: commit "*", 1 signature, "*"seal     b: commit "*", 1 signature, "*"seal     the join, 1 signature, "* ]]
	# a file is the time-stamp of the join
	incise sign day.rec --timestamp q.tsq
	stamp "$made/ca" q.tsq r.tsr
	run -0 --separate-stderr incise sign day.rec --timestamp r.tsr
	[[ "${lines[0]}" == "day.rec: time-stamped 20"* ]]
	openssl ts -verify -in day.rec/seal/1.*Z.tsr -data day.rec/seal/1.statement -CAfile "$made/ca/ca.pem"
	run -0 --separate-stderr incise verify day.rec --signers signers --ca "$made/ca/ca.pem"
	[[ "$output" == *"day.rec: time-stamped 20"* ]]
	# its members and its tables may not come from elsewhere, and it may have any name
	mv day.rec moved.rec
	incise verify moved.rec --signers signers
	rm -r moved.rec/b/seal
	fails incise verify moved.rec --signers signers -- "moved.rec/b:"
}

# forged_joins COUNT: so many with one value changed and the right checksum; none is good.
forged_joins() {
	join_signed
	incise sign day.rec --key "$kim" >/dev/null
	for i in $(seq "$1"); do
		rm -rf forged.rec
		cp -r day.rec forged.rec
		what=$(/usr/bin/python3 "$BATS_TEST_DIRNAME/../attack/forge_join.py" forged.rec "$i")
		run -1 --separate-stderr incise verify forged.rec --signers signers
		[[ "$output" == *"forged.rec: statement 1: member "* || "$stderr" == *"forged.rec"*[:/]* ]] ||
			complain "$what: $output $stderr"
		[[ "$output" != *"the times of the join"* ]] || complain "$what: $output"
	done
}

# bats test_tags=check
@test "a join with a value changed and the right checksum is not what was signed: 20" {
	forged_joins 20
	# a member that was signed, too, but is not the one that was joined
	incise capture -o c.rec --rig sim:clock=simulated --duration 1s --clock-source sim:1000,0,20 >/dev/null
	incise sign c.rec --key "$kim" >/dev/null
	incise join a.rec c.rec -o other.rec >/dev/null
	cp -r day.rec/seal other.rec/
	run -1 --separate-stderr incise verify other.rec --signers signers
	[[ "$output" == *"other.rec: statement 1: member c: 'member b' was signed, and is 'member c' now"* ]] || complain "$output"
}

@test "a join with a value changed and the right checksum is not what was signed: 200" {
	forged_joins 200
}
