// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Streams of a recording: rows are those of the tables at their best times, to the bit, tables
 * those of the exported CSV; types, units and calibration; damage, forks and early ends.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../record/recorded.h"
#include <sys/wait.h>
#include <incise/arrow.h>

#define DB "a.rec/recording.db"

static struct incise_recording *open_it(void)
{
	struct incise_recording *recording = incise_recording_open("a.rec", &err);

	succeeds(recording);
	return recording;
}

static struct ArrowArrayStream open_stream(const char *what,
					   const struct incise_export_options *options)
{
	struct incise_recording *recording = open_it();
	struct ArrowArrayStream stream;

	if (incise_recording_stream(recording, what, options, &stream, &err))
		fail_msg("%s: %s", what, err.text);
	/* the stream reads by a connection of its own */
	incise_recording_close(recording);
	return stream;
}

static struct ArrowArray next(struct ArrowArrayStream *stream)
{
	struct ArrowArray array;
	int rc = stream->get_next(stream, &array);

	if (rc)
		fail_msg("%s", stream->get_last_error(stream));
	assert_null(stream->get_last_error(stream));
	return array;
}

static const void *data(const struct ArrowArray *array, int column)
{
	return array->children[column]->buffers[1];
}

static bool flag(const struct ArrowArray *array, int column, int64_t row)
{
	return ((const uint8_t *)data(array, column))[row / 8] >> row % 8 & 1;
}

TEST(force_is_that_of_the_table, IN_FOLDER)
{
	struct incise_recording_value *values;
	struct incise_recording *recording;
	struct ArrowArrayStream stream;
	struct ArrowArray batch;
	int n, row = 0, clipped = 0, batches = 0;

	record("a.rec", SHORT_SCRIPT, 8000 * MS);
	change(DB, "UPDATE force SET code = 4095 WHERE seq = 5; "
		   "UPDATE force SET code = 0 WHERE seq = 66000");
	recording = open_it();
	n = incise_recording_values(recording, "force", &values, &err);
	assert_int_equal(n, 80000);
	stream = open_stream("force", NULL);
	for (; (batch = next(&stream)).release; batch.release(&batch), batches++)
		for (int64_t i = 0; i < batch.length; i++, row++) {
			bool end = flag(&batch, 4, i);

			assert_true(row < n);
			assert_int_equal(((const int64_t *)data(&batch, 0))[i], row);
			assert_int_equal(((const int64_t *)data(&batch, 1))[i],
					 values[row].t_ns);
			assert_int_equal(end, row == 5 || row == 66000);
			clipped += end;
			/* the array's formula has its terms in another order */
			if (!end)
				assert_true(fabs(((const double *)data(&batch, 3))[i] -
						 values[row].value) < 1e-14);
		}
	assert_int_equal(row, n);
	assert_int_equal(clipped, 2);
	assert_int_equal(batches, 5);	    /* of 16384 rows at most */
	assert_null(next(&stream).release); /* the end stays the end */
	stream.release(&stream);
	assert_null(stream.release);
	incise_recording_close(recording);
	free(values);
}

/* Force samples of 10 kHz by their numbers: from the first of the part to before its end. */
TEST(a_part_of_a_stream_has_its_rows, IN_FOLDER)
{
	struct incise_export_options options;
	struct incise_recording *recording;
	struct ArrowArrayStream stream;
	struct ArrowArray batch;
	int64_t seq = 20000;

	record("a.rec", SHORT_SCRIPT, 8000 * MS);
	incise_export_options_init(&options);
	options.from_s = 2;
	options.to_s = 5;
	stream = open_stream("force", &options);
	for (; (batch = next(&stream)).release; batch.release(&batch))
		for (int64_t i = 0; i < batch.length; i++)
			assert_int_equal(((const int64_t *)data(&batch, 0))[i], seq++);
	assert_int_equal(seq, 50000);
	stream.release(&stream);
	options.cut = 1;
	recording = open_it();
	assert_error(incise_recording_stream(recording, "force", &options, &stream, &err),
		     EINVAL, &err, "force have no cut");
	incise_recording_close(recording);
}

/* Rows of a stream: number, time and a value. */
struct stream_row {
	int64_t seq, t_ns;
	double value;
};

static size_t read_rows(const char *what, const struct incise_export_options *options,
			struct stream_row *rows, size_t most)
{
	struct ArrowArrayStream stream = open_stream(what, options);
	const int column = strcmp(what, "tracker") ? strcmp(what, "depth") ? 3 : 2 : 3;
	struct ArrowArray batch;
	size_t n = 0;

	for (; (batch = next(&stream)).release; batch.release(&batch))
		for (int64_t i = 0; i < batch.length; i++) {
			assert_true(n < most);
			rows[n++] = (struct stream_row){
				((const int64_t *)data(&batch, 0))[i],
				((const int64_t *)data(&batch, 1))[i],
				((const double *)data(&batch, column))[i]};
		}
	stream.release(&stream);
	return n;
}

#define ROWS 200000

/* The rows of @part are rows of @whole; those of an overview may have another time and depth, as nothing settles. */
static void check_rows(const struct stream_row *part, size_t n,
		       const struct stream_row *whole, size_t n_whole, bool overview)
{
	size_t k = 0;

	for (size_t i = 0; i < n; i++) {
		while (k < n_whole && whole[k].seq < part[i].seq)
			k++;
		assert_true(k < n_whole && whole[k].seq == part[i].seq);
		assert_true(llabs(whole[k].t_ns - part[i].t_ns) <=
			    (overview ? 5 * MS : 0));
		assert_true(overview || whole[k].value == part[i].value);
	}
}

TEST(parts_and_overviews_are_rows_of_the_whole, IN_FOLDER)
{
	static const char *const streams[] = {"force", "depth", "tracker"};
	static struct stream_row whole[ROWS], part[ROWS];
	uint64_t rng = 1;

	record("a.rec", SHORT_SCRIPT, 12000 * MS);
	for (int i = 0; i < 3; i++) {
		size_t n = read_rows(streams[i], NULL, whole, ROWS), rows;

		for (int round = 0; round < 20; round++) {
			struct incise_export_options options;
			int64_t from_ns, to_ns;
			size_t expected = 0;

			incise_export_options_init(&options);
			options.from_s = 12 * fabs(incise_random_symmetric(&rng));
			options.to_s = options.from_s +
				       3 * fabs(incise_random_symmetric(&rng)) + 0.01;
			rows = read_rows(streams[i], &options, part, ROWS);
			check_rows(part, rows, whole, n, false);
			/* They follow each other: none between is left out. */
			from_ns = rows ? part[0].t_ns : 0;
			to_ns = rows ? part[rows - 1].t_ns : -1;
			for (size_t k = 0; k < n; k++)
				expected += whole[k].t_ns >= from_ns &&
					    whole[k].t_ns <= to_ns;
			assert_int_equal(rows, expected);

			options.from_s = options.to_s = 0;
			options.every_s = 0.2 + fabs(incise_random_symmetric(&rng));
			rows = read_rows(streams[i], &options, part, ROWS);
			check_rows(part, rows, whole, n, true);
			assert_true(rows > 0 && rows < n);
			for (size_t k = 1; k < rows; k++)
				assert_true(part[k].t_ns - part[k - 1].t_ns <
					    (int64_t)(options.every_s * 1e9) + 300 * MS);
		}
	}
}

TEST(poses_are_those_of_the_table, IN_FOLDER)
{
	struct incise_tracker_sample *poses;
	struct incise_recording *recording;
	struct ArrowArrayStream stream;
	struct ArrowArray batch;
	int n;

	record("a.rec", SHORT_SCRIPT, 4000 * MS);
	recording = open_it();
	n = incise_recording_poses(recording, &poses, NULL);
	stream = open_stream("tracker", NULL);
	batch = next(&stream);
	assert_int_equal(batch.length, n);
	for (int i = 0; i < n; i++) {
		assert_int_equal(((const int64_t *)data(&batch, 1))[i], poses[i].t_ns);
		for (int k = 0; k < 3; k++)
			assert_true(((const double *)data(&batch, 3 + k))[i] ==
				    poses[i].position_mm[k]);
		for (int k = 0; k < 4; k++)
			assert_true(((const double *)data(&batch, 6 + k))[i] ==
				    poses[i].quaternion[k]);
		/* texts: the status is one byte each */
		assert_int_equal(((const int32_t *)data(&batch, 10))[i], i);
		assert_int_equal(((const char *)batch.children[10]->buffers[2])[i],
				 poses[i].status);
	}
	batch.release(&batch);
	assert_null(next(&stream).release);
	stream.release(&stream);
	incise_recording_close(recording);
	free(poses);
}

static const char *metadata(const struct ArrowSchema *schema, const char *key)
{
	static char value[200];
	const char *at = schema->metadata;
	int32_t n, length;

	memcpy(&n, at, 4);
	at += 4;
	for (int i = 0; i < n; i++) {
		bool found;

		memcpy(&length, at, 4);
		found = (size_t)length == strlen(key) &&
			!memcmp(at + 4, key, (size_t)length);
		at += 4 + length;
		memcpy(&length, at, 4);
		snprintf(value, sizeof(value), "%.*s", (int)length, at + 4);
		if (found)
			return value;
		at += 4 + length;
	}
	return "";
}

TEST(fields_have_units_and_calibration, IN_FOLDER)
{
	struct incise_calibration calibration;
	struct incise_export_options options;
	struct ArrowArrayStream stream;
	struct ArrowArray batch[2];
	struct ArrowSchema schema;

	record("a.rec", SHORT_SCRIPT, 1000 * MS);
	stream = open_stream("force", NULL);
	assert_int_equal(stream.get_schema(&stream, &schema), 0);
	assert_string_equal(schema.format, "+s");
	assert_string_equal(metadata(&schema, "options"), "rows of table force");
	assert_string_equal(metadata(&schema, "source"), "a.rec");
	assert_string_equal(schema.children[1]->name, "t_ns");
	assert_string_equal(schema.children[1]->format, "l");
	assert_string_equal(schema.children[3]->name, "force_N");
	assert_string_equal(schema.children[3]->format, "g");
	assert_string_equal(metadata(schema.children[3], "unit"), "N");
	assert_string_equal(metadata(schema.children[3], "force_mV_N"), "1240");
	/* a nominal value states no uncertainty; the zero was measured */
	assert_string_equal(metadata(schema.children[3], "force_mV_N_u"), "");
	assert_true(atof(metadata(schema.children[3], "force_zero_mV_u")) > 0.01);
	schema.release(&schema);
	batch[0] = next(&stream);
	stream.release(&stream);

	/* another calibration: half the force, and 3 ms earlier */
	incise_calibration_nominal(&calibration);
	calibration.force_mV_N = 2480;
	calibration.force_zero_mV = 0;
	calibration.force_delay_ms = 3;
	incise_export_options_init(&options);
	options.calibration = &calibration;
	stream = open_stream("force", &options);
	stream.get_schema(&stream, &schema);
	assert_string_equal(metadata(schema.children[3], "force_mV_N"), "2480");
	assert_string_equal(metadata(schema.children[1], "delay_ms"), "3");
	schema.release(&schema);
	batch[1] = next(&stream);
	stream.release(&stream);
	assert_int_equal(((const int64_t *)data(&batch[0], 1))[7] - 3000000,
			 ((const int64_t *)data(&batch[1], 1))[7]);
	/* 5000 mV over 4096 codes */
	assert_true(fabs(((const double *)data(&batch[1], 3))[7] -
			 ((const int32_t *)data(&batch[1], 2))[7] * 5000.0 / 4096 /
				 2480) < 1e-12);
	/* batches outlive their stream */
	batch[0].release(&batch[0]);
	batch[1].release(&batch[1]);
}

/* The rows of a table stream as CSV would have them: rounded as each column says. */
static int count_rows(const struct incise_export_options *options, double *force_sum)
{
	struct ArrowArrayStream stream = open_stream("table", options);
	struct ArrowSchema schema;
	struct ArrowArray batch;
	int rows = 0, column = -1;

	stream.get_schema(&stream, &schema);
	for (int i = 0; i < schema.n_children; i++)
		if (!strcmp(schema.children[i]->name, "force_N"))
			column = i;
	for (; (batch = next(&stream)).release; batch.release(&batch))
		for (int64_t i = 0; i < batch.length; i++, rows++)
			*force_sum += *schema.children[column]->format == 'f'
					      ? ((const float *)data(&batch, column))[i]
					      : ((const double *)data(&batch, column))[i];
	schema.release(&schema);
	stream.release(&stream);
	return rows;
}

TEST(tables_are_those_of_an_export, IN_FOLDER)
{
	static const struct {
		struct incise_export_options options;
		double tolerance; /* half a unit of CSV's last digit, or of a float, a row */
	} cases[] = {
		{{.min_count = 50}, 1e-5},
		{{.min_count = 50, .rate_hz = 100}, 1e-5},
		{{.min_count = 50, .depth_bins = 12, .velocity_bins = 10, .by_cut = true},
		 1e-8},
		{{.resample = true, .rate_hz = 1000}, 1e-5},
	};
	struct incise_recording *recording;

	record("a.rec", SHORT_SCRIPT, 20000 * MS);
	recording = open_it();
	for (size_t c = 0; c < sizeof(cases) / sizeof(*cases); c++) {
		struct incise_export_report report;
		double sum = 0, csv_sum = 0;
		int rows = count_rows(&cases[c].options, &sum), force = 0;
		char *text, *line;

		succeeds(!incise_export(&recording, 1, &cases[c].options, "a.csv",
					&report, &err));
		assert_true(rows > 50);
		assert_int_equal(rows, report.rows);
		text = text_of("a.csv");
		line = strtok(text, "\n");
		for (char *at = strstr(line, "force_N"); at > line; at--)
			force += *at == ',';
		while ((line = strtok(NULL, "\n"))) {
			for (int i = 0; i < force; i++)
				line = strchr(line, ',') + 1;
			csv_sum += atof(line);
		}
		if (!(fabs(sum - csv_sum) < rows * cases[c].tolerance))
			fail_msg("case %zu: %d rows, %.9g, not %.9g", c, rows, sum,
				 csv_sum);
		free(text);
	}
	incise_recording_close(recording);
}

static int stop_at_once(void *context, double share)
{
	return 1;
}

TEST(table_streams_end_early, IN_FOLDER)
{
	struct incise_export_options options = {.resample = true};
	struct ArrowArrayStream stream, other;
	struct ArrowArray batch;

	record("a.rec", SHORT_SCRIPT, 8000 * MS);
	/* released with batches left, and before the first */
	stream = open_stream("table", &options);
	other = open_stream("table", &options);
	batch = next(&stream);
	stream.release(&stream);
	other.release(&other);
	assert_int_equal(batch.n_children, 27);
	batch.release(&batch);
	/* by the caller's own progress; what came before may be read */
	options.progress = stop_at_once;
	stream = open_stream("table", &options);
	while (!stream.get_next(&stream, &batch)) {
		assert_non_null(batch.release);
		batch.release(&batch);
	}
	assert_string_equal(stream.get_last_error(&stream), "interrupted");
	assert_int_equal(stream.get_next(&stream, &batch), EINTR); /* again and again */
	stream.release(&stream);
}

TEST(refuses_what_cannot_be, IN_FOLDER)
{
	static const struct {
		const char *what, *sql;
		int open; /* -errno of opening; else the first batch fails with EINVAL */
		const char *said;
	} cases[] = {
		{"nothing", "", -EINVAL,
		 "no stream 'nothing' in a recording; there are:"},
		{"force", "UPDATE force SET t_ns = -1 WHERE seq = 3", 0,
		 "table force, row 3: its time"},
		{"tracker", "UPDATE tracker SET x_mm = 9e999 WHERE seq = 4", 0,
		 "stream tracker, block 0: a column is impossible"},
		{"tracker", "DELETE FROM tracker WHERE seq = 7", 0, "table tracker has"},
		{"table", "UPDATE force SET t_ns = -1 WHERE seq = 3", 0,
		 "table force, row 3: its time"},
		{"table", "UPDATE tracker SET z_mm = 1.0", 0, "no cut"},
	};
	struct incise_export_options options;

	incise_export_options_init(&options);
	for (size_t c = 0; c < sizeof(cases) / sizeof(*cases); c++) {
		struct incise_recording *recording;
		struct ArrowArrayStream stream;
		struct incise_error err = {0};
		struct ArrowArray batch;
		const char *said;
		int rc;

		record("a.rec", SHORT_SCRIPT, 1000 * MS);
		change(DB, cases[c].sql);
		recording = open_it();
		rc = incise_recording_stream(recording, cases[c].what, &options, &stream,
					     &err);
		assert_int_equal(rc, cases[c].open);
		if (!rc) {
			rc = stream.get_next(&stream, &batch);
			assert_true(rc == EINVAL || rc == ENODATA);
			assert_null(batch.release);
			snprintf(err.text, sizeof(err.text), "%s",
				 stream.get_last_error(&stream));
			assert_int_equal(stream.get_next(&stream, &batch), rc);
			stream.release(&stream);
		} else {
			assert_null(stream.release);
		}
		said = err.text;
		if (!strstr(said, cases[c].said))
			fail_msg("case %zu: %s", c, said);
		incise_recording_close(recording);
		nftw("a.rec", remove_entry, 8, FTW_DEPTH | FTW_PHYS);
	}
	record("a.rec", SHORT_SCRIPT, 1000 * MS);
	options.depth_bins = -1;
	{
		struct incise_recording *recording = open_it();
		struct ArrowArrayStream stream;

		assert_int_equal(incise_recording_stream(recording, "table", &options,
							 &stream, NULL),
				 -EINVAL);
		incise_recording_close(recording);
	}
}

TEST(texts_are_utf8, IN_FOLDER)
{
	struct ArrowArrayStream stream;
	struct ArrowArray batch;
	const int32_t *at;

	record("a.rec", SHORT_SCRIPT, 1000 * MS);
	change(DB, "DELETE FROM events; INSERT INTO events VALUES"
		   "(1, 'k', CAST(X'61C3A9FF1B62' AS TEXT)), (1, '', 'µs')");
	stream = open_stream("events", NULL);
	batch = next(&stream);
	assert_int_equal(batch.length, 2);
	at = data(&batch, 2);
	assert_int_equal(at[0], 0);
	assert_int_equal(at[1], 6);
	assert_int_equal(at[2], 9);
	assert_memory_equal(batch.children[2]->buffers[2], "aé??bµs", 9);
	batch.release(&batch);
	stream.release(&stream);
}

/* A child has no thread of its parent, and must not use its connections. */
TEST(streams_stay_in_their_process, IN_FOLDER)
{
	static const char *const names[] = {"force", "table"};
	struct incise_export_options options = {.resample = true};

	record("a.rec", SHORT_SCRIPT, 8000 * MS);
	for (int i = 0; i < 2; i++) {
		struct ArrowArrayStream stream = open_stream(names[i], &options);
		struct ArrowArray batch = next(&stream);
		pid_t child = fork();
		int status = -1;

		if (!child) {
			int rc = stream.get_next(&stream, &batch);

			rc = rc == EINVAL &&
			     strstr(stream.get_last_error(&stream), "before a fork");
			stream.release(&stream);
			_exit(rc ? 0 : 1);
		}
		assert_int_equal(waitpid(child, &status, 0), child);
		assert_int_equal(status, 0);
		batch.release(&batch);
		batch = next(&stream); /* the parent goes on */
		assert_non_null(batch.release);
		batch.release(&batch);
		stream.release(&stream);
	}
}
