// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The reader of a loop's state under libFuzzer: a good page of which bytes are others, and which
 * may be cut off, before it is opened or after. Whatever comes of it is a page's or an errno.
 *
 *   when 1 (bit 0: patch before opening, bit 1: cut off) · length 3 (of what is left then)
 *   then, until the bytes end: offset 3 · n 1 · n bytes
 */
#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>
#include "../../lib/loop/state_page.h"

/* A small ring, so that it is fast; it went round. */
#define SLOTS 32
#define TICKS 100
#define SIZE offsetof(struct state_page, slot[SLOTS])

static struct state_page good;
static struct incise_state_now now;
static struct incise_tick ticks[SLOTS + 1];
static int fd = -1;
static char path[40];

static void wrong(const char *what)
{
	fprintf(stderr, "state_page: %s\n", what);
	abort();
}

static struct state_part part(size_t offset, size_t size, size_t count)
{
	return (struct state_part){offset, size, count};
}

static void make_good(void)
{
	struct state_head *head = &good.head;

	memcpy(head->magic, STATE_MAGIC, 8);
	head->major = STATE_MAJOR;
	head->size = SIZE;
	head->rate_hz = 1000;
	head->head = part(0, sizeof(*head), 1);
	head->run = part(offsetof(struct state_page, run), sizeof(good.run), 1);
	head->live = part(offsetof(struct state_page, live), sizeof(good.live), 1);
	head->lateness =
		part(offsetof(struct state_page, lateness), 8, INCISE_STATE_BUCKETS);
	head->cost = part(offsetof(struct state_page, cost), 8, INCISE_STATE_BUCKETS);
	head->ring =
		part(offsetof(struct state_page, written), sizeof(good.slot[0]), SLOTS);
	good.written = TICKS;
	for (uint64_t i = TICKS - SLOTS; i < TICKS; i++)
		good.slot[i % SLOTS].number = i + 1;
	fd = memfd_create("page", MFD_CLOEXEC);
	if (fd < 0 || write(fd, &good, SIZE) != (ssize_t)SIZE)
		wrong("no page");
	snprintf(path, sizeof(path), "/proc/self/fd/%d", fd);
}

static size_t number(const uint8_t *data)
{
	return (data[0] | (size_t)data[1] << 8 | (size_t)data[2] << 16) % SIZE;
}

/* As the input says, or back to what it was. */
static void patch(const uint8_t *data, size_t size, int back)
{
	while (size >= 4) {
		size_t at = number(data), n = data[3];

		data += 4;
		size -= 4;
		n = n < size ? n : size;
		n = n < SIZE - at ? n : SIZE - at;
		if (pwrite(fd, back ? (const uint8_t *)&good + at : data, n, (off_t)at) !=
		    (ssize_t)n)
			wrong("cannot write");
		data += n;
		size -= n;
	}
}

static void read_ticks(struct incise_state *state)
{
	uint64_t cursor = 0, lost = 0;
	int n = incise_state_ticks(state, &cursor, ticks, SLOTS + 1, &lost);

	if (n < 0 && n != -EIO)
		wrong("an errno of its own");
	if (n > SLOTS + 1)
		wrong("more ticks than there is room");
	if (n >= 0 && (uint64_t)n + lost != cursor)
		wrong("ticks that were neither read nor lost");
	for (int i = 0; i < n; i++)
		if (ticks[i].phase > INCISE_PHASE_INSERTION ||
		    ticks[i].tool > INCISE_TOOL_TUBE ||
		    ticks[i].flags >> INCISE_TICK_FLAGS)
			wrong("no tick");
}

static void read_all(struct incise_state *state)
{
	int rc = incise_state_read(state, &now);

	/* Nobody holds it: one who died in the middle of writing is not waited for. */
	if (rc && rc != -EIO)
		wrong("an errno of its own");
	if (!rc && ((unsigned int)now.run >= INCISE_RUNS || now.n_stages < 0 ||
		    now.n_stages > INCISE_PLAN_STAGES_MAX ||
		    !memchr(now.reason, 0, sizeof(now.reason)) ||
		    !memchr(now.scene, 0, sizeof(now.scene)) ||
		    !memchr(now.rig, 0, sizeof(now.rig)) ||
		    !memchr(now.policy, 0, sizeof(now.policy))))
		wrong("no state");
	incise_state_quantile(&now.lateness, 0.999);
	read_ticks(state);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct incise_state *state;

	if (size < 4)
		return 0;
	if (fd < 0)
		make_good();
	if (data[0] & 1)
		patch(data + 4, size - 4, 0);
	state = incise_state_open(path, NULL);
	if (!(data[0] & 1))
		patch(data + 4, size - 4, 0);
	if (data[0] & 2 && ftruncate(fd, (off_t)number(data + 1)))
		wrong("cannot cut off");
	if (state)
		read_all(state);
	incise_state_close(state);
	if (data[0] & 2 && pwrite(fd, &good, SIZE, 0) != (ssize_t)SIZE)
		wrong("cannot write");
	patch(data + 4, size - 4, 1);
	return 0;
}
