// SPDX-License-Identifier: GPL-2.0-or-later
/* Tests of the seal: the statement of a recording, its text, and what differs from it. */
#include "../unit.h"
#include "recorded.h"
#include <incise/seal.h>
#include "../../../lib/record/seal_chain.h"

#define SIM "sim:clock=simulated"
#define DB "a.rec/recording.db"

static struct {
	char text[4000]; /* lines "part: text" of the kind seal */
	struct incise_verify_finding first;
	int n;
} findings;
static struct incise_verify_report report;

static void found(void *user, const struct incise_verify_finding *finding)
{
	size_t n = strlen(findings.text);

	if (finding->kind != INCISE_VERIFY_SEAL)
		return;
	if (!findings.n++)
		findings.first = *finding;
	snprintf(findings.text + n, sizeof(findings.text) - n, "%s: %s\n",
		 finding->stream, finding->text);
}

static char *statement_of(const char *path)
{
	char *text = incise_seal_statement(path, &err);

	succeeds(text);
	return text;
}

static void compare(const char *path, const char *text)
{
	struct incise_verify_watch watch = {.found = found};

	memset(&findings, 0, sizeof(findings));
	succeeds(!incise_seal_compare(path, text, strlen(text), &watch, &report, &err));
}

TEST(statement_says_what_is_recorded, IN_FOLDER)
{
	struct incise_seal_statement statement;
	struct incise_recording *recording;
	struct incise_seal_head head;
	char *text, *again, identity[33];

	record("a.rec", SIM, 2000 * MS);
	text = statement_of("a.rec");
	again = statement_of("a.rec");
	assert_string_equal(text, again);
	free(again);
	assert_int_equal(incise_seal_read(&statement, text, strlen(text), &err), 0);
	assert_string_equal(statement.name, "a");
	assert_true(statement.complete);
	/* The start, 20 times 100 ms, and the end with its two commits. */
	assert_int_equal(statement.last.commit, ask(DB, "SELECT max(number) FROM seal"));
	assert_int_equal(statement.n_earlier, statement.last.commit);
	assert_string_equal(statement.parts[3].name, "force");
	assert_int_equal(statement.parts[3].rows, 20000);
	assert_string_equal(statement.parts[7].name, "depth");
	assert_int_equal(statement.parts[7].rows, 0); /* found from the poses */
	assert_string_equal(statement.parts[12].name, "camera.mkv");
	assert_int_equal(statement.parts[12].rows, 0);

	recording = incise_recording_open("a.rec", &err);
	assert_non_null(recording);
	assert_int_equal(incise_seal_head(recording, identity, &head, &err), 0);
	assert_string_equal(identity, statement.identity);
	assert_string_equal(head.head, statement.last.head);
	assert_int_equal(head.commit, statement.last.commit);
	incise_recording_close(recording);

	compare("a.rec", text);
	assert_string_equal(findings.text, "");
	assert_true(report.sealed && report.complete);
	free(text);
}

/* Two recordings of the same script have different identities, and so all heads are others. */
TEST(heads_are_of_one_recording, IN_FOLDER)
{
	char *text;

	record("a.rec", SIM, 500 * MS);
	record("b.rec", SIM, 500 * MS);
	text = statement_of("b.rec");
	compare("a.rec", text);
	assert_int_equal(findings.n, 1);
	assert_says(findings.text, "start:");
	assert_false(report.sealed);
	assert_false(report.complete);
	free(text);
}

TEST(statement_is_read_strictly, IN_FOLDER)
{
	static const struct {
		const char *from, *to; /* the first place is replaced */
	} cases[] = {
		{"statement 1", "statement 2"},
		{"statement 1\n", "statement 1\r\n"},
		{"complete yes", "complete maybe"},
		{"commit ", "commit 0"},
		{"commit ", "commit +"},
		{"commit ", "commit  "},
		{"commit ", "commit -"},
		{"commit ", "commit 99999999999999999999999999"},
		{"part force", "part tracker"},
		{"part force ", "part force 0"},
		{"part force ", "part force -"},
		{"earlier 0", "earlier 1"},
		{"earlier 0 ", "earlier 0 x"},
		{"earlier 0 ", "earlier 0  "},
		{"name a\n", "name a\n\n"},
		{"name a\n", "name \x1b[2J\n"},
		{"name a\n", "nameXa\n"},
		{"name a\n", "name\n"},
		{"identity ", "identity A"},
		{"end\n", "end\nend\n"},
		{"end\n", "end"},
		{"end\n", ""},
	};
	struct incise_seal_statement statement;
	char *text, *forged;

	record("a.rec", SIM, 500 * MS);
	text = statement_of("a.rec");
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		const char *at = strstr(text, cases[i].from);

		assert_non_null(at);
		assert_true(asprintf(&forged, "%.*s%s%s", (int)(at - text), text,
				     cases[i].to, at + strlen(cases[i].from)) > 0);
		if (incise_seal_read(&statement, forged, strlen(forged), &err) != -EINVAL)
			fail_msg("accepted: %s for %s", cases[i].to, cases[i].from);
		free(forged);
	}
	/* No part of it, and nothing that is longer than any. */
	for (size_t n = 0; n < strlen(text); n++)
		assert_int_equal(incise_seal_read(&statement, text, n, &err), -EINVAL);
	forged = calloc(1, 1 << 20);
	memcpy(forged, text, strlen(text));
	assert_error(incise_seal_read(&statement, forged, 1 << 20, &err), EINVAL, &err,
		     NULL);
	free(forged);
	free(text);
}

/*
 * Rows changed by someone who recomputes the ledger: here the seal is what is left, and its
 * own head too may be recomputed. tests/attack/forgeries.py has all kinds.
 */
TEST(older_and_longer_recordings_are_named, IN_FOLDER)
{
	struct incise_rig *rig = open_rig(SIM);
	struct incise_recorder *recorder = start_recorder("a.rec", rig);
	char *text, *later;

	assert_int_equal(poll_for(recorder, rig, 1000 * MS, &err), 0);
	text = statement_of("a.rec"); /* of the .part, which is written */
	compare("a.rec", text);
	assert_string_equal(findings.text, "");
	assert_true(report.sealed && report.interrupted && report.intact);
	assert_int_equal(poll_for(recorder, rig, 1000 * MS, &err), 0);
	later = statement_of("a.rec");
	compare("a.rec", text);
	assert_int_equal(findings.n, 1);
	assert_says(findings.text, "signed");
	assert_int_equal(incise_recorder_close(recorder, &err), 0);
	incise_rig_close(rig);
	compare("a.rec", later);
	assert_int_equal(findings.n, 1);
	assert_says(findings.text, "signed");
	free(text);
	free(later);

	text = statement_of("a.rec");
	/* Truncated to its 10th commit, and called interrupted. */
	change(DB,
	       "DELETE FROM ledger WHERE stream LIKE '%:%'; "
	       "DELETE FROM seal WHERE number > 10; "
	       "DELETE FROM blocks WHERE stream = 'force' AND block >= (SELECT force FROM "
	       "seal WHERE number = 10); "
	       "DELETE FROM blocks WHERE stream = 'tracker' AND block >= (SELECT tracker "
	       "FROM seal WHERE number = 10); "
	       "UPDATE meta SET value = (SELECT sum(count) FROM blocks WHERE stream = "
	       "'force') WHERE key = 'force_rows'; "
	       "UPDATE meta SET value = (SELECT sum(count) FROM blocks WHERE stream = "
	       "'tracker') WHERE key IN ('tracker_rows', 'depth_rows'); "
	       "UPDATE meta SET value = 0 WHERE key = 'complete'");
	compare("a.rec", text);
	assert_true(report.intact == false && !report.sealed);
	assert_int_equal(findings.n, 1);
	assert_says(findings.text, "commit 10 of the 22");
	assert_int_equal(findings.first.first_block, 11);
	free(text);
}

/* Row by row the ledger agrees: only the seal shows it. */
TEST(rows_that_the_ledger_covers_are_found, IN_FOLDER)
{
	char *text;

	record("a.rec", SIM, 1000 * MS);
	text = statement_of("a.rec");
	change(DB, "UPDATE seal SET t_ns = t_ns + 1 WHERE number = 3");
	compare("a.rec", text);
	assert_int_equal(findings.n, 1);
	assert_says(findings.text, "commit 3");
	change(DB,
	       "UPDATE seal SET t_ns = t_ns - 1 WHERE number = 3; UPDATE seal SET head "
	       "= zeroblob(32) WHERE number IN (5, 6)");
	compare("a.rec", text);
	assert_says(findings.text, "commits 5 to 7");
	change(DB, "DELETE FROM seal");
	compare("a.rec", text);
	assert_false(report.sealed);
	assert_null(incise_seal_statement("a.rec", NULL));
	free(text);
}

TEST(older_forms_have_none, IN_FOLDER)
{
	char *text;

	record("a.rec", SIM, 500 * MS);
	text = statement_of("a.rec");
	change(DB, TO_FORM_3);
	assert_error(incise_seal_statement("a.rec", &err), ENOTSUP, &err, "format 3");
	assert_int_equal(incise_seal_compare("a.rec", text, strlen(text), NULL, &report,
					     &err),
			 -ENOTSUP);
	free(text);
	assert_null(incise_seal_statement("missing.rec", &err));
	assert_int_equal(err.code, ENOENT);
}

/* The parts of table meta: a new key is covered whatever it is called. */
TEST(every_key_of_meta_is_in_one_part, IN_FOLDER)
{
	uint64_t rows, sum = 0;
	uint8_t digest[INCISE_SEAL_BYTES];
	struct incise_seal seal;
	sqlite3 *db;

	record("a.rec", SIM, 500 * MS);
	change(DB, "INSERT INTO meta VALUES('tomorrow', 1)");
	assert_int_equal(sqlite3_open(DB, &db), SQLITE_OK);
	assert_int_equal(incise_seal_init(&seal), 0);
	for (int i = 0; i < INCISE_SEAL_PARTS; i++)
		if (i < INCISE_SEAL_STREAM || i == INCISE_SEAL_META) {
			assert_int_equal(incise_seal_table(&seal, db, i, &rows, digest),
					 SQLITE_OK);
			assert_true(rows > 3);
			sum += rows;
		}
	assert_int_equal(sum, ask(DB, "SELECT count(*) FROM meta"));
	incise_seal_free(&seal);
	sqlite3_close(db);
}
