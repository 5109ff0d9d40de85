// SPDX-License-Identifier: GPL-2.0-or-later
/* Tests of incise_prove(): lists, checks and makes what lies in seal/; openssl and ssh-keygen judge it. */
#include "../unit.h"
#include "recorded.h"
#include <incise/infile.h>
#include <incise/prove.h>
#include <openssl/sha.h>
#include <openssl/ts.h>

#define SIM "sim:clock=simulated"
#define DB "a.rec/recording.db"

static struct incise_proof proof;

static int prove(const struct incise_prove_options *options)
{
	incise_proof_free(&proof);
	err = (struct incise_error){0};
	return incise_prove("a.rec", options, &proof, &err);
}

static void make_key(void)
{
	assert_int_equal(system("ssh-keygen -q -t ed25519 -N '' -C kim@lab -f kim && "
				"echo \"kim@lab $(cat kim.pub)\" >signers"),
			 0);
}

TEST(the_seal_of_a_recording_is_listed, IN_FOLDER)
{
	const struct incise_prove_options listed = {.level = INCISE_PROVE_SEALS};
	struct incise_recording *recording;
	struct incise_seal_head head;
	char identity[33];

	record("a.rec", SIM, 500 * MS);
	succeeds(!prove(&listed));
	recording = incise_recording_open("a.rec", &err);
	succeeds(recording && !incise_seal_head(recording, identity, &head, &err));
	incise_recording_close(recording);
	assert_int_equal(proof.n, 1);
	assert_string_equal(proof.seals->path, "a.rec");
	assert_string_equal(proof.seals->identity, identity);
	assert_string_equal(proof.seals->head.head, head.head);
	assert_int_equal(proof.seals->n_vouchers, 0);
	assert_false(proof.seals->vouched);
	incise_proof_free(&proof);
	assert_error(incise_prove("none.rec", &listed, &proof, &err), ENOENT, &err,
		     "none.rec: ");
	incise_proof_free(&proof);
}

TEST(a_signer_vouches_until_the_recording_differs, IN_FOLDER)
{
	const struct incise_prove_options signs = {.key = "kim"},
					  checks = {.level = INCISE_PROVE_ALL,
						    .signers = "signers"};

	record("a.rec", SIM, 500 * MS);
	make_key();
	for (int i = 0; i < 2; i++) {
		succeeds(!prove(&signs));
		assert_int_equal(proof.seals->n_vouchers, 1);
		assert_true(proof.seals->vouchers->made);
		assert_int_equal(proof.seals->vouchers->statement, 1);
	}
	succeeds(!prove(&checks));
	assert_true(proof.report.complete);
	assert_true(proof.seals->vouched);
	assert_int_equal(proof.seals->vouchers->verdict, INCISE_PROOF_GOOD);
	assert_string_equal(proof.seals->vouchers->by, "kim@lab");
	change(DB, "UPDATE seal SET t_ns = t_ns + 1 WHERE number = 0");
	succeeds(!prove(&checks));
	assert_false(proof.seals->vouched);
	assert_false(proof.seals->statements->agrees);
	assert_true(proof.seals->statements->n_differences > 0);
	assert_int_equal(prove(&signs), -EBADMSG);
	incise_proof_free(&proof);
}

/* Lines behind the end of a statement are not covered by its reader. */
TEST(a_statement_may_end_anywhere, IN_FOLDER)
{
	static const char *const ends[] = {"calibration x", "calibration", "x", "\n",
					   "\n\nx"};
	const struct incise_prove_options signs = {.key = "kim", .recorded = true},
					  checks = {.level = INCISE_PROVE_ALL,
						    .signers = "signers"};

	record("a.rec", SIM, 500 * MS);
	make_key();
	succeeds(!prove(&signs));
	for (size_t i = 0; i < sizeof(ends) / sizeof(*ends); i++) {
		FILE *file = fopen("a.rec/seal/1.statement", "a");

		fputs(ends[i], file);
		fclose(file);
		succeeds(!prove(&checks));
		assert_false(proof.seals->statements->agrees);
		assert_int_equal(proof.seals->vouchers->verdict, INCISE_PROOF_BAD);
	}
	incise_proof_free(&proof);
}

static int refuse(void *user, const char *path)
{
	assert_string_equal(path, "a.rec/seal/1.statement");
	++*(int *)user;
	return 1;
}

TEST(no_file_is_written_that_the_caller_refuses, IN_FOLDER)
{
	int asked = 0;
	const struct incise_prove_options signs = {
		.key = "kim", .recorded = true, .write = refuse, .user = &asked};

	record("a.rec", SIM, 500 * MS);
	make_key();
	assert_int_equal(prove(&signs), -ECANCELED);
	assert_int_equal(asked, 1);
	assert_int_not_equal(access("a.rec/seal", F_OK), 0);
	incise_proof_free(&proof);
}

/* The query is written by hand: libcrypto reads it. */
TEST(a_query_is_one_of_rfc_3161, IN_FOLDER)
{
	const struct incise_prove_options asks = {.timestamp = "q.tsq"};
	const struct incise_infile_kind kind = {.name = "a file", .size_max = 1 << 20};
	unsigned char digest[32];
	size_t n, n_text;

	record("a.rec", SIM, 500 * MS);
	for (int i = 0; i < 20; i++) {
		succeeds(!prove(&asks));
		char *bytes = incise_infile_read("q.tsq", &kind, &n, &err);
		char *text = incise_infile_read("a.rec/seal/1.statement", &kind, &n_text,
						&err);
		const unsigned char *at = (const unsigned char *)bytes;
		TS_REQ *query = d2i_TS_REQ(NULL, &at, (long)n);
		TS_MSG_IMPRINT *imprint;
		unsigned char *again = NULL;

		assert_non_null(query);
		assert_ptr_equal(at, bytes + n);
		assert_int_equal(TS_REQ_get_version(query), 1);
		assert_true(TS_REQ_get_cert_req(query));
		imprint = TS_REQ_get_msg_imprint(query);
		SHA256((const unsigned char *)text, n_text, digest);
		assert_memory_equal(
			ASN1_STRING_get0_data(TS_MSG_IMPRINT_get_msg(imprint)), digest,
			sizeof(digest));
		/* DER has one form. */
		assert_int_equal(i2d_TS_REQ(query, &again), n);
		assert_memory_equal(again, bytes, n);
		OPENSSL_free(again);
		TS_REQ_free(query);
		free(bytes);
		free(text);
	}
	incise_proof_free(&proof);
}

TEST(rows_and_tables_are_verified_without_the_seal, IN_FOLDER)
{
	const struct incise_prove_options rows = {.level = INCISE_PROVE_ROWS},
					  tables = {.level = INCISE_PROVE_TABLES};

	record("a.rec", SIM, 500 * MS);
	succeeds(!prove(&rows));
	assert_string_equal(proof.altered, "");
	assert_int_equal(proof.n, 0);
	change(DB, "UPDATE blocks SET data = zeroblob(length(data)) "
		   "WHERE stream = 'force' AND block = 0");
	succeeds(!prove(&tables));
	assert_string_equal(proof.altered, "");
	succeeds(!prove(&rows));
	assert_non_null(strstr(proof.altered, "force: block 0"));
	change(DB, "UPDATE meta SET value = 'x' WHERE key = 'rig'");
	succeeds(!prove(&tables));
	assert_string_not_equal(proof.altered, "");
	incise_proof_free(&proof);
}

TEST(a_seal_is_removed_and_nothing_else, IN_FOLDER)
{
	const struct incise_prove_options signs = {.key = "kim", .recorded = true};

	record("a.rec", SIM, 500 * MS);
	succeeds(!incise_proof_remove("a.rec", &err));
	make_key();
	succeeds(!prove(&signs));
	assert_int_equal(
		system("cp -r a.rec/seal a.rec/seal-before && touch a.rec/seal/notes"),
		0);
	assert_error(incise_proof_remove("a.rec", &err), ENOTEMPTY, &err, "a.rec/seal: ");
	assert_int_equal(access("a.rec/seal/notes", F_OK), 0);
	assert_int_equal(unlink("a.rec/seal/notes"), 0);
	succeeds(!incise_proof_remove("a.rec", &err));
	assert_int_not_equal(access("a.rec/seal", F_OK), 0);
	assert_int_not_equal(access("a.rec/seal-before", F_OK), 0);
	incise_proof_free(&proof);
}
