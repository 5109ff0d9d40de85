// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/loop/state_reader.c: a reader next to a living and a dead writer, and malformed pages; garbage is in
 * ../../fuzz/state_page.c.
 */
#include "../unit.h"
#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <sys/stat.h>
#include "../../../lib/base/random.h"
#include "state_made.h"

static struct incise_state_now now;
static struct incise_tick ticks[INCISE_STATE_TICKS + 10];
static struct state_page page, good;
static struct incise_state *reader;

static int begin(void **state)
{
	int rc = made_page(state);

	reader = incise_state_open(made.path, NULL);
	return rc;
}

static int end(void **state)
{
	incise_state_close(reader);
	return made_end(state);
}

/* The page as it is, which nobody writes any more. */
static void load(void)
{
	FILE *file = fopen(made.path, "r");

	assert_non_null(file);
	assert_int_equal(fread(&page, sizeof(page), 1, file), 1);
	fclose(file);
	good = page;
	made_close();
}

static void store(size_t size)
{
	FILE *file = fopen(made.path, "w");

	assert_non_null(file);
	assert_int_equal(fwrite(&page, 1, size, file), size);
	fclose(file);
}

TEST(test_ring, begin, end)
{
	uint64_t early = 0, late = INCISE_STATE_NEWEST, lost = 0;

	assert_int_equal(incise_state_ticks(reader, &early, ticks, 10, &lost), 0);
	made_ticks(made.writer, 0, 100);
	assert_int_equal(incise_state_ticks(reader, &late, ticks, 10, &lost), 0);
	assert_int_equal(late, 100);
	/* In parts, oldest first. */
	for (int from = 0, n; from < 100; from += n) {
		n = incise_state_ticks(reader, &early, ticks, 30, NULL);
		assert_int_equal(n, from < 90 ? 30 : 10);
		for (int i = 0; i < n; i++) {
			struct incise_tick made_one = made_tick(from + i);

			assert_true(made_same(&ticks[i], &made_one));
		}
	}
	assert_int_equal(early, 100);
	assert_int_equal(incise_state_ticks(reader, &early, ticks, 30, NULL), 0);
	assert_int_equal(incise_state_ticks(reader, &early, ticks, 0, NULL), 0);
	made_ticks(made.writer, 100, 103);
	assert_int_equal(incise_state_ticks(reader, &late, ticks, 10, &lost), 3);
	assert_int_equal(ticks[0].t_ns, 100);
	assert_int_equal(lost, 0);
}

TEST(test_ring_that_went_round, begin, end)
{
	enum { N = 3 * INCISE_STATE_TICKS + 11 };
	uint64_t cursor = 5, lost = 1;
	int n;

	made_ticks(made.writer, 0, N);
	n = incise_state_ticks(reader, &cursor, ticks, INCISE_STATE_TICKS + 10, &lost);
	/* The oldest slot may be in use again. */
	assert_int_equal(n, INCISE_STATE_TICKS - 1);
	assert_int_equal(cursor, N);
	assert_int_equal(lost, 1 + N - 5 - n);
	for (int i = 0; i < n; i++)
		assert_int_equal(ticks[i].t_ns, N - n + i);
	/* A cursor beyond the end is corrected. */
	cursor = N + 1;
	assert_int_equal(incise_state_ticks(reader, &cursor, ticks, 10, &lost), 0);
	assert_int_equal(cursor, N);
}

struct busy {
	atomic_bool stop;
	int64_t written;
};

/* Like a loop: some ticks, then a pause in which a reader succeeds. */
static void *publish(void *arg)
{
	struct busy *busy = arg;

	while (!atomic_load(&busy->stop)) {
		int64_t more = 1 + busy->written % 50;

		made_ticks(made.writer, busy->written, busy->written + more);
		busy->written += more;
		for (int i = 0; i < 4; i++)
			sched_yield();
	}
	return NULL;
}

/* A copy that is reported as whole has fields of one tick only. */
static void whole(void)
{
	struct incise_tick made_one = made_tick((int64_t)now.ticks - 1);

	if (!now.ticks)
		return;
	assert_true(made_same(&now.tick, &made_one));
	assert_true(now.force_N == made_one.command_N[2]);
	assert_true(now.force_max_N == now.force_N);
	assert_int_equal(now.lateness_ns, now.tick.t_ns);
	assert_int_equal(now.cost_max_ns, 2 * now.tick.t_ns);
}

TEST(test_beside_a_writer, begin, end)
{
	struct busy busy = {0};
	uint64_t cursor = 0, lost = 0, got = 0;
	enum incise_run run = INCISE_RUN_STARTING;
	int64_t next = 0;
	pthread_t thread;

	incise_state_run(made.writer, run, incise_run_name(run));
	pthread_create(&thread, NULL, publish, &busy);
	for (int good = 0; good < 2000;) {
		int rc = incise_state_read(reader, &now), n;

		assert_true(rc == 0 || rc == -EAGAIN);
		if (!rc) {
			good++;
			whole();
			assert_true(now.alive && !now.torn);
			/* Another thread writes the other half. */
			assert_string_equal(now.reason, incise_run_name(now.run));
			incise_state_run(made.writer, run, incise_run_name(run));
			run = (enum incise_run)((run + 1) % INCISE_RUNS);
		}
		/* Not each time: then some are lost. */
		if (good % 100)
			continue;
		n = incise_state_ticks(reader, &cursor, ticks, INCISE_STATE_TICKS, &lost);
		assert_true(n >= 0);
		for (int i = 0; i < n; i++) {
			struct incise_tick made_one = made_tick(ticks[i].t_ns);

			assert_true(made_same(&ticks[i], &made_one));
			assert_true(ticks[i].t_ns >= next);
			next = ticks[i].t_ns + 1;
		}
		got += (uint64_t)n;
		assert_int_equal(got + lost, cursor);
	}
	atomic_store(&busy.stop, true);
	pthread_join(thread, NULL);
	assert_int_equal(incise_state_read(reader, &now), 0);
	assert_int_equal(now.ticks, busy.written);
	whole();
}

/* In the middle of a write: the reader waits for a living writer, not for a dead one. */
TEST(test_half_written, begin, end)
{
	static const size_t parts[] = {offsetof(struct state_page, run),
				       offsetof(struct state_page, live)};

	for (int i = 0; i < 2; i++) {
		int fd = open(made.path, O_WRONLY);
		uint64_t odd = 77;

		made_ticks(made.writer, 0, 3);
		/* All is in the file: the writer writes no part of it again. */
		assert_int_equal(pwrite(fd, &odd, sizeof(odd), (off_t)parts[i]), 8);
		assert_int_equal(incise_state_read(reader, &now), -EAGAIN);
		made_close();
		assert_int_equal(incise_state_read(reader, &now), 0);
		assert_true(now.torn && !now.alive);
		assert_int_equal(now.ticks, 3);
		close(fd);
		assert_int_equal(end(NULL) || begin(NULL), 0);
	}
}

/* An odd seq is repaired by the next write. */
TEST(test_healed, begin, end)
{
	int fd = open(made.path, O_WRONLY);
	uint64_t odd = 77;

	pwrite(fd, &odd, sizeof(odd), offsetof(struct state_page, live));
	made_ticks(made.writer, 0, 1);
	assert_int_equal(incise_state_read(reader, &now), 0);
	assert_int_equal(now.ticks, 1);
	close(fd);
}

static void refused(const char *path, int code, const char *text)
{
	struct incise_error err = {0};
	struct incise_state *reader = incise_state_open(path, &err);

	if (reader)
		print_error("opened: %s\n", text);
	assert_null(reader);
	assert_int_equal(errno, code);
	assert_int_equal(err.code, code);
	assert_says(err.text, path, text);
}

TEST(test_what_is_no_page, begin, end)
{
	load();
	refused("/nosuch/a.state", ENOENT, "No such file");
	refused("/dev/null", EINVAL, "not a status file");
	refused(made.dir, EINVAL, "not a status file");
	store(0);
	refused(made.path, EINVAL, "not a status file");
	store(sizeof(page.head) - 1);
	refused(made.path, EINVAL, "not a status file");
	store(sizeof(page) - 8);
	refused(made.path, EINVAL, "truncated");
	page.head.magic[3]++;
	store(sizeof(page));
	refused(made.path, EINVAL, "not a status file");
	page = good;
	page.head.major++;
	store(sizeof(page));
	refused(made.path, EPROTO, "version 2.0");
	page = good;
	page.head.rate_hz = NAN;
	store(sizeof(page));
	refused(made.path, EINVAL, "damaged");
	unlink(made.path);
	assert_int_equal(mkfifo(made.path, 0600), 0);
	refused(made.path, EINVAL, "not a status file"); /* and does not wait */
}

/* Each offset, size and count of the head, changed. */
TEST(test_places_astray, begin, end)
{
	static const uint64_t values[] = {0,
					  1,
					  7,
					  UINT64_MAX,
					  UINT64_MAX - 7,
					  1ULL << 63,
					  (1ULL << 61) + 8,
					  sizeof(struct state_page),
					  sizeof(struct state_page) + 8,
					  sizeof(struct state_page) - 8};
	size_t begin = offsetof(struct state_head, head);
	size_t end = offsetof(struct state_head, pid);
	int opened = 0;

	made_ticks(made.writer, 0, 100);
	load();
	for (size_t at = begin; at < end; at += 8)
		for (size_t i = 0; i < sizeof(values) / sizeof(*values); i++) {
			struct incise_state *reader;
			uint64_t cursor = 0;

			page = good;
			memcpy((char *)&page + at, &values[i], 8);
			store(sizeof(page));
			reader = incise_state_open(made.path, NULL);
			if (!reader)
				continue;
			/* Wrong numbers may be read, but only within the file. */
			opened++;
			incise_state_read(reader, &now);
			incise_state_ticks(reader, &cursor, ticks, 100, NULL);
			incise_state_close(reader);
		}
	/* Nearly every changed number is rejected. */
	assert_true(opened < 30);
}

/* A later minor version has larger parts. */
TEST(test_larger_parts, begin, end)
{
	struct incise_tick made_one = made_tick(2);
	struct state_head *head = &page.head;
	uint64_t cursor = 0, lost = 0;
	static unsigned char ring[64 + 3 * 512];

	made_ticks(made.writer, 0, 3);
	load();
	/* Slots of 512 bytes, 3 of them, in the place of what was there. */
	memcpy(ring, &page.written, 8);
	for (int i = 0; i < 3; i++)
		memcpy(ring + 8 + i * 512, &page.slot[i], sizeof(page.slot[i]));
	memcpy(&page.written, ring, sizeof(ring));
	head->minor = 4;
	head->ring.size = 512;
	head->ring.count = 3;
	head->head.size += 8;
	store(sizeof(page));
	incise_state_close(reader);
	reader = incise_state_open(made.path, NULL);
	assert_non_null(reader);
	assert_int_equal(incise_state_read(reader, &now), 0);
	assert_int_equal(now.ticks, 3);
	assert_int_equal(incise_state_ticks(reader, &cursor, ticks, 10, &lost), 2);
	assert_true(made_same(&ticks[1], &made_one));
	assert_int_equal(lost, 1);
}

/* Cut off after it was opened: an errno, and no SIGBUS. */
TEST(test_cut_off_later, begin, end)
{
	const off_t all = offsetof(struct state_page, cost) + sizeof(page.cost);
	uint64_t cursor = 0;

	made_ticks(made.writer, 0, 3);
	made_close();
	for (off_t size = sizeof(page) - 8; size > -4000; size -= 4000) {
		assert_int_equal(truncate(made.path, size > 0 ? size : 0), 0);
		cursor = 0;
		/* The ring is behind all the rest. */
		assert_int_equal(incise_state_read(reader, &now), size < all ? -EIO : 0);
	}
	assert_int_equal(incise_state_ticks(reader, &cursor, ticks, 10, NULL), -EIO);
}
