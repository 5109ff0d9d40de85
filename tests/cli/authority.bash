# SPDX-License-Identifier: GPL-2.0-or-later
# A time-stamp authority for tests, of openssl: `load authority.bash`.
# shellcheck shell=bash

# authority FOLDER: a certificate authority ca.pem, and a time-stamp authority below it.
authority() {
	mkdir -p "$1"
	(
		cd "$1"
		cat >tsa.cnf <<-END
			[req]
			distinguished_name = dn
			prompt = no
			[dn]
			CN = Test CA
			[ca]
			basicConstraints = critical,CA:TRUE
			keyUsage = critical,keyCertSign,cRLSign
			[stamps]
			keyUsage = critical,digitalSignature
			extendedKeyUsage = critical,timeStamping
			[tsa]
			default_tsa = tsa1
			[tsa1]
			serial = $PWD/serial
			signer_cert = $PWD/tsa.pem
			signer_key = $PWD/tsa.key
			signer_digest = sha256
			default_policy = 1.2.3.4.1
			digests = sha256
			accuracy = secs:1
			ess_cert_id_alg = sha256
		END
		echo 01 >serial
		new=(-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -config tsa.cnf)
		openssl req -x509 "${new[@]}" -keyout ca.key -out ca.pem -extensions ca -days 3650
		openssl req "${new[@]}" -keyout tsa.key -out tsa.csr -subj "/O=Lab/CN=Test TSA"
		openssl x509 -req -in tsa.csr -CA ca.pem -CAkey ca.key -CAcreateserial -out tsa.pem \
			-days 3650 -extfile tsa.cnf -extensions stamps
	) 2>/dev/null
}

# stamp FOLDER QUERY.tsq REPLY.tsr: its reply
stamp() {
	openssl ts -reply -config "$1/tsa.cnf" -queryfile "$2" -out "$3" 2>/dev/null
}
