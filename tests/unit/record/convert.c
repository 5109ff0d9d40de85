// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/write/convert.c: what was converted to format 4 comes back bit by bit, however its ledger
 * is cut; a conversion that fails leaves nothing.
 */
#include "../unit.h"
#include "recorded.h"
#include <incise/verify.h>
#include "../../../lib/base/random.h"
#include "../../../lib/record/read/source.h"

static struct incise_recovered made;

/* The ledger of TO_FORM_4 has no CRCs of rows, so that it counts as damaged. */
static void convert(const char *from, const char *to)
{
	succeeds(!incise_recording_recover(from, to, true, &made, &err));
	assert_true(made.converted);
}

/* The rows of all streams, as bytes. */
static char *rows_of(const char *path, size_t *size)
{
	struct incise_recording *recording = open_recording(path);
	char *bytes = NULL;
	FILE *to = open_memstream(&bytes, size);

	for (int i = 0; i < INCISE_LEDGER_FORMS; i++) {
		struct incise_source source;
		int rc = incise_source_open(&source, recording, i, &err);
		const struct incise_batch *batch = &source.batch;

		while (!rc && incise_source_next(&source, &err) > 0)
			for (size_t k = 0; k < batch->n; k++)
				for (int c = 0; batch->form->types[c]; c++) {
					const char type = batch->form->types[c];
					size_t n =
						type == 'c'   ? 1
						: type == 's' ? sizeof(*batch->column->s)
						: type == 'h' ? sizeof(*batch->column->h)
							      : 8;

					fwrite(batch->column[c].c + k * n, n, 1, to);
				}
		assert_int_equal(rc, 0);
		incise_source_close(&source);
	}
	incise_recording_close(recording);
	fclose(to);
	return bytes;
}

static void same_rows(const char *a, const char *b)
{
	size_t n, m;
	char *x = rows_of(a, &n), *y = rows_of(b, &m);

	assert_int_equal(n, m);
	assert_memory_equal(x, y, n);
	free(x);
	free(y);
}

static void remove_recording(const char *path)
{
	nftw(path, remove_entry, 8, FTW_DEPTH | FTW_PHYS);
}

/* Blocks and commits are those that it had before it became one of format 4. */
TEST(blocks_and_commits_come_back_bit_by_bit, IN_FOLDER)
{
	record("a.rec", "sim:clock=simulated,cut_s=0.5,pause_s=0.3", 3000 * MS);
	assert_int_equal(system("cp -r a.rec b.rec"), 0);
	change("b.rec/recording.db", TO_FORM_4);
	convert("b.rec", "c.rec");
	same_rows("a.rec", "c.rec");
	same_rows("b.rec", "c.rec");
	assert_int_equal(
		(int)ask("c.rec/recording.db",
			 "ATTACH 'a.rec/recording.db' AS other; SELECT sum(n) FROM ("
			 "SELECT count(*) AS n FROM (SELECT * FROM main.blocks EXCEPT "
			 "SELECT * FROM other.blocks) UNION ALL SELECT count(*) FROM "
			 "(SELECT * FROM other.blocks EXCEPT SELECT * FROM main.blocks) "
			 "UNION ALL SELECT count(*) FROM (SELECT number, t_ns, force, "
			 "tracker, camera, wall FROM main.seal EXCEPT SELECT number, "
			 "t_ns, force, tracker, camera, wall FROM other.seal) UNION ALL "
			 "SELECT (SELECT count(*) FROM main.seal) <> (SELECT count(*) "
			 "FROM other.seal))"),
		0);
	/* the summary of all samples: near that of the capture, by its times */
	assert_int_equal((int)ask("c.rec/recording.db",
				  "SELECT count(*) FROM meta WHERE key IN ('cuts', "
				  "'depth_max_mm', 'force_max_N') AND value IS NOT NULL"),
			 3);
}

#define FIELDS "stream, block, first_seq, last_seq, first_ns, last_ns, count, lost"

/* In gaps, and those of the end that no gap shows. */
TEST(losses_are_those_of_the_ledger, IN_FOLDER)
{
	record("a.rec", "sim:clock=simulated", 1000 * MS);
	change("a.rec/recording.db", TO_FORM_4);
	change("a.rec/recording.db",
	       "DELETE FROM tracker WHERE seq IN (SELECT first_seq + 3 FROM ledger WHERE "
	       "stream = 'tracker' AND count > 5); UPDATE ledger SET count = count - 1, "
	       "lost = 1 WHERE stream = 'tracker' AND count > 5; UPDATE ledger SET lost "
	       "= 4, last_seq = last_seq + 4 WHERE stream = 'tracker' AND count = 0; "
	       "UPDATE meta SET value = (SELECT sum(lost) FROM ledger) WHERE key = "
	       "'tracker_lost'; UPDATE meta SET value = (SELECT count(*) FROM tracker) "
	       "WHERE key = 'tracker_rows'");
	convert("a.rec", "b.rec");
	assert_int_equal((int)ask("b.rec/recording.db", "SELECT sum(lost) FROM blocks"),
			 14);
	assert_int_equal(
		(int)ask("b.rec/recording.db",
			 "ATTACH 'a.rec/recording.db' AS old; SELECT count(*) FROM "
			 "(SELECT " FIELDS " FROM main.blocks EXCEPT SELECT " FIELDS
			 " FROM old.ledger)"),
		0);
}

TEST(rows_are_kept_however_the_ledger_is_cut, IN_FOLDER)
{
	record("a.rec", "sim:clock=simulated,cut_s=0.5,pause_s=0.3", 1000 * MS);
	change("a.rec/recording.db", TO_FORM_4);
	for (uint64_t k = 0; k < 30; k++) {
		assert_int_equal(system("cp -r a.rec b.rec"), 0);
		change_by("b.rec/recording.db",
			  "UPDATE ledger SET count = (count * %d + block * %d) %% %d "
			  "WHERE count > 0; DELETE FROM ledger WHERE block %% %d = 3; "
			  "DELETE FROM seal WHERE number %% %d = 2; UPDATE meta SET "
			  "value = %d WHERE key = 'complete'",
			  (int)(incise_random_bits(1, 5 * k) % 7),
			  (int)(incise_random_bits(1, 5 * k + 1) % 90),
			  (int)(incise_random_bits(1, 5 * k + 2) % 2000) + 1,
			  (int)(incise_random_bits(1, 5 * k + 3) % 6) + 4,
			  (int)(incise_random_bits(1, 5 * k + 4) % 9) + 3, (int)k % 2);
		convert("b.rec", "c.rec");
		same_rows("a.rec", "c.rec");
		assert_true(*made.altered);
		remove_recording("b.rec");
		remove_recording("c.rec");
	}
}

/* It is not proof of anything: the way that it came stays in it. */
TEST(one_that_was_altered_stays_altered, IN_FOLDER)
{
	struct incise_verify_report report;

	record("a.rec", "sim:clock=simulated", 500 * MS);
	change("a.rec/recording.db", TO_FORM_4);
	assert_int_equal(incise_recording_recover("a.rec", "b.rec", false, &made, &err),
			 -EBADMSG);
	assert_int_equal(access("b.rec", F_OK) & access("b.rec.part", F_OK), -1);
	convert("a.rec", "b.rec");
	succeeds(!incise_verify("b.rec", NULL, &report, &err));
	assert_true(!report.intact && report.sealed);
}

TEST(a_row_that_cannot_be_converted_leaves_nothing, IN_FOLDER)
{
	record("a.rec", "sim:clock=simulated", 500 * MS);
	change("a.rec/recording.db", TO_FORM_4);
	change("a.rec/recording.db", "UPDATE tracker SET x_mm = 'here' WHERE seq = 20");
	assert_int_equal(incise_recording_recover("a.rec", "b.rec", true, &made, &err),
			 -EINVAL);
	assert_says(err.text, "a.rec: damaged: table tracker, row 20 is invalid");
	assert_int_equal(access("b.rec", F_OK) & access("b.rec.part", F_OK), -1);
}

/* Before form 4 rows have no digest of their frame. */
TEST(frames_of_form_3_get_their_digests, WITH_MODULES)
{
	struct incise_verify_report report;
	struct incise_rig *rig;

	if (!has_frames())
		skip();
	rig = incise_rig_open("sim:clock=simulated", BOTH | INCISE_RIG_CAMERA, &err);
	succeeds(rig);
	end_recorder(start_recorder("a.rec", rig), rig, 500 * MS);
	assert_int_equal(system("cp -r a.rec b.rec"), 0);
	change("b.rec/recording.db", TO_FORM_3);
	convert("b.rec", "c.rec");
	same_rows("a.rec", "c.rec");
	succeeds(!incise_verify("c.rec", NULL, &report, &err));
	assert_true(report.frames.present > 0 && !report.frames.altered);
}
