/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A line to an emulator in the same process, in a time of its own: a read that finds nothing
 * lets time go on to the next record, or to its end. For a thread, @clock waits instead.
 */
#ifndef INCISE_TEST_POLHEMUS_LINE_H
#define INCISE_TEST_POLHEMUS_LINE_H

#include <errno.h>
#include "../../../lib/device/polhemus/polhemus_line.h"
#include "../../../lib/device/polhemus/polhemus_model.h"
#include "../../polhemus/emulator.h"

struct test_line {
	struct polhemus_line line;
	struct emulator *emulator;
	int64_t now_ns;
	int64_t (*clock)(int64_t until_ns); /* waits, and returns the time */
	size_t most;			    /* bytes of a read; 0: as many as fit */
	int64_t read_ns; /* that each takes, from the first command with slow_from on */
	char slow_from;	 /* 0: from the beginning */
	int gone;	 /* what all calls return */
	bool mute;	 /* nothing comes through */
	int64_t late_ns; /* nor before this time: then all that waited */
	int reopened;
	char said[2000]; /* all commands */
	size_t n_said;
};

static int test_line_write(struct polhemus_line *line, const void *bytes, size_t n)
{
	struct test_line *l = (struct test_line *)line;

	if (l->gone)
		return l->gone;
	for (size_t i = 0; i < n && l->n_said + 1 < sizeof(l->said); i++)
		l->said[l->n_said++] = ((const char *)bytes)[i];
	emulator_write(l->emulator, bytes, n);
	return 0;
}

static ssize_t test_line_read(struct polhemus_line *line, void *bytes, size_t size,
			      int64_t *t_ns, int timeout_ms)
{
	struct test_line *l = (struct test_line *)line;
	int64_t next_ns, end_ns;
	size_t n;

	if (l->gone)
		return l->gone;
	if (l->clock)
		l->now_ns = l->clock(0);
	end_ns = l->now_ns + timeout_ms * INT64_C(1000000);
	if (l->most && size > l->most)
		size = l->most;
	if (!l->slow_from || memchr(l->said, l->slow_from, l->n_said))
		l->now_ns += l->read_ns;
	emulator_advance(l->emulator, l->now_ns);
	if (l->now_ns < l->late_ns) {
		*t_ns = l->now_ns = end_ns;
		return 0;
	}
	n = emulator_take(l->emulator, bytes, size);
	if (!n) {
		next_ns = emulator_next_ns(l->emulator);
		l->now_ns = next_ns < end_ns && !l->mute ? next_ns : end_ns;
		if (l->clock)
			l->now_ns = l->clock(l->now_ns);
		emulator_advance(l->emulator, l->now_ns);
		n = emulator_take(l->emulator, bytes, size);
	}
	n = l->mute ? 0 : n;
	*t_ns = l->now_ns;
	return (ssize_t)n;
}

static int test_line_reopen(struct polhemus_line *line)
{
	struct test_line *l = (struct test_line *)line;

	l->reopened++;
	return l->gone;
}

static void test_line_close(struct polhemus_line *line)
{
}

static const struct polhemus_line_ops test_line_ops = {
	.write = test_line_write,
	.read = test_line_read,
	.reopen = test_line_reopen,
	.close = test_line_close,
};

static inline void test_line_init(struct test_line *l, struct emulator *e, int family)
{
	*l = (struct test_line){
		.line = {.ops = &test_line_ops, .family = family, .name = "emulator"},
		.emulator = e,
		.now_ns = e->now_ns,
	};
}

#endif
